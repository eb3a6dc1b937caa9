from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_states import passed, peaks, tool_velocities

from executive.arms.iiwa14 import interpolate_max_joint_6_angle
from executive.cell.arm import Goal, Task
from executive.cell.config import CellConfig
from executive.cell.objects import ObjectClass, Obstacle
from executive.errors import Blocked, Unreachable
from executive.geometry import Array
from executive.motion.configurations import find_configuration_pairs
from executive.motion.planner import MAX_CHECK_SPACING, Planner
from executive.motion.trajectory import Trajectory

CUBE = ObjectClass("cube", 0.05, 0.0354)
CARRYING = Task(CUBE)
BIN = Goal((0.24, -0.44, 0.08))
on_the_table = st.tuples(st.floats(0.42, 0.64), st.floats(-0.22, 0.22), st.floats(0.045, 0.06))


def pick(x: float, y: float, z: float = 0.053) -> Goal:
    return Goal((x, y, z), guarded_length=0.015, guarded_speed=0.04)


def tips_of(planner: Planner, motion: Trajectory) -> Array:
    """Where the tool is every millisecond `(N, 3)` [m]."""
    return planner.kinematics.compute_tcps_and_axes(passed(motion).q)[0]


def question(name: str, planner: Planner, config: CellConfig, home: Array) -> Trajectory:
    """Answer a fixed question."""
    near = neighbours(0.5, -0.1, 0.3, count=3, top=0.05)
    wall = tuple(Obstacle(float(x), 0.0, 0.04, 0.16, "the wall") for x in np.arange(0.2, 0.9, 0.05))
    aside, beyond = np.radians(config.arm.poses_deg["aside"]), Goal((0.5, 0.15, 0.07))
    picked = planner.plan(home, pick(0.5, -0.1)).end
    motion = config.motion.model_copy(update={"straight": 0.05})
    beside = planner.plan(home, Goal((0.42, 0.0, 0.01))).end
    onto = Goal((0.5, 0.0, 0.035), (), 0.02, 0.035)
    straight = Planner(config.model_copy(update={"motion": motion}))
    return {
        "pick": lambda: planner.plan(home, pick(0.5, -0.1)),
        "pick of many": lambda: planner.plan(aside, pick(0.5, -0.1), Task(obstacles=near)),
        "carry": lambda: planner.plan(picked, BIN, Task(CUBE, 7.9, near)),
        "carry weakly": lambda: planner.plan(picked, BIN, Task(CUBE, 2.4)),
        "sweep past": lambda: planner.plan(beside, onto, Task(target=Obstacle(0.5, 0.0, 0.0354, 0.05, "it"))),
        "carry hardly": lambda: planner.plan(picked, BIN, Task(CUBE, 1.0)),
        "over a wall": lambda: planner.plan(picked, beyond, Task(CUBE, obstacles=wall)),
        "straight": lambda: straight.plan(picked, BIN, Task(CUBE, 3.0)),
    }[name]()


ANSWERS = {
    "pick": (1.017523, 0.611915, [0.30651, 0.77648, -0.32558, -1.71549, 0.42773, 0.75296, 0.00811]),
    "pick of many": (0.880489, 0.474181, [-0.45612, 0.75291, 0.17469, -1.72332, -0.23836, 0.69373, -0.00516]),
    "carry": (0.714020, math.inf, [-0.17485, 0.85074, -0.6473, -1.76272, 0.75483, 0.75121, 0.0]),
    "carry weakly": (0.881290, math.inf, [-0.13677, 0.84962, -0.61767, -1.81649, 0.72037, 0.73338, 0.00215]),
    "sweep past": (1.067642, 0.467143, [0.30813, 0.86882, -0.40493, -1.86897, 0.62174, 0.54181, 0.01258]),
    "carry hardly": (3.545365, math.inf, [-0.05676, 0.88929, -0.82623, -1.80773, 0.81148, 0.90025, 0.02551]),
    "over a wall": (0.720998, math.inf, [0.3358, 0.781, -0.41088, -1.67597, 0.42511, 0.52079, 4e-05]),
    "straight": (1.139490, math.inf, [-0.06943, 0.87187, -0.79608, -1.81132, 0.77825, 0.84499, 0.07135]),
}  # fmt: skip
"""Duration [s], beginning of the guarded part [s] and mean joint positions [rad] of each fixed question."""


@pytest.mark.parametrize("name", ANSWERS)
def test_a_fixed_question_gets_a_fixed_answer(planner, config, home, name: str) -> None:
    """A change of the planner's decisions must change this table and state its reason."""
    motion, (duration, guarded, mean) = question(name, planner, config, home), ANSWERS[name]
    assert (motion.duration, motion.guarded_start_time) == pytest.approx((duration, guarded), rel=1e-5)
    # On another kind of processor the optimizer ends up to 2e-4 rad beside.
    assert motion.samples.q.mean(axis=0) == pytest.approx(mean, abs=2e-4)


def test_open_fingers_leave_an_upper_layer_of_a_bin_straight(config: CellConfig, home: Array) -> None:
    motion = config.motion.model_copy(update={"straight": 0.05})
    planner = Planner(config.model_copy(update={"motion": motion}))
    start = planner.plan(home, replace(BIN, position=(0.24, -0.44, 0.12))).end
    tips = tips_of(planner, planner.plan(start, pick(0.5, -0.1), Task(opening=0.06)))
    rise = tips[: np.argmax(tips[:, 2] > 0.165)]
    assert len(rise) > 10
    assert rise[:, :2] == pytest.approx(np.tile([0.24, -0.44], (len(rise), 1)), abs=1e-3)


@given(on_the_table, st.floats(0.008, 0.03), st.floats(0.02, 0.08))
@settings(max_examples=10)
def test_the_guarded_part_is_straight_even_and_no_faster_than_asked(
    planner, home, place, guarded, speed
) -> None:
    motion = planner.plan(home, Goal(place, guarded_length=guarded, guarded_speed=speed))
    states = passed(motion)
    tips, axes = planner.kinematics.compute_tcps_and_axes(states.q)
    low = tips[:, 2] < place[2] + guarded
    speeds = np.linalg.norm(tool_velocities(planner.kinematics, states), axis=1)[low]
    assert np.max(np.linalg.norm(tips[low, :2] - place[:2], axis=1)) < 5e-5
    assert axes[low, 2].max() < -1 + 1e-6
    assert speeds.max() <= speed * 1.001
    steady = tips[low, 2] > place[2] + 0.5 * guarded
    assert speeds[steady].min() > 0.5 * speed
    assert (low[1:] >= low[:-1]).all()  # it does not leave that part again


def test_a_fast_beginning_of_the_guarded_part_saves_time_and_only_the_end_is_slow(planner, home) -> None:
    target = Obstacle(0.5, 0.0, CUBE.radius, 0.05, "cube-1")
    slow = Goal((0.5, 0.0, 0.035), guarded_length=0.02, guarded_speed=0.035)
    motions = [
        planner.plan(home, goal, Task(target=target)) for goal in (slow, replace(slow, fast_length=0.004))
    ]
    assert motions[1].duration < motions[0].duration - 0.07
    tips = tips_of(planner, motions[1])
    speeds = np.linalg.norm(tool_velocities(planner.kinematics, passed(motions[1])), axis=1)
    assert speeds[tips[:, 2] < 0.035 + slow.guarded_length - 0.004].max() <= 0.035 * 1.001
    start = planner.kinematics.compute_tool_pose(
        motions[1].state_at(motions[1].guarded_start_time).q
    ).position
    assert 0.055 < start[2] < 0.057
    assert start[:2] == pytest.approx((0.5, 0.0), abs=0.006)


def neighbours(x: float, y: float, turn: float, count: int, top: float) -> tuple[Obstacle, ...]:
    """Cubes around a cube, 12 mm away from it."""
    apart = 2 * CUBE.radius + 0.012
    angles = (turn + np.arange(count) * math.pi / 3).tolist()
    return tuple(
        Obstacle(x + apart * math.cos(a), y + apart * math.sin(a), CUBE.radius, top, "a neighbour")
        for a in angles
    )


def test_the_collision_check_gets_the_complete_path_and_the_obstacles(config, home) -> None:
    asked = []
    motion = Planner(config, lambda path, task: asked.append((path, task))).plan(home, BIN, CARRYING)
    ((path, task),) = asked
    assert task == CARRYING
    assert np.array_equal(path[[0, -1]], [motion.start, motion.end])
    assert np.max(np.abs(np.diff(path, axis=0))) < MAX_CHECK_SPACING + 1e-9
    assert np.array_equal(path, path[np.isin(path[:, 0], motion.samples.q[:, 0])])


def test_what_is_to_be_touched_is_in_the_way_until_the_guarded_part(config, home) -> None:
    asked = []
    target, duck = (
        Obstacle(0.5, 0.0, CUBE.radius, 0.05, "cube-1"),
        Obstacle(0.6, 0.2, CUBE.radius, 0.05, "duck-1"),
    )
    task = Task(obstacles=(duck,), target=target)
    planner = Planner(config, lambda path, task: asked.append((path, task)))
    motion = planner.plan(home, Goal((0.5, 0.0, 0.035), guarded_length=0.02, guarded_speed=0.035), task)
    (free, before), (guarded, after) = asked
    assert (before, after) == (Task(obstacles=(duck, target)), task)
    assert np.array_equal(free[0], motion.start)
    assert np.array_equal(guarded[-1], motion.end)
    assert np.array_equal(free[-1], guarded[0]), "nothing is left out between"
    border = planner.kinematics.compute_tcps_and_axes(free[-1][None])[0][0]
    assert border == pytest.approx((0.5, 0.0, 0.055), abs=5e-4)


def test_the_next_way_is_taken_when_the_first_is_blocked(config, home) -> None:
    asked = []

    def check(path: Array, task: Task) -> None:
        asked.append(path)
        if len(asked) < 3:
            raise Blocked("too near")

    motion = Planner(config, check).plan(home, pick(0.5, 0.0))
    assert len(asked) == 4, "the last way in two parts"
    assert np.array_equal(asked[3][-1], motion.end)
    assert motion.duration > Planner(config).plan(home, pick(0.5, 0.0)).duration
    assert not np.array_equal(asked[0][-1], asked[2][-1])


def test_when_all_ways_are_blocked_the_error_is_the_first_ones_and_counts(config, home) -> None:
    asked = []

    def check(path: Array, task: Task) -> None:
        asked.append(path)
        raise Blocked(f"way {len(asked)} is too near")

    with pytest.raises(Blocked) as caught:
        Planner(config, check).plan(home, pick(0.5, 0.0))
    assert 5 < len(asked) < 40
    assert str(caught.value) == f"way 1 is too near; all {len(asked)} motions that were tried are blocked"


def test_the_wrist_folds_no_farther_than_links_5_and_7_keep_the_margin(planner, config, limits, home) -> None:
    """The data sheet would let joint 6 bend by 120 degrees."""
    most = interpolate_max_joint_6_angle(config.motion.margin)
    motion = planner.plan(home, Goal((0.3, 0.0, 0.6)))
    assert math.radians(95) < np.abs(motion.samples.q[:, 5]).max() <= most < limits.position.upper[5]
    with pytest.raises(Unreachable, match=r"0\.900, 0\.000, 0\.160\) m: .* 0\.081 m beyond the reach"):
        find_configuration_pairs(planner.kinematics, Goal((0.9, 0.0, 0.114)), 0.046, home)
    with pytest.raises(Unreachable, match=r"leaves joint 6 \d\.\d° outside ±106°"):
        planner.plan(home, Goal((0.3, 0.0, 0.7)))


def test_random_motions_keep_every_limit(planner, limits, config, home) -> None:
    """To and fro between the table and the bins, empty and loaded, some among other things."""
    rng = np.random.default_rng(11)
    q = home
    for number in range(10):
        x, y = rng.uniform((0.42, -0.22), (0.64, 0.22))
        around = tuple(
            Obstacle(float(a), float(b), 0.0354, 0.05, f"thing {n}")
            for n, (a, b) in enumerate(rng.uniform((0.42, -0.22), (0.64, 0.22), (3, 2)))
            if math.hypot(a - x, b - y) > 2 * 0.0354 + 0.012
        )
        bin = list(config.bins.values())[int(rng.integers(3))].position
        goal = Goal((bin[0] + rng.uniform(-0.05, 0.05), bin[1] + rng.uniform(-0.05, 0.05), 0.07))
        loaded = number % 2
        motion = (
            planner.plan(q, goal, Task(CUBE))
            if loaded
            else planner.plan(q, pick(x, y), Task(obstacles=around))
        )
        states = passed(motion)
        assert max(peaks(states, limits)) <= 1 + 1e-6
        assert np.all(limits.position.contains(states.q))
        q = motion.end
