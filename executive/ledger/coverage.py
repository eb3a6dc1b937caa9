"""Where on the table an object may still be overlooked, and how likely that is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from executive.cell_config import TableConfig
from executive.geometry import Array
from executive.ledger.independence import repeat, viewpoint_of
from executive.messages import Detections

PITCH = 0.02
"""Distance between the points that stand for the table [m]: less than the smallest object is wide."""
MARGIN = 0.4
"""How far around the workspace is watched [m]: as far as what is dropped or pushed gets."""
ASTRAY = 0.02
"""Chance that something lies beside the workspace before the robot has dropped or pushed anything."""
STRAYED = 0.1
"""Chance that something lies at a place beside the workspace after the robot has."""
LEAST = 1e-4
"""Chance that remains however often a place is searched: looks are not wholly independent of each other."""
RECENT = 4
"""Full images, from as many poses as a camera has, of which one must show a place that can be seen."""
BORDER = 12.0
"""Width of the image's border in which a point does not count as shown [pixel]."""
NEAR = 0.03
"""How far beside the workspace the middle of what lies at its edge may be [m]."""
OCCUPIED = 0.1
"""Prior probability that an object lies at a given place of the workspace: three objects of 6 cm x 6 cm on
the 22 cm x 44 cm of the shipped cells."""
HEIGHT = 0.025
"""Height of the points over the table [m]: the middle of a usual object."""


class Coverage:
    """The chance, at every point of the table, that an object lies there which no look has shown.

    It starts at one in the workspace, where it is the chance for an object that is there, and low beside it,
    where it includes the chance that there is an object. A look that searches a point multiplies it by the
    share of objects that its detector misses; whatever may have brought an object there sets it back to
    one. What a look does not show, because the arm hides it, it lies outside the image or has been
    disturbed since, stays as it was.

    Args:
        table: Says where objects lie.
    """

    def __init__(self, table: TableConfig) -> None:
        (left, right), (low, high) = table.x, table.y
        xs = np.arange(left - MARGIN, right + MARGIN + PITCH / 2, PITCH)
        ys = np.arange(low - MARGIN, high + MARGIN + PITCH / 2, PITCH)
        self._points = np.array([(x, y, HEIGHT) for x in xs for y in ys])
        self._low, self._high = np.array([left, low]), np.array([right, high])
        self._workspace = self._within(self._points, 0.0)
        self._prior = np.where(self._within(self._points, NEAR), OCCUPIED, 1.0)
        self._overlooked = np.where(self._within(self._points, NEAR), 1.0, ASTRAY)
        self._after_a_change = np.where(self._within(self._points, NEAR), 1.0, STRAYED)
        self._changed = np.zeros(len(self._points), dtype=int)
        self._searched_from: dict[str, NDArray[np.bool_]] = {}
        self._full_looks = 0
        self._shown = np.full(len(self._points), -RECENT)

    def look(self, detections: Detections, unsure: Sequence[Array] = ()) -> None:
        """Take account of a look: what it did find is known, and no longer overlooked, either.

        Where its detector is `unsure` `(3,)` [m] whether something is there, nothing was searched.
        """
        searched = detections.searched(self._points)
        for place in unsure:
            searched &= np.hypot(*(self._points - place)[:, :2].T) > PITCH
        current = self._changed <= detections.frame.epoch
        now = searched & current
        # Another view is another image for the detector: of 31 objects that the detector of the cell
        # fasteners missed in the view `table`, it missed 4 in the view `full` of the same pose.
        viewpoint = f"{viewpoint_of(detections)} {detections.view}"
        misses, repeated = detections.reliability.misses, detections.reliability.repeated
        again = self._searched_from.setdefault(viewpoint, np.zeros(len(self._points), bool))
        self._overlooked[now] *= np.where(again[now], repeat(misses, repeated), misses)
        self._overlooked = self._overlooked.clip(LEAST)
        again |= now
        if detections.view == "full":
            self._full_looks += 1
            # What only just shows may not show again: nothing would ever be said about it.
            self._shown[searched & detections.shows(self._points, BORDER)] = self._full_looks

    def disturb(self, centre: Array, radius: float, epoch: int) -> None:
        """Take account of change `epoch`, which may have put an object within `radius` [m] of `centre`."""
        near = np.hypot(*(self._points - centre)[:, :2].T) <= radius
        self._overlooked[near], self._changed[near] = self._after_a_change[near], epoch
        for searched in self._searched_from.values():
            searched[near] = False

    def overlooked(self, position: Array) -> float:
        """Return the chance, 0 to 1, that an object at a place `(3,)` [m] has not been seen yet."""
        distances = np.hypot(*(self._points - position)[:, :2].T)
        nearest = int(np.argmin(distances))
        return float(self._overlooked[nearest]) if distances[nearest] <= PITCH else ASTRAY

    def in_workspace(self, position: Array) -> bool:
        """Tell whether a place `(3,)` [m] is where objects are put to be sorted."""
        return bool(self._within(position[None], NEAR)[0])

    @property
    def worst(self) -> float:
        """The largest chance, 0 to 1, that an object lies anywhere and has been overlooked.

        Counted are the workspace and what else one of the last full images has shown: a place that none of
        them does, though they were taken from several poses, cannot be seen. It is 1 before there was one.
        """
        if not self._full_looks:
            return 1.0
        return float((self._prior * self._overlooked)[self._in_sight].max())

    def in_sight(self, position: Array) -> bool:
        """Tell whether a place `(3,)` [m] is one that `worst` counts, like all the points around it.

        At the edge of what the arm hides, a point may be shown and a place beside it never be.
        """
        around = np.hypot(*(self._points - position)[:, :2].T) <= PITCH
        return bool(around.any() and self._in_sight[around].all())

    @property
    def _in_sight(self) -> NDArray[np.bool_]:
        return self._workspace | (self._shown > self._full_looks - RECENT)

    def _within(self, points: Array, margin: float) -> NDArray[np.bool_]:
        """Tell `(N,)` which points lie in the workspace or at most `margin` [m] beside it."""
        places = points[:, :2]
        inside = (self._low - margin <= places) & (places <= self._high + margin)
        return np.asarray(inside.all(axis=1))
