"""What is measured of an arm that brakes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from executive.campaign.braking import BEFORE, Braking, CommandLog, off_path
from executive.cell_config import CellConfig
from executive.geometry import Array
from executive.motion.free import Connector
from executive.motion.limits import JointLimits
from executive.motion.state import State
from executive.motion.stop import brake
from executive.motion.trajectory import STEP, Trajectory

STOPPED = 40
"""Control step of the motion at which it is stopped."""


@pytest.fixture(scope="module")
def limits(overhead: CellConfig) -> JointLimits:
    return JointLimits.of(overhead.arm.limits)


@pytest.fixture(scope="module")
def path(limits: JointLimits) -> Trajectory:
    start = np.radians([0.0, 20.0, 0.0, -80.0, 0.0, 60.0, 0.0])
    turned = start + np.radians([60.0, 15.0, 0.0, 10.0, 0.0, -10.0, 30.0])
    return Trajectory([Connector(limits).connect(State.rest(start), State.rest(turned))])


@pytest.fixture(scope="module")
def commands(path: Trajectory, limits: JointLimits) -> list[Array]:
    """The commands of a motion that is stopped at `STOPPED`, to rest and a few steps more."""
    times = [step * STEP for step in range(STOPPED + 1)]
    times += brake(path, times[-1], limits, STEP).tolist()
    return [path.at(time).q for time in (*times, *[times[-1]] * 4)]


def measured(commands: list[Array], path: Trajectory | None, limits: JointLimits) -> Braking:
    arm: Any = SimpleNamespace(_command=commands[0], _motion=path)
    log = CommandLog(arm)
    for step, command in enumerate(commands):
        if step == STOPPED:
            log.begin()
        arm._command = command
        log.keep()
    return log.braking(limits)


def test_a_stop_along_the_path_is_on_it_and_inside_the_stop_limits(
    commands: list[Array], path: Trajectory, limits: JointLimits
) -> None:
    braking = measured(commands, path, limits)
    assert braking.deviation < 1e-7
    assert 0.5 < braking.acceleration <= 1.0
    assert 0.5 < braking.jerk <= 1.02


def test_a_command_beside_the_path_is_seen(
    commands: list[Array], path: Trajectory, limits: JointLimits
) -> None:
    astray = [*commands]
    astray[STOPPED + 5] = commands[STOPPED + 5] + np.array([0, 0, 1e-3, 0, 0, 0, 0])
    assert measured(astray, path, limits).deviation == pytest.approx(1e-3)


def test_a_stop_from_one_step_to_the_next_is_too_hard(
    commands: list[Array], path: Trajectory, limits: JointLimits
) -> None:
    dead = [*commands[: STOPPED + 1], *[commands[STOPPED]] * 10]
    braking = measured(dead, path, limits)
    assert braking.acceleration > 5.0
    assert braking.jerk > 50.0


def test_an_arm_that_stood_must_go_on_standing(
    commands: list[Array], path: Trajectory, limits: JointLimits
) -> None:
    stood = [commands[-1]] * (STOPPED + 8)
    assert measured(stood, None, limits) == Braking(0.0, 0.0, 0.0)
    stood[-1] = stood[-1] + 2e-4
    assert measured(stood, None, limits).deviation == pytest.approx(2e-4)


def test_what_came_before_the_arm_stood_is_no_deviation(
    commands: list[Array], path: Trajectory, limits: JointLimits
) -> None:
    end = path.duration
    arriving = [path.at(end + (step - STOPPED + 1) * STEP).q for step in range(STOPPED + 8)]
    assert np.ptp(arriving[STOPPED - BEFORE :], axis=0).max() > 0.0
    assert measured(arriving, None, limits).deviation == 0.0


def test_the_distance_from_a_path_is_that_to_its_nearest_place(path: Trajectory) -> None:
    between = path.at(31.37 * STEP).q
    assert off_path(between, path) < 1e-7
    # Joint 5 rests all along the path, so nothing of it is nearer than this.
    assert off_path(between + np.array([0, 0, 0, 0, 0.01, 0, 0]), path) == pytest.approx(0.01, abs=1e-6)


def test_a_path_that_comes_back_to_where_it_was_is_not_taken_for_another_part_of_it(
    limits: JointLimits,
) -> None:
    start = np.radians([0.0, 20.0, 0.0, -80.0, 0.0, 60.0, 0.0])
    there, connect = State.rest(start + np.radians([60.0, 0, 0, 0, 0, 0, 0])), Connector(limits).connect
    # Back again a hair's breadth beside the way there.
    back = State.rest(start + np.radians([0.0, 0.001, 0, 0, 0, 0, 0]))
    path = Trajectory([connect(State.rest(start), there), connect(there, back)])
    steps = np.arange(0.5, path.duration / STEP, 7.3)
    assert max(off_path(path.at(step * STEP).q, path) for step in steps) < 1e-7
