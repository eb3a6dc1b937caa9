"""Probability, by place on the table, that an object there has been overlooked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from executive.cell_config import TableConfig
from executive.geometry import Array
from executive.ledger.independence import repeat_probability, viewpoint_of
from executive.messages import Detections

PITCH = 0.02
"""Pitch of the grid of points on the table [m]; smaller than the smallest object."""
MARGIN = 0.4
"""Width of the watched area around the workspace [m]; dropped or pushed objects stay within it."""
PRIOR_OUTSIDE = 0.01
"""Prior probability of an object at a place outside the workspace before anything was dropped or pushed."""
PRIOR_OUTSIDE_AFTER_CHANGE = 0.1
"""Probability of an object at a place outside the workspace after one was dropped or pushed."""
MIN_PROBABILITY = 1e-4
"""Smallest probability after any number of looks, because looks are not wholly independent."""
RECENT_FULL_LOOKS = 4
"""Number of the latest full images; a place that none of them shows cannot be seen."""
BORDER = 12.0
"""Width of the image's border in which a point does not count as shown [pixel]."""
EDGE_MARGIN = 0.03
"""Distance outside the workspace up to which the centre of an object still counts as inside [m]."""
PRIOR_INSIDE = 0.1
"""Prior probability that an object lies at a given place of the workspace: three objects of 6 cm x 6 cm on
the 22 cm x 44 cm of the shipped cells."""
HEIGHT = 0.025
"""Height of the points over the table [m]: the centre of a usual object."""


class Coverage:
    """Probability, for every point of the table, that an object there has been overlooked.

    In the workspace, the probability is conditional on an object being there, and starts at 1. Outside, it
    includes the probability of an object, and starts low. A look multiplies the value of each searched point
    by the probability of another miss. A change that may have put an object there resets the value. Points
    that a look does not show keep it: points hidden by the arm, outside the image, or disturbed since.

    Args:
        table: Declares the workspace.
    """

    def __init__(self, table: TableConfig) -> None:
        (left, right), (low, high) = table.x, table.y
        xs = np.arange(left - MARGIN, right + MARGIN + PITCH / 2, PITCH)
        ys = np.arange(low - MARGIN, high + MARGIN + PITCH / 2, PITCH)
        self._points = np.array([(x, y, HEIGHT) for x in xs for y in ys])
        self._low, self._high = np.array([left, low]), np.array([right, high])
        self._workspace = self._within(self._points, 0.0)
        self._prior = np.where(self._within(self._points, EDGE_MARGIN), PRIOR_INSIDE, 1.0)
        self._overlooked = np.where(self._within(self._points, EDGE_MARGIN), 1.0, PRIOR_OUTSIDE)
        self._after_a_change = np.where(
            self._within(self._points, EDGE_MARGIN), 1.0, PRIOR_OUTSIDE_AFTER_CHANGE
        )
        self._changed = np.zeros(len(self._points), dtype=int)
        self._searched_from: dict[str, NDArray[np.bool_]] = {}
        self._full_looks = 0
        self._shown = np.full(len(self._points), -RECENT_FULL_LOOKS)

    def update(self, detections: Detections, unsure: Sequence[Array] = ()) -> None:
        """Update the probabilities after a look; places of found objects count as searched.

        Points near doubtful detections, `unsure` `(3,)` [m], do not count as searched.
        """
        searched = detections.searched(self._points)
        for place in unsure:
            searched &= np.hypot(*(self._points - place)[:, :2].T) > PITCH
        current = self._changed <= detections.frame.epoch
        now = searched & current
        # Another view is another image for the detector: of 31 objects that the detector of the cell
        # fasteners missed in the view `table`, it missed 4 in the view `full` of the same pose.
        viewpoint = f"{viewpoint_of(detections)} {detections.view}"
        misses, repeated = detections.error_rates.misses, detections.error_rates.repeated
        again = self._searched_from.setdefault(viewpoint, np.zeros(len(self._points), bool))
        self._overlooked[now] *= np.where(again[now], repeat_probability(misses, repeated), misses)
        self._overlooked = self._overlooked.clip(MIN_PROBABILITY)
        again |= now
        if detections.view == "full":
            self._full_looks += 1
            # Points at the border of the image may never be seen again; they are not required.
            self._shown[searched & detections.shows(self._points, BORDER)] = self._full_looks

    def disturb(self, centre: Array, radius: float, epoch: int) -> None:
        """Reset the points within `radius` [m] of `centre`: change `epoch` may have put an object there."""
        near = np.hypot(*(self._points - centre)[:, :2].T) <= radius
        self._overlooked[near], self._changed[near] = self._after_a_change[near], epoch
        for searched in self._searched_from.values():
            searched[near] = False

    def find_miss_probability(self, position: Array) -> float:
        """Return the probability that an object at `position` `(3,)` [m] has been overlooked."""
        distances = np.hypot(*(self._points - position)[:, :2].T)
        nearest = int(np.argmin(distances))
        return float(self._overlooked[nearest]) if distances[nearest] <= PITCH else PRIOR_OUTSIDE

    def in_workspace(self, position: Array) -> bool:
        """Return True if `position` `(3,)` [m] is at most `EDGE_MARGIN` outside the workspace."""
        return bool(self._within(position[None], EDGE_MARGIN)[0])

    @property
    def max_probability(self) -> float:
        """Maximum over the points of the probability that an overlooked object lies there.

        The points are those of the workspace and those shown in one of the last full images; others cannot
        be seen. The maximum is 1 before the first full image.
        """
        if not self._full_looks:
            return 1.0
        return float((self._prior * self._overlooked)[self._in_sight].max())

    def in_sight(self, position: Array) -> bool:
        """Return True if `position` `(3,)` [m] and all grid points around it can be seen.

        At the edge of the area hidden by the arm, a point may be visible while a place beside it never is.
        """
        around = np.hypot(*(self._points - position)[:, :2].T) <= PITCH
        return bool(around.any() and self._in_sight[around].all())

    @property
    def _in_sight(self) -> NDArray[np.bool_]:
        return self._workspace | (self._shown > self._full_looks - RECENT_FULL_LOOKS)

    def _within(self, points: Array, margin: float) -> NDArray[np.bool_]:
        """Return a mask `(N,)` of the points in the workspace or at most `margin` [m] outside it."""
        places = points[:, :2]
        inside = (self._low - margin <= places) & (places <= self._high + margin)
        return np.asarray(inside.all(axis=1))
