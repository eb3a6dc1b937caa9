"""Contact model of the suction cup: geometry of the contact, and breakaway force of the seal."""

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
"""Number of rays at the rim; half as many are on a ring at half the radius, and one at the centre."""


@dataclass(frozen=True)
class CupContact:
    """Geometry of the contact between the cup and the surface under it.

    Attributes:
        body: The simulator's id of the nearest body under the cup.
        distance: Distance from the face of the cup to the nearest point of the body, along the tool axis [m].
        gap: Largest distance between rim and surface after the cup has reached the first contact and its
            bellows has tilted with the surface [m]; infinite if part of the cup is not over the body.
        tilt: Angle between the tool axis and the normal of the plane fitted to the surface under the
            cup [rad]; the bellows tilts by this angle.
    """

    body: int
    distance: float
    gap: float
    tilt: float


def measure_contact(
    client: Any, X_WT: Pose, bodies: Collection[int], cup_radius: float, reach: float
) -> CupContact | None:
    """Return the contact of a cup at `X_WT` with the nearest of `bodies`, or None if none is under the cup.

    Rays along the tool axis hit the collision shapes of `bodies` and pass through all other bodies. They
    start `reach` behind the lip, because a cup in contact penetrates the surface a little, and end `reach`
    plus the diameter of the cup in front of the lip, because no lip can lie on a steeper surface.

    Args:
        client: The pybullet client that holds the bodies.
        X_WT: Pose of the centre of the lip, z along the tool axis into the object.
        bodies: Ids of the bodies to which the cup can seal.
        cup_radius: Radius of the lip [m].
        reach: Largest distance from a surface at which the lip still seals [m].
    """
    face = _sample_face(cup_radius)
    hits, heights = _cast_rays(client, X_WT, bodies, face, reach, reach + 2 * cup_radius)
    nearest = int(np.argmin(heights))
    if not math.isfinite(heights[nearest]):
        return None
    body = int(hits[nearest])
    is_hit = hits == body
    points = np.column_stack([face[is_hit], np.ones(np.count_nonzero(is_hit))])
    (slope_x, slope_y, level), *_ = np.linalg.lstsq(points, heights[is_hit], rcond=None)
    tilt = math.atan(math.hypot(slope_x, slope_y))
    gap = math.inf
    if is_hit.all():
        residual = (heights - points @ (slope_x, slope_y, level)) * math.cos(tilt)
        gap = float(residual[-RIM_RAY_COUNT:].max() - residual.min())
    return CupContact(body, float(heights[nearest]), gap, tilt)


def breakaway_force(seal: CupContact | None, tool: ToolConfig) -> float:
    """Return the pull at which the seal breaks [N]; 0 if none forms.

    `force * (1 - gap / gap_max) * (1 - tilt / tilt_max)`, clipped at zero. The full force is vacuum
    times lip area. The compliant lip bridges a gap; its contact pressure falls and its leak grows in
    proportion to its deflection, and at `gap_max` the pressure is zero. The bellows bends to compensate a
    tilt, which loads one side of the lip and peels the other. Both are first-order terms of independent
    causes, hence linear and multiplied; manufacturers publish only the two ends (full force on a flat
    surface, largest bend). The force is continuous: a slightly worse grasp is slightly weaker.
    """
    if seal is None or seal.distance > tool.reach:
        return 0.0
    gap_factor = max(0.0, 1.0 - seal.gap / tool.gap)
    tilt_factor = max(0.0, 1.0 - seal.tilt / math.radians(tool.tilt_deg))
    return tool.force * gap_factor * tilt_factor


@lru_cache(maxsize=16)
def _sample_face(cup_radius: float) -> Array:
    """Return the points of the rays on the face of the cup `(N, 2)` [m]: centre, inner ring, rim."""

    def ring(radius: float, count: int) -> Array:
        angle = 2 * np.pi * np.arange(count) / count
        return radius * np.column_stack([np.cos(angle), np.sin(angle)])

    return np.vstack(
        [np.zeros((1, 2)), ring(cup_radius / 2, RIM_RAY_COUNT // 2), ring(cup_radius, RIM_RAY_COUNT)]
    )


def _cast_rays(
    client: Any, X_WT: Pose, bodies: Collection[int], face: Array, behind: float, before: float
) -> tuple[Array, Array]:
    """Return the nearest of `bodies` on each ray `(N,)`, or -1, and its distance from the face `(N,)` [m]."""
    count = len(face)
    hits, heights = np.full(count, -1), np.full(count, np.inf)
    starts = X_WT.apply(np.column_stack([face, np.full(count, -behind)]))
    ends = X_WT.apply(np.column_stack([face, np.full(count, before)]))
    pending = np.arange(count)
    layer = 0
    while pending.size:
        # The rays start inside the tool and hit it first. Rays that start behind an ignored surface would
        # not help: Bullet's rays end at once on a surface less than a millimetre ahead.
        answers = client.rayTestBatch(starts[pending].tolist(), ends[pending].tolist(), reportHitNumber=layer)
        for ray, (body, _, fraction, *_) in zip(pending, answers, strict=True):
            height = fraction * (behind + before) - behind
            if body in bodies and height < heights[ray]:
                hits[ray], heights[ray] = body, height
        pending = pending[[answer[0] >= 0 for answer in answers]]
        layer += 1
    return hits, heights
