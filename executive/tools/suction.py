"""Suction tool with one bellows cup: section, grasps, evidence of a touch, and contact model of the cup."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from executive.cell.arm import Goal
from executive.cell.device_config import Force, Length, MotionConfig
from executive.cell.objects import ObjectClass, Target
from executive.cell.tools import OVERTRAVEL, GraspAttempt, GraspPose, ToolMeasurement, ToolModel, ToolPart
from executive.geometry import Array, Pose

if TYPE_CHECKING:
    from executive.drivers.sim.tool import SimTool
    from executive.drivers.sim.world import World

SHAFT_RADIUS = 0.012
"""Radius of the body of the tool [m]."""
NECK_LENGTH = 0.015
"""Length of the thin end of the tool [m]; the thin end has the radius of the cup."""
PROBE_CLEARANCE = 0.005
"""Height above the table at which a probe (an approach almost down to the table) ends [m]."""
ATTEMPTS_BEFORE_PROBE = 3
"""Number of failed attempts after which each approach is a probe."""
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
"""Angle between two successive points of a Vogel spiral [rad]."""
UNEVEN_TOP_TOLERANCE = 0.003
"""Maximum difference between the height of a touch and the height of a class without a flat top [m], unless
`touch_tolerance` is greater: a duck that leans on a cube is 2 mm lower."""
OTHER_CLASS_TOLERANCE = 0.0025
"""Maximum difference between the height of a touch and the height of another class to which the object may
belong [m]."""


class Suction(ToolModel):
    """A suction tool with one bellows cup; `tests/benchmarks/suction_map.py` justifies the constants.

    The tool centre point is the centre of the lip. The lip detects a touch, and its height is evidence about
    the class of the object.
    """

    noun: ClassVar[str] = "seal"

    kind: Literal["suction"] = "suction"
    cup_radius: Length
    """Radius of the lip [m]."""
    reach: Length = 0.002
    """Maximum distance between lip and surface at which the lip seals [m]."""
    force: Force
    """Breakaway force of a perfect seal [N]."""
    gap: Length
    """Gap between lip and surface at which the breakaway force is zero [m]."""
    tilt_deg: float = Field(ge=1, lt=90)
    """Angle between surface normal and tool axis at which the breakaway force is zero [degree]."""
    min_force: Force
    """Minimum breakaway force at which the vacuum sensor reports a seal [N]."""
    stroke: Length = 0.0025
    """Distance by which a force of `force` compresses the bellows; more does not compress it further [m]."""
    touch_tolerance: Length = 0.003
    """Maximum difference between the height of a touch and the height of a class [m]."""

    @property
    def parts(self) -> tuple[ToolPart, ...]:
        """Shaft, and neck with the cup."""
        shaft = ToolPart(NECK_LENGTH, self.length - NECK_LENGTH, SHAFT_RADIUS)
        return shaft, ToolPart(0.0, NECK_LENGTH, self.cup_radius)

    @property
    def max_holding_force(self) -> float:
        """Breakaway force of a perfect seal [N]."""
        return self.force

    def measure_hold(self, client: Any, X_WT: Pose, body: int) -> float:
        """Return the breakaway force of the seal on a body; 0 if the sensor would report no seal."""
        contact = measure_contact(client, X_WT, [body], self.cup_radius, self.reach)
        force = compute_breakaway_force(contact, self)
        return force if force >= self.min_force else 0.0

    def list_grasps(
        self, object_class: ObjectClass, target: Target, motion: MotionConfig, attempt: GraspAttempt
    ) -> tuple[GraspPose]:
        """Return the grasp from above at the contact point of an attempt.

        After a failed attempt, the whole guarded part is slow, because the expected height may be wrong.
        After `ATTEMPTS_BEFORE_PROBE` failed attempts, the motion ends `PROBE_CLEARANCE` above the table,
        because the item may be a false detection.
        """
        x, y, z = map(float, target.pose_at(target.stamp).position)
        places = self.list_points(object_class, target)
        place = places[attempt.number % len(places)]
        # After n failed attempts, the contact point on a solid object lies on a Vogel spiral, at the distance
        # spacing * sqrt(n) and the angle n * GOLDEN_ANGLE; on an object with a hole, it lies on the ring.
        round_number = attempt.number // len(places)
        angle = round_number * GOLDEN_ANGLE
        ring = 0.0 if object_class.grasp_points else object_class.contact_radius
        distance = ring or attempt.spacing * math.sqrt(round_number)
        contact_x = float(place[0]) + distance * math.cos(angle)
        contact_y = float(place[1]) + distance * math.sin(angle)
        end_height = _compute_min_contact_height(object_class, z, attempt.overtravel)
        if attempt.number >= ATTEMPTS_BEFORE_PROBE:
            end_height = min(end_height, z - object_class.height / 2 + PROBE_CLEARANCE)
        guarded_length = float(place[2]) + motion.descent - end_height
        is_fast = attempt.is_confirmed and not attempt.number
        goal = Goal(
            (contact_x, contact_y, end_height),
            guarded_length=guarded_length,
            guarded_speed=motion.descent_speed,
            fast_length=max(0.0, motion.descent - motion.slow_descent) if is_fast else 0.0,
        )
        # The descent must end near the table, below the centre of the object, and within half of its radius.
        is_central = math.dist((contact_x, contact_y), (x, y)) <= object_class.radius / 2
        # A grasp point may be low, and at the other end of the object.
        is_probe = not object_class.grasp_points or attempt.number >= ATTEMPTS_BEFORE_PROBE
        proves_absence = is_central and is_probe and end_height < z and end_height <= 2 * PROBE_CLEARANCE
        contact_height = end_height + guarded_length - motion.descent
        return (GraspPose(goal, contact_height, proves_absence),)

    def measure_contact(
        self,
        object_class: ObjectClass,
        position: Array,
        height: float,
        classes: Mapping[str, ObjectClass],
        overtravel: float = OVERTRAVEL,
    ) -> ToolMeasurement:
        """Return the evidence of the height of a touch.

        A touch at a wrong height missed the top if it is below the centre of the object or more than
        `overtravel` below its top. It may have hit the object beside its top if it is too low for the assumed
        class, no class has this height, and the top is not flat.
        """
        tolerance = self._get_tolerance(object_class)
        if min(abs(height - each) for each in object_class.touch_heights) <= tolerance:
            return ToolMeasurement()
        size = f"is {object_class.height * 1000:.0f} mm high"
        if object_class.grasp_points:
            size = f"is held {object_class.hold_height * 1000:.0f} mm above its underside"
        contradiction = (
            f"it was touched {height * 1000:.0f} mm above the table, and a {object_class.label} {size}"
        )
        is_near_top = height >= _compute_min_contact_height(object_class, float(position[2]), overtravel)
        touch_heights = [touch_height for each in classes.values() for touch_height in each.touch_heights]
        fits_no_class = min(abs(height - each) for each in touch_heights) > OTHER_CLASS_TOLERANCE
        is_low = height < object_class.hold_height
        may_be_wrong = is_near_top and is_low and fits_no_class and not object_class.flat_top
        return ToolMeasurement(contradiction, may_be_wrong, is_miss=not is_near_top)

    def find_distinct_labels(self, classes: Mapping[str, ObjectClass]) -> frozenset[str]:
        """Return the classes with which a touch at the height of any other class does not agree."""
        heights = np.array([object_class.hold_height for object_class in classes.values()])
        tolerances = np.array([self._get_tolerance(object_class) for object_class in classes.values()])
        counts = (np.abs(heights[:, None] - heights) <= tolerances[:, None]).sum(axis=1)
        return frozenset(label for label, count in zip(classes, counts, strict=True) if count == 1)

    def _get_tolerance(self, object_class: ObjectClass) -> float:
        """Return the maximum difference between a touch that agrees with a class and its height [m]."""
        tolerance = self.touch_tolerance
        return tolerance if object_class.flat_top else max(tolerance, UNEVEN_TOP_TOLERANCE)

    def build_sim(self, world: World, noise_seed: int = 0) -> SimTool:
        """Return the simulated tool, whose cup seals on a surface without steps, edges and strong tilt."""
        # The module loads PyBullet in 0.3 s; a cell without physics needs no simulated tool.
        from executive.drivers.sim.tool import SimTool

        def find_grip(bodies: Collection[int]) -> tuple[int, float] | None:
            X_WT = world.get_tool_pose()
            contact = measure_contact(world.client, X_WT, bodies, self.cup_radius, self.reach)
            force = compute_breakaway_force(contact, self)
            return (contact.body, force) if contact is not None and force >= self.min_force else None

        # The vacuum of a perfect seal just contracts the bellows. F. Gabriel et al., Production Engineering
        # 14 (2020): the deformation of a bellows cup is elastic.
        return SimTool(
            world,
            self,
            find_grip,
            self.reach,
            noise_seed,
            stroke=self.stroke,
            stiffness=self.force / self.stroke,
        )


def _compute_min_contact_height(object_class: ObjectClass, centre_height: float, overtravel: float) -> float:
    """Return the minimum height of a contact with an object [m]; a lower contact misses the object.

    The guarded motion continues below the expected surface by `overtravel` [m], at most halfway to the
    underside.
    """
    middle = centre_height + (object_class.hold_height - object_class.height) / 2
    return max(middle + object_class.hold_height / 2 - overtravel, middle)


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


def compute_breakaway_force(contact: CupContact | None, tool: Suction) -> float:
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

    inner_ring = make_ring(cup_radius / 2, RIM_RAY_COUNT // 2)
    return np.vstack([np.zeros((1, 2)), inner_ring, make_ring(cup_radius, RIM_RAY_COUNT)])


def _cast_rays(
    client: Any, X_WT: Pose, bodies: Collection[int], face_points: Array, start: float, end: float
) -> tuple[Array, Array]:
    """Return the nearest of `bodies` on each ray `(N,)` and its distance from the face of the cup `(N,)` [m].

    A ray without a hit has body -1 and infinite distance. The rays are parallel to the tool axis; they start
    at the distance `start` behind the face and end at the distance `end` in front of the face [m].
    """
    count = len(face_points)
    hit_bodies = np.full(count, -1)
    distances = np.full(count, np.inf)
    starts = X_WT.apply(np.column_stack([face_points, np.full(count, -start)]))
    ends = X_WT.apply(np.column_stack([face_points, np.full(count, end)]))
    pending = np.arange(count)
    hit_number = 0
    while pending.size:
        # The first hits are on the tool. The next hits of the rays are read by number, because a new ray from
        # behind a surface would hit the surface again within a millimetre.
        hits = client.rayTestBatch(
            starts[pending].tolist(), ends[pending].tolist(), reportHitNumber=hit_number
        )
        for ray, (body, _, fraction, *_) in zip(pending, hits, strict=True):
            distance = fraction * (start + end) - start
            if body in bodies and distance < distances[ray]:
                hit_bodies[ray] = body
                distances[ray] = distance
        pending = pending[[hit[0] >= 0 for hit in hits]]
        hit_number += 1
    return hit_bodies, distances
