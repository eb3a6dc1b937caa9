"""Generic simulated tool: holds a body by a physics constraint; the kind of tool decides what it can grip."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field

import numpy as np
import pybullet

from executive.cell.tools import ToolModel
from executive.drivers import world_log
from executive.drivers.sim.world import World
from executive.geometry import Array, Pose
from executive.physics.cell_world import NORMAL, NORMAL_FORCE, POSITION_A

FindGrip = Callable[[Collection[int]], tuple[int, float] | None]
"""Function that returns the body among the bodies within reach that the tool can grip, and the force with
which the tool holds the body [N]; None if the tool can grip none of them."""
PULL_SMOOTHING = 0.25
"""Weight of the newest step in the low-pass filter of the pull on the grip. The time constant of 14 ms (3.5
steps) suppresses impact forces of the solver, which last a single step, and is short enough for a grip."""

YIELD_RATE = 0.1
"""Fraction of the remaining compression by which the end of a tool yields in a physics step; with larger
values, the force on a body between tool and table oscillates."""
MIN_SUPPORT_COSINE = 0.7
"""Minimum cosine between the vertical and the direction of a contact force that supports a body."""


@dataclass
class _Grip:
    """Grip of the tool on a body.

    Attributes:
        body: The held body.
        constraint: Constraint between tool and body.
        force: Pull at which the tool loses the body [N].
        pull: Filtered pull on the body `(3,)` [N].
        axis: Tool axis in the inertial frame of the body, towards the body `(3,)`.
        compression: Distance by which the end of the tool is compressed [m].
    """

    body: int
    constraint: int
    force: float
    axis: Array
    pull: Array = field(default_factory=lambda: np.zeros(3))
    compression: float = 0.0


class SimTool:
    """A tool of a `World`; implements `Tool`. Call `advance` after each physics step.

    A held body keeps its pose relative to the tool until the filtered pull on it exceeds the force of the
    grip; moments have no effect. A body that is pressed against the end of the tool compresses it like a
    spring, and does not leave it. A lost body is still within reach immediately after its loss. The tool
    therefore grips it again only after the body has left the reach or the tool has been open.

    Args:
        world: The world with the tool.
        model: Section of the tool in the cell file.
        find_grip: Finds the body that the tool can grip.
        reach: Maximum distance between the tip and a body that the tool grips [m].
        stroke: Maximum compression of the end of the tool [m].
        stiffness: Force that compresses the end of the tool [N/m].
        noise_seed: Random seed of the noise of `load`.

    Attributes:
        load_std: Standard deviation of the noise of `load` [N].
        holding: True while the tool holds a body.
        held_body: The held body, or None; ground truth for tests and audit, not for skills.
        is_idle: True while the tool is open and holds nothing; `advance` then has no effect.
        dropped_bodies: Bodies that the tool lost and has not gripped since; ground truth, not for skills.
    """

    def __init__(
        self, world: World, model: ToolModel, find_grip: FindGrip, reach: float, noise_seed: int = 0,
        stroke: float = 0.0, stiffness: float = math.inf,
    ) -> None:  # fmt: skip
        self._world = world
        self._model = model
        self._find_grip = find_grip
        self._reach = reach
        self._stroke = stroke
        self._stiffness = stiffness
        self.load_std = model.load_std
        self._noise_seed = noise_seed
        self.holding = False
        self.held_body: int | None = None
        self.is_idle = True
        self._grip: _Grip | None = None
        self._separating_body: int | None = None  # Lost body that is still within reach.
        self._last_touch_check = (-1, False)
        """Number of physics steps at the last check of `touching`, and the result of the check."""
        self.dropped_bodies: set[int] = set()

    @property
    def touching(self) -> bool:
        """True if the tip was within its touch distance of any body after the last physics step."""
        step, is_touching = self._last_touch_check
        if step != self._world.step_count:
            is_touching = any(True for _ in self._find_bodies_near(self._model.touch_distance))
            self._last_touch_check = (self._world.step_count, is_touching)
        return is_touching

    @property
    def holding_force(self) -> float:
        return 0.0 if self._grip is None else self._grip.force

    @property
    def load(self) -> float:
        """Downward force of the held body on the tool [N]: its filtered pull, plus noise."""
        force = 0.0 if self._grip is None else -float(self._grip.pull[2])
        # The noise depends only on the physics step, so that a resumed run continues with the same noise.
        random_generator = np.random.default_rng([self._noise_seed, self._world.step_count])
        return force + float(random_generator.normal(0.0, self.load_std))

    @property
    def pull(self) -> float:
        """Filtered pull on the held body [N], 0 if there is none; ground truth, not for skills."""
        return 0.0 if self._grip is None else math.hypot(*self._grip.pull)

    def close(self) -> None:
        self._world.log_command(world_log.CLOSE)
        self.is_idle = False
        if self._grip is None:
            self._try_to_grip()

    @property
    def opening(self) -> float:
        return 0.0

    def open(self, opening: float = 0.0) -> None:  # noqa: ARG002
        self._world.log_command(world_log.OPEN)
        self._separating_body = None
        if self._grip is not None:
            body = self._grip.body
            self._world.rest_positions.setdefault(body, []).append(self._world.get_object_pose(body).position)
            self._release(self._grip)
        self.is_idle = True

    def lose_grip(self) -> None:
        """Let the held body fall, as after too strong a pull."""
        self._world.log_command(world_log.GRIP_LOST)
        if self._grip is not None:
            self._separating_body = self._grip.body
            self.dropped_bodies.add(self._grip.body)
            self._release(self._grip)

    def advance(self) -> None:
        """Update the grip after a physics step."""
        if (grip := self._grip) is not None:
            force = np.array(self._world.client.getConstraintState(grip.constraint)[:3])
            force = self._compress(grip, force)
            # While the body lies on a support, the rigid constraint shows the tracking error of the arm,
            # which the compliance of a real tool absorbs.
            contacts = self._world.client.getContactPoints(bodyA=grip.body) or ()
            if any(p[NORMAL][2] > MIN_SUPPORT_COSINE and p[NORMAL_FORCE] > 0 for p in contacts):
                force = np.zeros(3)
            grip.pull += PULL_SMOOTHING * (force - grip.pull)
            if self.pull > grip.force:
                self.lose_grip()
        elif not self.is_idle:
            self._try_to_grip()

    def _compress(self, grip: _Grip, force: Array) -> Array:
        """Let the end of the tool yield to a force `(3,)` [N]; return its part that does not compress it."""
        axis = self._get_rotation(grip.body) @ grip.axis
        pressure = max(-float(force @ axis), 0.0)
        target = min(pressure / self._stiffness, self._stroke)
        if grip.compression or target:
            grip.compression += YIELD_RATE * (target - grip.compression)
            pivot = (grip.compression * grip.axis).tolist()
            self._world.client.changeConstraint(grip.constraint, jointChildPivot=pivot)
        return np.asarray(force + pressure * axis)

    def _get_rotation(self, body: int) -> Array:
        """Return the rotation of the inertial frame of a body `(3, 3)`."""
        return Pose.of(*self._world.client.getBasePositionAndOrientation(body)).rotation

    def _try_to_grip(self) -> None:
        near_bodies = set(self._find_bodies_near(self._reach))
        if self._separating_body not in near_bodies:
            self._separating_body = None
        loose_bodies = near_bodies & self._world.labels.keys() - {self._separating_body}
        found = self._find_grip(loose_bodies) if loose_bodies else None
        if found is not None:
            body, force = found
            self.dropped_bodies.discard(body)
            axis = self._get_rotation(body).T @ self._world.get_tool_pose().rotation[:, 2]
            self._grip = _Grip(body, self._attach(body), force, axis)
            self.held_body = body
            self.holding = True
            # Tip and body overlap slightly, and their contact forces would act against the constraint.
            self._set_collision(body, False)

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
        self.held_body = None
        self.holding = False

    def _set_collision(self, body: int, enabled: bool) -> None:
        world = self._world
        world.client.setCollisionFilterPair(world.arm, body, world.tool_index, -1, int(enabled))

    def _find_bodies_near(self, distance: float) -> Iterator[int]:
        """Yield every body except the arm within `distance` [m] of the tip.

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
            if any(X_TW.apply(point[POSITION_A])[2] > -self._model.tip_length for point in points):
                yield body
