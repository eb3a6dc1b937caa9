"""Points of the table at which looks may have missed an object, and positions that may have changed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import TableConfig
from executive.cell.frame import Detections
from executive.geometry import Array
from executive.ledger.belief import compute_repeat_probability, make_viewpoint_key
from executive.ledger.item import ItemRecord

GRID_PITCH = 0.02
"""Distance between neighbouring grid points [m], smaller than the smallest object."""
GRID_MARGIN = 0.4
"""Width of the margin of the grid around the workspace [m]; dropped and pushed objects stay on the grid."""
PRIOR_OUTSIDE_WORKSPACE = 0.005
"""Prior probability of an object at a grid point outside the workspace: between one and two objects of
6 cm x 6 cm in the margin of the shipped cells, which measures 1.2 m². A push or a drop moves one object, and
adds 0.003; most of the objects that the robot moves stay in the workspace."""
MIN_MISS_PROBABILITY = 1e-4
"""Lower limit of the miss probability; correlated looks must not add evidence without limit."""
RECENT_FULL_LOOK_COUNT = 4
"""Number of most recent looks at the whole image; a point that is in none of these looks is not visible."""
BORDER_WIDTH = 12.0
"""Width of the border of an image in which a point does not count as visible [pixel]."""
WORKSPACE_TOLERANCE = 0.03
"""Maximum distance from the workspace of an object that counts as inside [m]."""
PRIOR_IN_WORKSPACE = 0.1
"""Prior probability of an object at a grid point of the workspace: three objects of 6 cm x 6 cm in the
workspace of the shipped cells, which measures 22 cm x 44 cm."""
POINT_HEIGHT = 0.025
"""Height of the grid points above the table [m]: the centre of a typical object."""


class Coverage:
    """Probability, for each of `N` grid points on the table, that looks have missed an object at the point.

    A look is an image with its detections. The miss probability of a point is the probability that all looks
    missed an object at the point. Its initial value is 1 in the workspace; outside, it is the prior
    probability of an object at the point. A look multiplies the values of the searched points by the miss
    rate of the detector. A change of the table that may have moved an object to a point resets the value.

    Changes are numbered from 1. The parameter `change_count` of a method is the number of changes before a
    look; later changes may have moved objects.

    Args:
        table: The workspace.
    """

    def __init__(self, table: TableConfig) -> None:
        self._min_xy, self._max_xy = np.array([table.x, table.y]).T
        low = self._min_xy - GRID_MARGIN
        high = self._max_xy + GRID_MARGIN + GRID_PITCH / 2
        xs = np.arange(low[0], high[0], GRID_PITCH)
        ys = np.arange(low[1], high[1], GRID_PITCH)
        self._points = np.array([(x, y, POINT_HEIGHT) for x in xs for y in ys])
        self._workspace_mask = self._find_points_inside(self._points, 0.0)
        inside_mask = self._find_points_inside(self._points, WORKSPACE_TOLERANCE)
        self._priors = np.where(inside_mask, PRIOR_IN_WORKSPACE, 1.0)
        """Priors `(N,)`; 1 outside the workspace: `_miss_probabilities` starts there at the prior."""
        self._initial_values = np.where(inside_mask, 1.0, PRIOR_OUTSIDE_WORKSPACE)
        """Miss probabilities `(N,)` before the first look, and after a change of the table."""
        self._miss_probabilities = self._initial_values.copy()
        self._last_change_numbers = np.zeros(len(self._points), dtype=int)
        """Number of the last change of the table near each point `(N,)`."""
        self._searched_masks: dict[str, NDArray[np.bool_]] = {}
        """Masks `(N,)` of the points that earlier looks searched, by viewpoint and view."""
        self._ever_searched_mask = np.zeros(len(self._points), dtype=bool)
        """Mask `(N,)` of the points that any look searched, also before changes of the table."""
        self._full_look_count = 0
        self._last_full_look_numbers = np.full(len(self._points), -RECENT_FULL_LOOK_COUNT)
        """Number of the last look at the whole image that showed each point `(N,)`."""
        self._changes: list[tuple[Array, float]] = []
        """Centre `(3,)` [m] and radius [m] of each change; the radius is infinite for the whole table."""

    @property
    def change_count(self) -> int:
        """Number of changes of the table so far."""
        return len(self._changes)

    def update(self, look: Detections, uncertain_positions: Sequence[Array] = ()) -> None:
        """Update the miss probabilities of the points that a look searched.

        Points near the positions `(3,)` [m] of doubtful detections do not count as searched.
        """
        visible_mask = look.compute_searched_mask(self._points)  # Points that this look shows.
        for position in uncertain_positions:
            visible_mask &= self._compute_distances(position) > GRID_PITCH
        searched_mask = visible_mask & (self._last_change_numbers <= look.frame.change_count)
        # The crop (`table`) and the full image of one pose count as two viewpoints: in the cell fasteners,
        # the detector found in the full image 27 of the 31 objects that it missed in the crop.
        viewpoint = f"{make_viewpoint_key(look)} {look.view}"
        miss_rate = look.error_rates.miss_rate
        repeated_miss_rate = compute_repeat_probability(miss_rate, look.error_rates.repeated)
        earlier_searched_mask = self._searched_masks.setdefault(viewpoint, np.zeros(len(self._points), bool))
        miss_rates = np.where(earlier_searched_mask, repeated_miss_rate, miss_rate)
        self._miss_probabilities[searched_mask] *= miss_rates[searched_mask]
        self._miss_probabilities = self._miss_probabilities.clip(MIN_MISS_PROBABILITY)
        earlier_searched_mask |= searched_mask
        self._ever_searched_mask |= searched_mask
        if look.view == "full":
            self._full_look_count += 1
            # Points at the border of the image do not count as visible, because no later look may show them.
            in_area_mask = look.frame.compute_area_mask(self._points, look.area, BORDER_WIDTH)
            self._last_full_look_numbers[visible_mask & in_area_mask] = self._full_look_count

    def record_change(self, centre: Array, radius: float) -> None:
        """Record that objects within `radius` [m] of `centre` `(3,)` [m] may have been moved."""
        self._changes.append((centre, radius))
        near_mask = self._compute_distances(centre) <= radius
        self._miss_probabilities[near_mask] = self._initial_values[near_mask]
        self._last_change_numbers[near_mask] = self.change_count
        for searched_mask in self._searched_masks.values():
            searched_mask[near_mask] = False

    def is_unmoved(self, record: ItemRecord) -> bool:
        """Return True if no change after the last detection of an item may have moved the item."""
        return self.is_unchanged(record.position, record.change_count)

    def is_unchanged(self, position: Array, change_count: int) -> bool:
        """Return True if no change after `change_count` may have moved an object at `position` `(3,)` [m]."""
        return self.find_change_number(position, change_count) is None

    def find_change_number(self, position: Array, change_count: int) -> int | None:
        """Return the number of the first change after `change_count` near `position` `(3,)` [m], or None."""
        for number, (centre, radius) in enumerate(self._changes[change_count:], change_count + 1):
            if float(np.linalg.norm(centre[:2] - position[:2])) <= radius:
                return number
        return None

    def is_table_unchanged(self, change_count: int) -> bool:
        """Return True if no change after `change_count` concerns the whole table."""
        return all(math.isfinite(radius) for _, radius in self._changes[change_count:])

    def find_miss_probability(self, position: Array) -> float:
        """Return the probability that looks have missed an object at `position` `(3,)` [m]."""
        distances = self._compute_distances(position)
        nearest = int(np.argmin(distances))
        is_on_grid = distances[nearest] <= GRID_PITCH
        return float(self._miss_probabilities[nearest]) if is_on_grid else PRIOR_OUTSIDE_WORKSPACE

    def was_searched(self, position: Array) -> bool:
        """Return True if a look, at any time, searched the table at `position` `(3,)` [m]."""
        return bool(self._ever_searched_mask[np.argmin(self._compute_distances(position))])

    def is_in_workspace(self, position: Array) -> bool:
        """Return True if `position` `(3,)` [m] is in the workspace or at most `WORKSPACE_TOLERANCE` away."""
        return bool(self._find_points_inside(position[None], WORKSPACE_TOLERANCE)[0])

    def find_max_object_probability(self, known_positions: Sequence[Array] = ()) -> float:
        """Return the largest probability, over the visible grid points, of an undetected object at the point.

        Points at the known objects with the given positions `(3,)` [m] do not count. The probability is 1
        before the first look at the whole image.
        """
        if not self._full_look_count:
            return 1.0
        mask = self._visible_mask.copy()
        for position in known_positions:
            mask &= self._compute_distances(position) > GRID_PITCH
        return float((self._priors * self._miss_probabilities)[mask].max(initial=0.0))

    def is_visible(self, position: Array) -> bool:
        """Return True if all grid points around `position` `(3,)` [m] are visible.

        Some of the points may be invisible, because the arm occludes them in every look.
        """
        near_mask = self._compute_distances(position) <= GRID_PITCH
        return bool(near_mask.any() and self._visible_mask[near_mask].all())

    @property
    def _visible_mask(self) -> NDArray[np.bool_]:
        """Mask `(N,)` of the points in the workspace or in one of the last looks at the whole image."""
        first_recent_number = self._full_look_count - RECENT_FULL_LOOK_COUNT + 1
        return self._workspace_mask | (self._last_full_look_numbers >= first_recent_number)

    def _compute_distances(self, position: Array) -> Array:
        """Return the horizontal distance `(N,)` [m] of each grid point from `position` `(3,)` [m]."""
        return np.asarray(np.hypot(*(self._points - position)[:, :2].T))

    def _find_points_inside(self, points: Array, margin: float) -> NDArray[np.bool_]:
        """Return a mask `(M,)` of the points `(M, 3)` [m] at most `margin` [m] outside the workspace."""
        xy = points[:, :2]
        inside_mask = (self._min_xy - margin <= xy) & (xy <= self._max_xy + margin)
        return np.asarray(inside_mask.all(axis=1))
