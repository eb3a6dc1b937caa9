"""Probability, for each place on the table, that looks have overlooked an object there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import TableConfig
from executive.cell.detection import Detections
from executive.geometry import Array
from executive.ledger.belief import repeat_probability, viewpoint_of

PITCH = 0.02
"""Pitch of the grid of points on the table [m]; smaller than the smallest object."""
WATCHED_MARGIN = 0.4
"""Width of the watched margin around the workspace [m]; dropped or pushed objects stay within the margin."""
PRIOR_OUTSIDE = 0.01
"""Prior probability of an object at a place outside the workspace before any drop or push."""
PRIOR_OUTSIDE_AFTER_CHANGE = 0.1
"""Probability of an object at a place outside the workspace after a drop or a push."""
MIN_PROBABILITY = 1e-4
"""Lower limit of the probability after many looks, because looks are not fully independent."""
RECENT_FULL_LOOKS = 4
"""Number of recent full images; a place outside the workspace is in sight if one of these images shows it."""
BORDER_WIDTH = 12.0
"""Width of the border of an image in which points do not count as shown [pixel]."""
EDGE_MARGIN = 0.03
"""Distance outside the workspace up to which the centre of an object still counts as inside [m]."""
PRIOR_INSIDE = 0.1
"""Prior probability that an object lies at a given place of the workspace: three objects of 6 cm x 6 cm on
the 22 cm x 44 cm of the shipped cells."""
POINT_HEIGHT = 0.025
"""Height of the points above the table [m]: the centre of a typical object."""


class Coverage:
    """Probability, for each grid point of the table, that looks have overlooked an object there.

    In the workspace, the probability is conditional on an object being there, and starts at 1. Outside, it
    includes the probability of an object, and starts low. A look multiplies the value of each searched point
    by the probability of another miss. A change that may have put an object at a point resets its value.
    Points that a look does not show keep their values: points hidden by the arm, outside the image, or
    changed since the capture.

    Args:
        table: The workspace.
    """

    def __init__(self, table: TableConfig) -> None:
        (left, right), (low, high) = table.x, table.y
        xs = np.arange(left - WATCHED_MARGIN, right + WATCHED_MARGIN + PITCH / 2, PITCH)
        ys = np.arange(low - WATCHED_MARGIN, high + WATCHED_MARGIN + PITCH / 2, PITCH)
        self._points = np.array([(x, y, POINT_HEIGHT) for x in xs for y in ys])
        self._low, self._high = np.array([left, low]), np.array([right, high])
        self._workspace = self._within(self._points, 0.0)
        inside = self._within(self._points, EDGE_MARGIN)
        self._prior = np.where(inside, PRIOR_INSIDE, 1.0)
        self._overlooked = np.where(inside, 1.0, PRIOR_OUTSIDE)
        self._after_change = np.where(inside, 1.0, PRIOR_OUTSIDE_AFTER_CHANGE)
        self._change_epochs = np.zeros(len(self._points), dtype=int)
        self._searched_from: dict[str, NDArray[np.bool_]] = {}
        self._full_looks = 0
        self._last_shown = np.full(len(self._points), -RECENT_FULL_LOOKS)

    def update(self, detections: Detections, doubtful: Sequence[Array] = ()) -> None:
        """Update the probabilities after a look; places of found objects count as searched.

        Points near the positions `doubtful` `(3,)` [m] of doubtful detections do not count as searched.
        """
        searched = detections.is_searched(self._points)
        for position in doubtful:
            searched &= self._distances(position) > PITCH
        now = searched & (self._change_epochs <= detections.frame.epoch)
        # A detector gets another image in another view: of 31 objects that the detector of the cell fasteners
        # missed in the view `table`, the detector missed 4 in the view `full` of the same pose.
        viewpoint = f"{viewpoint_of(detections)} {detections.view}"
        misses, repeated = detections.error_rates.misses, detections.error_rates.repeated
        searched_before = self._searched_from.setdefault(viewpoint, np.zeros(len(self._points), bool))
        self._overlooked[now] *= np.where(searched_before[now], repeat_probability(misses, repeated), misses)
        self._overlooked = self._overlooked.clip(MIN_PROBABILITY)
        searched_before |= now
        if detections.view == "full":
            self._full_looks += 1
            # Points at the border of the image do not count as shown, because no later look may show them.
            self._last_shown[searched & detections.is_in_area(self._points, BORDER_WIDTH)] = self._full_looks

    def reset_near(self, centre: Array, radius: float, epoch: int) -> None:
        """Reset points within `radius` [m] of `centre`; change no. `epoch` may have put an object there."""
        near = self._distances(centre) <= radius
        self._overlooked[near], self._change_epochs[near] = self._after_change[near], epoch
        for searched in self._searched_from.values():
            searched[near] = False

    def find_miss_probability(self, position: Array) -> float:
        """Return the probability that an object at `position` `(3,)` [m] has been overlooked."""
        distances = self._distances(position)
        nearest = int(np.argmin(distances))
        return float(self._overlooked[nearest]) if distances[nearest] <= PITCH else PRIOR_OUTSIDE

    def is_in_workspace(self, position: Array) -> bool:
        """Return True if `position` `(3,)` [m] is at most `EDGE_MARGIN` outside the workspace."""
        return bool(self._within(position[None], EDGE_MARGIN)[0])

    @property
    def max_object_probability(self) -> float:
        """Maximum over the points of the probability that an overlooked object lies there.

        Only points of the workspace and points shown in one of the last full images count. The maximum is 1
        before the first full image.
        """
        if not self._full_looks:
            return 1.0
        return float((self._prior * self._overlooked)[self._visible_points].max())

    def is_in_sight(self, position: Array) -> bool:
        """Return True if the camera can see all grid points around `position` `(3,)` [m].

        At the edge of the area hidden by the arm, a point may be visible while a place beside it never is.
        """
        around = self._distances(position) <= PITCH
        return bool(around.any() and self._visible_points[around].all())

    @property
    def _visible_points(self) -> NDArray[np.bool_]:
        return self._workspace | (self._last_shown > self._full_looks - RECENT_FULL_LOOKS)

    def _distances(self, position: Array) -> Array:
        """Return the horizontal distance `(N,)` [m] of each grid point from `position` `(3,)` [m]."""
        return np.asarray(np.hypot(*(self._points - position)[:, :2].T))

    def _within(self, points: Array, margin: float) -> NDArray[np.bool_]:
        """Return a mask `(N,)` of the points in the workspace or at most `margin` [m] outside it."""
        places = points[:, :2]
        inside = (self._low - margin <= places) & (places <= self._high + margin)
        return np.asarray(inside.all(axis=1))
