"""How well a suction cup would seal on what lies under it, and the force that seal bears."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from executive.cell.config import ToolConfig
from executive.geometry import Array, Pose

RIM_RAY_COUNT = 16
"""Rays around the lip; half as many on a ring at half its radius, one at the centre."""


@dataclass(frozen=True)
class CupContact:
    """How a cup meets the surface under it.

    Attributes:
        body: The simulator's id of the nearest body under the cup.
        distance: From the cup's face to the nearest point of that body, along the tool axis [m].
        gap: Largest distance left between rim and surface once the cup has come down to the first
            contact and its bellows has leant with the surface [m]; infinite where part of the cup is
            not over the body.
        tilt: Angle between the tool axis and the normal of the plane fitted to the surface under the
            cup [rad]: how far the bellows had to lean.
    """

    body: int
    distance: float
    gap: float
    tilt: float


def measure_contact(
    client: Any, X_WT: Pose, bodies: Collection[int], cup_radius: float, reach: float
) -> CupContact | None:
    """Return how a cup at `X_WT` would seal on the nearest of `bodies`, or None over none of them.

    Rays run along the tool axis against the collision shapes, through every other body. They start
    `reach` behind the lip, because a cup in contact is a little inside of what it touches, and end
    `reach` and a cup's width before it: steeper than that no lip can lie.

    Args:
        client: The pybullet client that holds the bodies.
        X_WT: Pose of the lip's centre, z along the tool axis into the object.
        bodies: Ids of the bodies that can be sealed on.
        cup_radius: Radius of the lip [m].
        reach: Largest distance at which a lip still closes on a surface [m].
    """
    face = _face(cup_radius)
    hits, heights = _cast(client, X_WT, bodies, face, reach, reach + 2 * cup_radius)
    nearest = int(np.argmin(heights))
    if not math.isfinite(heights[nearest]):
        return None
    body = int(hits[nearest])
    met = hits == body
    points = np.column_stack([face[met], np.ones(np.count_nonzero(met))])
    (slope_x, slope_y, level), *_ = np.linalg.lstsq(points, heights[met], rcond=None)
    tilt = math.atan(math.hypot(slope_x, slope_y))
    gap = math.inf
    if met.all():
        residual = (heights - points @ (slope_x, slope_y, level)) * math.cos(tilt)
        gap = float(residual[-RIM_RAY_COUNT:].max() - residual.min())
    return CupContact(body, float(heights[nearest]), gap, tilt)


def breakaway_force(seal: CupContact | None, tool: ToolConfig) -> float:
    """Return the pull at which the seal lets go [N]; 0 where none forms.

    `force * (1 - gap / gap_max) * (1 - tilt / tilt_max)`, clipped at zero. The full force is vacuum
    times lip area. A gap is bridged by the lip's compliance, whose contact pressure falls, and whose
    leak grows, in proportion to how far it must bend: at `gap_max` nothing presses it on. A tilt
    is taken up by bending the bellows, which loads one side of the lip and peels the other. Both are
    first-order terms of independent causes, hence linear and multiplied; cup makers publish only the
    two ends (full force on a flat face, largest bend). Inside a seal the force is continuous, so
    a slightly worse grasp is slightly weaker and nothing hinges on a threshold in geometry.
    """
    if seal is None or seal.distance > tool.reach:
        return 0.0
    bent = max(0.0, 1.0 - seal.gap / tool.gap)
    leaning = max(0.0, 1.0 - seal.tilt / math.radians(tool.tilt_deg))
    return tool.force * bent * leaning


@lru_cache(maxsize=16)
def _face(cup_radius: float) -> Array:
    """Return where the rays pass the cup's face `(N, 2)` [m]: the centre, a ring, then the rim."""

    def ring(radius: float, count: int) -> Array:
        angle = 2 * np.pi * np.arange(count) / count
        return radius * np.column_stack([np.cos(angle), np.sin(angle)])

    return np.vstack(
        [np.zeros((1, 2)), ring(cup_radius / 2, RIM_RAY_COUNT // 2), ring(cup_radius, RIM_RAY_COUNT)]
    )


def _cast(
    client: Any, X_WT: Pose, bodies: Collection[int], face: Array, behind: float, before: float
) -> tuple[Array, Array]:
    """Return the body `(N,)` (-1 for none) that each ray meets first and its height `(N,)` [m] over it."""
    count = len(face)
    hits, heights = np.full(count, -1), np.full(count, np.inf)
    starts = X_WT.apply(np.column_stack([face, np.full(count, -behind)]))
    ends = X_WT.apply(np.column_stack([face, np.full(count, before)]))
    pending = np.arange(count)
    layer = 0
    while pending.size:
        # The rays start inside the tool, which they meet first. Starting them anew behind what does not
        # count would not do: Bullet's rays end at once on a surface less than a millimetre ahead.
        answers = client.rayTestBatch(starts[pending].tolist(), ends[pending].tolist(), reportHitNumber=layer)
        for ray, (body, _, fraction, *_) in zip(pending, answers, strict=True):
            height = fraction * (behind + before) - behind
            if body in bodies and height < heights[ray]:
                hits[ray], heights[ray] = body, height
        pending = pending[[answer[0] >= 0 for answer in answers]]
        layer += 1
    return hits, heights
