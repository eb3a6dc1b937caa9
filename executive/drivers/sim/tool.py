"""Suction tool of the simulated cell: contact model of the cup, and seals as physics constraints."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import pybullet

from executive.cell.device_config import ToolConfig
from executive.drivers import world_log
from executive.drivers.sim.world import World
from executive.geometry import Array, Pose
from executive.physics.cell_world import POSITION_A

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


TOUCH_DISTANCE = 0.001
"""Maximum distance from a surface at which the soft lip detects the surface [m]."""
LIP_LENGTH = 0.002
"""Length of the lip at the end of the tool [m]. Contacts above the lip touch the shaft, and do not count."""
PULL_SMOOTHING = 0.25
"""Weight of the newest step in the low-pass filter of the pull on the seal. The time constant of 14 ms (3.5
steps) suppresses impact forces of the solver, which last a single step, and is short enough for a seal."""


@dataclass
class _Grip:
    """Grip of the tool on a body.

    Attributes:
        body: The held body.
        constraint: Constraint between tool and body.
        breakaway_force: Pull at which the seal breaks [N].
        pull: Filtered pull on the seal `(3,)` [N].
    """

    body: int
    constraint: int
    breakaway_force: float
    pull: Array = field(default_factory=lambda: np.zeros(3))


class SuctionTool:
    """The suction tool of a `World`; implements `Tool`. Call `advance` after each physics step.

    A held body keeps its pose relative to the tool until the filtered pull on the seal exceeds the breakaway
    force; moments do not break the seal. The object is still within reach immediately after a break. A
    new seal therefore forms only after the object has left the reach or the vacuum has been off.

    Args:
        world: The world with the tool.
        config: Section of the tool in the cell file.
        noise_seed: Random seed of the noise of `load`.

    Attributes:
        load_std: Standard deviation of the noise of `load` [N].
        dropped_bodies: Bodies whose last seal broke; ground truth, not for skills.
    """

    def __init__(self, world: World, config: ToolConfig, noise_seed: int = 0) -> None:
        self._world = world
        self._config = config
        self.load_std = config.load_std
        self._noise_seed = noise_seed
        self._is_vacuum_on = False
        self._grip: _Grip | None = None
        self._separating_body: int | None = None  # Body whose seal broke and that is still within reach.
        self._last_touch_check = (-1, False)
        """Number of physics steps at the last check of `touching`, and the result of the check."""
        self.dropped_bodies: set[int] = set()

    @property
    def touching(self) -> bool:
        """True if the lip was within `TOUCH_DISTANCE` of any body after the last physics step."""
        step, is_touching = self._last_touch_check
        if step != self._world.step_count:
            is_touching = any(True for _ in self._find_bodies_near(TOUCH_DISTANCE))
            self._last_touch_check = (self._world.step_count, is_touching)
        return is_touching

    @property
    def holding(self) -> bool:
        return self._grip is not None

    @property
    def holding_force(self) -> float:
        return 0.0 if self._grip is None else self._grip.breakaway_force

    @property
    def load(self) -> float:
        """Downward force of the held body on the tool [N]: its filtered pull on the seal, plus noise."""
        force = 0.0 if self._grip is None else -float(self._grip.pull[2])
        # The noise depends only on the physics step, so that a resumed run continues with the same noise.
        random_generator = np.random.default_rng([self._noise_seed, self._world.step_count])
        return force + float(random_generator.normal(0.0, self.load_std))

    @property
    def held_body(self) -> int | None:
        """The held body, or None; ground truth for tests and audit, not for skills."""
        return None if self._grip is None else self._grip.body

    @property
    def pull(self) -> float:
        """Filtered pull on the seal [N], 0 while the tool holds nothing; ground truth, not for skills."""
        return 0.0 if self._grip is None else math.hypot(*self._grip.pull)

    def close(self) -> None:
        self._world.log.append(world_log.VACUUM_ON)
        self._is_vacuum_on = True
        if self._grip is None:
            self._try_to_seal()

    def open(self) -> None:
        self._world.log.append(world_log.VACUUM_OFF)
        self._is_vacuum_on = False
        self._separating_body = None
        if self._grip is not None:
            body = self._grip.body
            self._world.rest_positions.setdefault(body, []).append(self._world.get_object_pose(body).position)
            self._release(self._grip)

    def break_seal(self) -> None:
        """Break the seal, so that the held body falls."""
        self._world.log.append(world_log.SEAL_BREAK)
        if self._grip is not None:
            self._separating_body = self._grip.body
            self.dropped_bodies.add(self._grip.body)
            self._release(self._grip)

    def advance(self) -> None:
        """Update the seal after a physics step."""
        if (grip := self._grip) is not None:
            force = np.array(self._world.client.getConstraintState(grip.constraint)[:3])
            grip.pull += PULL_SMOOTHING * (force - grip.pull)
            if self.pull > grip.breakaway_force:
                self.break_seal()
        elif self._is_vacuum_on:
            self._try_to_seal()

    def _try_to_seal(self) -> None:
        near_bodies = set(self._find_bodies_near(self._config.reach))
        if self._separating_body not in near_bodies:
            self._separating_body = None
        sealable_bodies = near_bodies & self._world.labels.keys() - {self._separating_body}
        if not sealable_bodies:
            return
        config = self._config
        X_WT = self._world.get_tool_pose()
        client = self._world.client
        contact = measure_contact(client, X_WT, sealable_bodies, config.cup_radius, config.reach)
        force = compute_breakaway_force(contact, config)
        if contact is not None and force >= config.min_force:
            self.dropped_bodies.discard(contact.body)
            self._grip = _Grip(contact.body, self._attach(contact.body), force)
            # Cup and body overlap slightly, and their contact forces would act against the constraint.
            self._set_collision(contact.body, False)

    def _attach(self, body: int) -> int:
        world = self._world
        # The constraint connects the centres of mass of tool (frame I) and body (frame B).
        tool_state = world.client.getLinkState(world.arm, world.tool_index, computeForwardKinematics=True)
        X_IB = Pose.of(*tool_state[:2]).inverse() @ Pose.of(*world.client.getBasePositionAndOrientation(body))
        return int(
            world.client.createConstraint(
                world.arm, world.tool_index, body, -1, pybullet.JOINT_FIXED, [0, 0, 0],
                X_IB.position, [0, 0, 0], X_IB.quaternion,
            )
        )  # fmt: skip

    def _release(self, grip: _Grip) -> None:
        self._world.client.removeConstraint(grip.constraint)
        self._set_collision(grip.body, True)
        self._grip = None

    def _set_collision(self, body: int, enabled: bool) -> None:
        world = self._world
        world.client.setCollisionFilterPair(world.arm, body, world.tool_index, -1, int(enabled))

    def _find_bodies_near(self, distance: float) -> Iterator[int]:
        """Yield every body except the arm within `distance` [m] of the lip.

        A comparison of bounding boxes (3 µs) comes first, because mostly no body is near the tool.
        """
        world = self._world
        low, high = world.client.getAABB(world.arm, world.tool_index)
        enlarged_box = [value - distance for value in low], [value + distance for value in high]
        overlaps = world.client.getOverlappingObjects(*enlarged_box) or ()
        bodies = sorted({body for body, _ in overlaps} - {world.arm})
        if not bodies:
            return
        X_TW = world.get_tool_pose().inverse()
        for body in bodies:
            points = world.client.getClosestPoints(world.arm, body, distance, linkIndexA=world.tool_index)
            if any(X_TW.apply(point[POSITION_A])[2] > -LIP_LENGTH for point in points):
                yield body
