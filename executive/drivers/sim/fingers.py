"""Simulated fingers: two coupled joints that hold a body by friction, without a constraint to the body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
import pybullet

from executive.cell.device_config import STEP
from executive.drivers import world_log
from executive.drivers.sim.world import World
from executive.geometry import GRAVITY
from executive.physics.cell_world import BODY_B, NORMAL_FORCE

SPINNING_FRICTION = 0.1
"""Coefficient of friction of a pad about its normal; without it, a held duck turns by up to 51 degrees."""
COUPLING_GAIN = 0.2
"""Fraction of the error of a coupled joint that its motor corrects in a physics step."""
COUPLING_EFFORT = 100.0
"""Maximum effort of the motor of a coupled joint [N or Nm]; a gear of a real gripper is as stiff."""
MIN_MASS = 0.05
"""Minimum mass of a link that a joint moves [kg]."""
MIN_INERTIA = 1e-3
"""Minimum moment of inertia of a link that a joint moves [kg m²], for the motor behind the gear. With the
inner fingers of a Robotiq 2F-85 (10 g), the solver does not converge, and the pads turn under load."""
SENSOR_TIME = 0.04
"""Time in which the fingers must press on an object before the sensor reports it [s], and must have closed
before the sensor reports a loss."""
MIN_WIDTH = 0.002
"""Minimum distance of the fingers at a grip beyond that of the closed fingers [m]."""
MAX_CLOSING = 0.005
"""Maximum distance by which fingers close without pressing on an object that shifts between them [m]; if they
close further, they have lost it."""
MIN_EFFORT_FRACTION = 0.5
"""Minimum effort of the motor at a grip, as a fraction of the declared effort."""
MIN_TOUCH_FORCE = 2.0
"""Minimum force of a detected contact [N], as of the sensors in the joints of the arm."""
STALLED_STEP_COUNT = 10
"""Number of physics steps without motion after which a weak motor tries to move with `PRESSING_SPEED`."""
MAX_WEAK_FRACTION = 0.9
"""Maximum effort of a weak motor, as a fraction of the declared effort."""
PRESSING_SPEED = 0.5
"""Speed of a finger with a weak motor that an object has stopped [m/s]. The solver reaches the effort of a
stopped motor only if the motor is fast enough: with 0.02 m/s, it reached 6 N of 20 N."""
LOAD_SMOOTHING = 0.1
"""Weight of the newest step in the low-pass filter of the load; the time constant is 40 ms."""


class FingerTool(Protocol):
    """Properties of a tool with fingers, as in `executive.tools.fingers.Fingers`."""

    @property
    def force(self) -> float: ...

    @property
    def speed(self) -> float: ...

    @property
    def friction(self) -> float: ...

    @property
    def release_allowance(self) -> float: ...

    @property
    def load_std(self) -> float: ...

    @property
    def effort(self) -> float: ...

    @property
    def couplings(self) -> Mapping[str, float]: ...

    @property
    def opening_table(self) -> Sequence[tuple[float, float]]: ...


class SimFingers:
    """Two fingers of a `World`; implements `Tool`. Call `advance` after each physics step.

    Args:
        world: The world with the tool.
        model: Section of the tool in the cell file: opening, force, speed.
        noise_seed: Random seed of the noise of `load`.

    Attributes:
        load_std: Standard deviation of the noise of `load` [N].
        holding: True while the sensor reports an object: the fingers press, and are not closed.
        held_body: The body between the fingers while `holding`, or None; ground truth, not for skills.
        is_idle: False: the sensor of the fingers needs every physics step.
        dropped_bodies: Bodies that the fingers lost and have not held since; ground truth, not for skills.
    """

    is_idle = False

    def __init__(self, world: World, model: FingerTool, noise_seed: int = 0) -> None:
        self._world = world
        self._model = model
        self.load_std = model.load_std
        self._noise_seed = noise_seed
        self.holding = False
        self.held_body: int | None = None
        self.dropped_bodies: set[int] = set()
        self._joints = [world.tool_joints[name] for name in model.couplings]
        self._factors = [*model.couplings.values()][1:]
        table = np.array(sorted(model.opening_table))
        self._positions = table[:, 0]
        self._openings = table[:, 1]
        self._links = world.tool_links
        self._is_closing = False
        self._pressing_time = 0.0
        self._grip_opening = 0.0
        """Distance between the fingers when they pressed last [m]."""
        self._stalled_step_count = 0
        self._load = 0.0
        self._separated_body: int | None = None
        client = world.client
        for link in self._links:
            client.changeDynamics(
                world.arm, link, lateralFriction=model.friction, spinningFriction=SPINNING_FRICTION,
                frictionAnchor=1,
            )  # fmt: skip
        for joint in self._joints:
            mass, _, inertia, *_ = client.getDynamicsInfo(world.arm, joint)
            diagonal = np.maximum(inertia, MIN_INERTIA).tolist()
            client.changeDynamics(world.arm, joint, mass=max(mass, MIN_MASS), localInertiaDiagonal=diagonal)
        client.enableJointForceTorqueSensor(world.arm, world.tool_index, True)
        masses = [client.getDynamicsInfo(world.arm, link)[0] for link in self._links]
        self._weight = sum(masses) * GRAVITY
        self._closed_opening = float(self._openings.min())
        self._min_speed = self._convert_speed(model.speed) / 2
        """Minimum speed of the first joint in a motion [m/s or rad/s]."""
        self._command(float(self._openings.max()), model.speed)

    @property
    def opening(self) -> float:
        """Measured distance between the fingers [m]."""
        position = self._world.client.getJointState(self._world.arm, self._joints[0])[0]
        return float(np.interp(position, self._positions, self._openings))

    @property
    def touching(self) -> bool:
        """True if palm or fingers press on a body with at least `MIN_TOUCH_FORCE`."""
        world = self._world
        return any(
            point[NORMAL_FORCE] >= MIN_TOUCH_FORCE and point[BODY_B] != world.arm
            for link in self._links
            for point in world.client.getContactPoints(bodyA=world.arm, linkIndexA=link) or ()
        )

    @property
    def holding_force(self) -> float:
        """Sum of the forces of the fingers [N]."""
        return 2 * self._model.force if self.holding else 0.0

    @property
    def load(self) -> float:
        """Filtered downward force on the tool [N], without its weight, of a force sensor at the flange."""
        # The noise depends only on the physics step, so that a resumed run continues with the same noise.
        random_generator = np.random.default_rng([self._noise_seed, self._world.step_count])
        return self._load + float(random_generator.normal(0.0, self.load_std))

    def close(self) -> None:
        self._world.log_command(world_log.CLOSE)
        self._end_separation()
        self._is_closing = True
        self._stalled_step_count = 0
        self._grip_opening = 0.0
        self._command(self._closed_opening, self._model.speed)

    def open(self, opening: float = 0.0) -> None:
        self._world.log_command(world_log.OPEN, opening)
        body = self.held_body
        if body is not None:
            self._world.rest_positions.setdefault(body, []).append(self._world.get_object_pose(body).position)
        if opening or self._is_closing:
            self._command(opening or self.opening + 2 * self._model.release_allowance, self._model.speed)
        self._is_closing = False
        self._pressing_time = 0.0
        self.holding = False
        self._separate(body)
        self.held_body = None

    def lose_grip(self) -> None:
        """Let the held body slip out of the fingers, as if it were wet."""
        self._world.log_command(world_log.GRIP_LOST)
        self._separate(self.held_body)

    def advance(self) -> None:
        """Move the coupled joints, and update the sensors after a physics step."""
        self._move_coupled_joints()
        if not self._is_closing:
            self._end_separation()
        reaction = self._world.client.getJointState(self._world.arm, self._world.tool_index)[2][:3]
        upward_force = float(self._world.get_flange_pose().rotation[2] @ reaction)
        self._load += LOAD_SMOOTHING * (upward_force - self._weight - self._load)
        if not self._is_closing:
            return
        opening = self.opening
        min_opening = self._closed_opening + MIN_WIDTH
        _, velocity, _, effort = self._world.client.getJointState(self._world.arm, self._joints[0])
        effort = abs(effort)
        self._stalled_step_count = self._stalled_step_count + 1 if abs(velocity) < self._min_speed else 0
        if self._stalled_step_count == STALLED_STEP_COUNT and effort < MAX_WEAK_FRACTION * self._model.effort:
            self._command(self._closed_opening, PRESSING_SPEED)
        elif opening < self._grip_opening - MAX_CLOSING:
            self._command(self._closed_opening, self._model.speed)
        is_pressing = opening > min_opening and effort >= MIN_EFFORT_FRACTION * self._model.effort
        if is_pressing:
            self._grip_opening = opening
        loss_opening = max(self._grip_opening - MAX_CLOSING, min_opening)
        change = STEP if is_pressing else -STEP
        self._pressing_time = min(max(self._pressing_time + change, 0.0), SENSOR_TIME)
        if not self.holding and self._pressing_time >= SENSOR_TIME:
            self.holding = True
            self.held_body = self._find_body_between()
            if self.held_body is not None:
                self.dropped_bodies.discard(self.held_body)
        elif self.holding and self._pressing_time <= 0 and opening < loss_opening:
            self.holding = False
            if self.held_body is not None:
                self.dropped_bodies.add(self.held_body)
            self.held_body = None

    def _convert_speed(self, speed: float) -> float:
        """Return the mean speed of the first joint [m/s or rad/s] at a speed of each finger [m/s]."""
        return 2 * speed * float(np.ptp(self._positions) / np.ptp(self._openings))

    def _command(self, opening: float, speed: float) -> None:
        """Move the fingers to a distance [m], each with a speed [m/s], with the declared force."""
        order = np.argsort(self._openings)
        position = float(np.interp(opening, self._openings[order], self._positions[order]))
        self._world.client.setJointMotorControl2(
            self._world.arm, self._joints[0], pybullet.POSITION_CONTROL, targetPosition=position,
            force=self._model.effort, maxVelocity=self._convert_speed(speed),
        )  # fmt: skip

    def _move_coupled_joints(self) -> None:
        """Command the positions of the other joints, which follow that of the first one as by gears."""
        client = self._world.client
        position, velocity = client.getJointState(self._world.arm, self._joints[0])[:2]
        for joint, factor in zip(self._joints[1:], self._factors, strict=True):
            client.setJointMotorControl2(
                self._world.arm, joint, pybullet.POSITION_CONTROL, targetPosition=factor * position,
                targetVelocity=factor * velocity, positionGain=COUPLING_GAIN, velocityGain=0.3,
                force=COUPLING_EFFORT,
            )  # fmt: skip

    def _find_body_between(self) -> int | None:
        """Return the loose body on which the fingers press most, or None."""
        world = self._world
        forces = dict.fromkeys(world.labels, 0.0)
        for link in self._links:
            for point in world.client.getContactPoints(bodyA=world.arm, linkIndexA=link) or ():
                if point[BODY_B] in forces:
                    forces[point[BODY_B]] += point[NORMAL_FORCE]
        body = max(forces, key=lambda each: forces[each], default=None)
        return body if body is not None and forces[body] > 0 else None

    def _set_collision(self, body: int, enabled: bool) -> None:
        for link in self._links:
            self._world.client.setCollisionFilterPair(self._world.arm, body, link, -1, int(enabled))

    def _end_separation(self) -> None:
        if self._separated_body is not None:
            self._set_collision(self._separated_body, True)
            self._separated_body = None

    def _separate(self, body: int | None) -> None:
        """Let a body pass through the fingers until the next physics step with open fingers.

        PyBullet sometimes stores a contact with the opposite normal, which would hold the fingers.
        """
        if body is not None:
            self._set_collision(body, False)
            self._separated_body = body
