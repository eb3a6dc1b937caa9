"""Vias that lie above one another belong together: the tool goes straight up or down between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell import Via
from executive.geometry import Pose, tool_down

SIDEWAYS = 0.001
"""Largest horizontal distance of vias that count as being above one another [m]."""
UPRIGHT = 0.9998
"""Least cosine between the tool's axis and straight down at which it counts as pointing down."""


@dataclass(frozen=True, eq=False)
class Stroke:
    """A run of vias above one another, passed with one arm posture and one yaw.

    Attributes:
        poses: Tool poses `X_WT` of the vias, at yaw 0.
        yaw: The yaw they share [rad], or None where it is free.
        continues: True if the tool already points down above the same point when it begins.
    """

    poses: tuple[Pose, ...]
    yaw: float | None
    continues: bool


def strokes(vias: Sequence[Via], X_WT: Pose | None = None) -> list[Stroke]:
    """Return the vias as strokes; `X_WT` is where the tool is before the first.

    A via with a yaw of its own begins a new stroke if that differs from the stroke's.
    """
    groups: list[list[Via]] = []
    for via in vias:
        if groups and _continues(groups[-1], via):
            groups[-1].append(via)
        else:
            groups.append([via])
    result = []
    for number, group in enumerate(groups):
        here = (
            number == 0
            and X_WT is not None
            and -X_WT.rotation[2, 2] > UPRIGHT
            and _above(X_WT.position, group[0].position)
        )
        result.append(Stroke(tuple(tool_down(via.position) for via in group), _yaw(group), here))
    return result


def _continues(group: Sequence[Via], via: Via) -> bool:
    same_yaw = via.yaw is None or _yaw(group) in (None, via.yaw)
    return same_yaw and _above(group[0].position, via.position)


def _yaw(group: Sequence[Via]) -> float | None:
    return next((via.yaw for via in group if via.yaw is not None), None)


def _above(one: np.ndarray, other: np.ndarray) -> bool:
    return bool(np.linalg.norm(one[:2] - other[:2]) < SIDEWAYS)
