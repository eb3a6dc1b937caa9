"""Contact model of the suction cup: geometry of a contact, and breakaway force of the seal."""

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
"""Number of rays on the rim of the cup; the ring at half the radius has half of this number of rays."""


@dataclass(frozen=True)
class CupContact:
    """Geometry of the contact between the cup and the surface under it.

    Attributes:
        body: Nearest body under the cup.
        distance: Distance from the face of the cup to the nearest point of the body, along the tool axis [m].
        gap: Maximum distance between rim and surface [m] after the cup has touched and the bellows has
            tilted; infinite if a part of the cup is not over the body.
        tilt: Tilt of the bellows [rad]: the angle between the tool axis and the normal of the plane that is
            fitted to the surface under the cup.
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
    start at the distance `reach` behind the lip, because a cup in contact penetrates the surface a little.
    They end `reach` plus the diameter of the cup in front of the lip, enough for slopes up to 45°.

    Args:
        client: The pybullet client of the bodies.
        X_WT: Pose of the centre of the lip; its z axis is the tool axis and points into the object.
        bodies: Bodies to which the cup can seal.
        cup_radius: Radius of the lip [m].
        reach: Maximum distance from a surface at which the lip seals [m].
    """
    face_points = _sample_face(cup_radius)
    hit_bodies, distances = _cast_rays(client, X_WT, bodies, face_points, reach, reach + 2 * cup_radius)
    nearest_ray = int(np.argmin(distances))
    if not math.isfinite(distances[nearest_ray]):
        return None
    body = int(hit_bodies[nearest_ray])
    is_hit = hit_bodies == body
    # Least-squares fit of the plane z = slope_x x + slope_y y + offset, in the axes of the tool.
    points = np.column_stack([face_points[is_hit], np.ones(np.count_nonzero(is_hit))])
    (slope_x, slope_y, offset), *_ = np.linalg.lstsq(points, distances[is_hit], rcond=None)
    tilt = math.atan(math.hypot(slope_x, slope_y))
    gap = math.inf
    if is_hit.all():
        residuals = (distances - points @ (slope_x, slope_y, offset)) * math.cos(tilt)
        gap = float(residuals[-RIM_RAY_COUNT:].max() - residuals.min())
    return CupContact(body, float(distances[nearest_ray]), gap, tilt)


def compute_breakaway_force(contact: CupContact | None, tool: ToolConfig) -> float:
    """Return the pull at which the seal of a contact breaks [N]; 0 if no seal forms.

    The force is `force * (1 - gap / gap_max) * (1 - tilt / tilt_max)`, clipped at zero, where `force` is
    vacuum times lip area. The compliant lip bridges a gap; the contact pressure of the lip falls with the
    deflection and is zero at `gap_max`. The bellows compensates a tilt, which loads one side of the lip and
    peels the other side. Gap and tilt are independent causes, so the factors are multiplied. The factors are
    linear, because manufacturers publish only the full force and the maximum tilt.
    """
    if contact is None or contact.distance > tool.reach:
        return 0.0
    gap_factor = max(0.0, 1.0 - contact.gap / tool.gap)
    tilt_factor = max(0.0, 1.0 - contact.tilt / math.radians(tool.tilt_deg))
    return tool.force * gap_factor * tilt_factor


@lru_cache(maxsize=16)
def _sample_face(cup_radius: float) -> Array:
    """Return the points of the rays on the face of the cup `(N, 2)` [m]: centre, inner ring, and rim."""

    def make_ring(radius: float, count: int) -> Array:
        angles = 2 * np.pi * np.arange(count) / count
        return radius * np.column_stack([np.cos(angles), np.sin(angles)])

    inner_ring, rim = make_ring(cup_radius / 2, RIM_RAY_COUNT // 2), make_ring(cup_radius, RIM_RAY_COUNT)
    return np.vstack([np.zeros((1, 2)), inner_ring, rim])


def _cast_rays(
    client: Any, X_WT: Pose, bodies: Collection[int], face_points: Array, start: float, end: float
) -> tuple[Array, Array]:
    """Return the nearest of `bodies` on each ray `(N,)` and its distance from the face of the cup `(N,)` [m].

    A ray without a hit has body -1 and infinite distance. The rays are parallel to the tool axis; they start
    at the distance `start` behind the face and end at the distance `end` in front of the face [m].
    """
    count = len(face_points)
    hit_bodies, distances = np.full(count, -1), np.full(count, np.inf)
    starts = X_WT.apply(np.column_stack([face_points, np.full(count, -start)]))
    ends = X_WT.apply(np.column_stack([face_points, np.full(count, end)]))
    pending = np.arange(count)
    hit_number = 0
    while pending.size:
        # The first hits are on the tool. The next hits of the rays are read by number, because a new ray from
        # behind a surface would hit the surface again within a millimetre.
        segments = starts[pending].tolist(), ends[pending].tolist()
        hits = client.rayTestBatch(*segments, reportHitNumber=hit_number)
        for ray, (body, _, fraction, *_) in zip(pending, hits, strict=True):
            distance = fraction * (start + end) - start
            if body in bodies and distance < distances[ray]:
                hit_bodies[ray], distances[ray] = body, distance
        pending = pending[[hit[0] >= 0 for hit in hits]]
        hit_number += 1
    return hit_bodies, distances
