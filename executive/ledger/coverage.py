"""Probability, for each point of a grid on the table, that looks have missed an object at the point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import TableConfig
from executive.cell.detection import Detections
from executive.geometry import Array
from executive.ledger.belief import compute_repeat_probability, make_viewpoint_key

GRID_PITCH = 0.02
"""Distance between neighbouring grid points [m]; smaller than the smallest object."""
GRID_MARGIN = 0.4
"""Width of the part of the grid outside the workspace [m]; dropped or pushed objects stay on the grid."""
PRIOR_OUTSIDE = 0.01
"""Prior probability of an object at a grid point outside the workspace before any drop or push."""
PRIOR_OUTSIDE_AFTER_CHANGE = 0.1
"""Prior probability of an object at a grid point outside the workspace after a drop or a push."""
MIN_MISS_PROBABILITY = 1e-4
"""Lower limit of the miss probability after many looks, because looks are not fully independent."""
RECENT_FULL_LOOK_COUNT = 4
"""Number of recent looks at the whole image that determine which points outside the workspace are visible."""
BORDER_WIDTH = 12.0
"""Width of the border of an image in which points do not count as visible [pixel]."""
WORKSPACE_TOLERANCE = 0.03
"""Distance outside the workspace up to which the centre of an object still counts as inside [m]."""
PRIOR_INSIDE = 0.1
"""Prior probability of an object at a grid point of the workspace: three objects of 6 cm x 6 cm on the
22 cm x 44 cm of the shipped cells."""
POINT_HEIGHT = 0.025
"""Height of the grid points above the table [m]: the centre of a typical object."""


class Coverage:
    """Probability, for each of `N` grid points on the table, that looks have missed an object at the point.

    A look is an image with its detections. In the workspace, the value of a point is the probability that
    looks miss an object at the point; it starts at 1. Outside the workspace, the value includes the prior
    probability of an object, and starts low. A look multiplies the value of each visible point by the
    probability of another miss. A change of the table that may have put an object at a point resets its
    value. Points that are occluded by the arm, outside the image, or changed since the capture keep their
    values.

    Args:
        table: The workspace.
    """

    def __init__(self, table: TableConfig) -> None:
        (left, right), (low, high) = table.x, table.y
        xs = np.arange(left - GRID_MARGIN, right + GRID_MARGIN + GRID_PITCH / 2, GRID_PITCH)
        ys = np.arange(low - GRID_MARGIN, high + GRID_MARGIN + GRID_PITCH / 2, GRID_PITCH)
        self._points = np.array([(x, y, POINT_HEIGHT) for x in xs for y in ys])
        self._low, self._high = np.array([left, low]), np.array([right, high])
        self._workspace_mask = self._find_points_inside(self._points, 0.0)
        inside = self._find_points_inside(self._points, WORKSPACE_TOLERANCE)
        self._priors = np.where(inside, PRIOR_INSIDE, 1.0)
        self._miss_probabilities = np.where(inside, 1.0, PRIOR_OUTSIDE)
        self._reset_values = np.where(inside, 1.0, PRIOR_OUTSIDE_AFTER_CHANGE)
        self._last_changes = np.zeros(len(self._points), dtype=int)
        self._masks_by_viewpoint: dict[str, NDArray[np.bool_]] = {}
        """Masks `(N,)` of the points that looks from each viewpoint have searched."""
        self._full_look_count = 0
        self._last_full_looks = np.full(len(self._points), -RECENT_FULL_LOOK_COUNT)

    def update(self, look: Detections, uncertain_positions: Sequence[Array] = ()) -> None:
        """Update the probabilities with a look; the points of detected objects count as searched.

        Points near the positions `(3,)` [m] of low-confidence detections do not count as searched.
        """
        searched = look.is_searched(self._points)
        for position in uncertain_positions:
            searched &= self._find_distances(position) > GRID_PITCH
        unchanged = searched & (self._last_changes <= look.frame.epoch)
        # A detector gets another image in another view: of 31 objects that the detector of the cell fasteners
        # missed in the view `table`, the detector missed 4 in the view `full` of the same pose.
        viewpoint = f"{make_viewpoint_key(look)} {look.view}"
        miss_rate, repeated = look.error_rates.miss_rate, look.error_rates.repeated
        repeated_miss_rate = compute_repeat_probability(miss_rate, repeated)
        searched_before = self._masks_by_viewpoint.setdefault(viewpoint, np.zeros(len(self._points), bool))
        miss_rates = np.where(searched_before[unchanged], repeated_miss_rate, miss_rate)
        self._miss_probabilities[unchanged] *= miss_rates
        self._miss_probabilities = self._miss_probabilities.clip(MIN_MISS_PROBABILITY)
        searched_before |= unchanged
        if look.view == "full":
            self._full_look_count += 1
            # Points at the border of the image do not count as visible, because no later look may show them.
            is_visible = searched & look.is_in_area(self._points, BORDER_WIDTH)
            self._last_full_looks[is_visible] = self._full_look_count

    def reset_near(self, centre: Array, radius: float, change: int) -> None:
        """Reset the points within `radius` [m] of `centre` `(3,)` [m], to which objects may have been moved.

        `change` is the number of the change of the table that may have moved the objects.
        """
        near = self._find_distances(centre) <= radius
        self._miss_probabilities[near], self._last_changes[near] = self._reset_values[near], change
        for searched in self._masks_by_viewpoint.values():
            searched[near] = False

    def find_miss_probability(self, position: Array) -> float:
        """Return the probability that looks have missed an object at `position` `(3,)` [m]."""
        distances = self._find_distances(position)
        nearest = int(np.argmin(distances))
        return float(self._miss_probabilities[nearest]) if distances[nearest] <= GRID_PITCH else PRIOR_OUTSIDE

    def is_in_workspace(self, position: Array) -> bool:
        """Return True if `position` `(3,)` [m] is at most `WORKSPACE_TOLERANCE` outside the workspace."""
        return bool(self._find_points_inside(position[None], WORKSPACE_TOLERANCE)[0])

    @property
    def max_object_probability(self) -> float:
        """Largest probability, over the visible grid points, that an undetected object lies at the point.

        The probability is 1 before the first look at the whole image.
        """
        if not self._full_look_count:
            return 1.0
        return float((self._priors * self._miss_probabilities)[self._visible_mask].max())

    def is_visible(self, position: Array) -> bool:
        """Return True if all grid points around `position` `(3,)` [m] are visible.

        At the edge of the area that the arm occludes, a point may be visible although its neighbour never is.
        """
        near = self._find_distances(position) <= GRID_PITCH
        return bool(near.any() and self._visible_mask[near].all())

    @property
    def _visible_mask(self) -> NDArray[np.bool_]:
        """Mask `(N,)` of the points in the workspace or in one of the last looks at the whole image."""
        return self._workspace_mask | (self._last_full_looks > self._full_look_count - RECENT_FULL_LOOK_COUNT)

    def _find_distances(self, position: Array) -> Array:
        """Return the horizontal distance `(N,)` [m] of each grid point from `position` `(3,)` [m]."""
        return np.asarray(np.hypot(*(self._points - position)[:, :2].T))

    def _find_points_inside(self, points: Array, margin: float) -> NDArray[np.bool_]:
        """Return a mask `(M,)` of the points `(M, 3)` [m] at most `margin` [m] outside the workspace."""
        xy = points[:, :2]
        inside = (self._low - margin <= xy) & (xy <= self._high + margin)
        return np.asarray(inside.all(axis=1))
