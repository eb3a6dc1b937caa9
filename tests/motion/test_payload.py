"""Of executive/motion/optimizer.py: how gently a load is carried."""

from __future__ import annotations

import math

import numpy as np
import pytest

from executive.cell.arm import JointState
from executive.cell.objects import ObjectClass
from executive.geometry import GRAVITY
from executive.motion.optimizer import DISTANCE_PER_ACCELERATION, SAMPLE_STRIDE, PayloadLimit
from executive.motion.trajectory import Trajectory
from executive.motion.transcription import SAMPLE_FRACTIONS, SAMPLES_PER_STEP, STEP_COUNT
from executive.testing.fake_cell import load_empty_cell

KIND = ObjectClass("cube", 0.05, 0.035, mass=0.1)
TOOL = load_empty_cell().tool
LENGTH = 1.0 / STEP_COUNT
"""Of a step of a course that sways [s]."""


class Sway:
    """A turn of joint 1 to and fro, at rest where it begins and ends: the tool's middle goes on a circle."""

    duration = 1.0

    def __init__(self, q, angle: float) -> None:
        self._q, self._angle = q, angle

    def state_at(self, s: float) -> JointState:
        """A quintic from rest to rest."""
        turn = np.eye(7)[0] * self._angle
        place, speed, change = (
            10 * s**3 - 15 * s**4 + 6 * s**5,
            30 * s**2 * (1 - s) ** 2,
            60 * s * (1 - s) * (1 - 2 * s),
        )
        return JointState(self._q + turn * place, turn * speed, turn * change)

    def sample(self, times) -> JointState:
        """The states at many times."""
        return JointState(*map(np.array, zip(*map(self.state_at, times), strict=True)))


@pytest.fixture
def sway(home):
    return Trajectory([Sway(home, 1.0)])


def strongest(trajectory: Trajectory, kinematics) -> float:
    """The largest acceleration of the tool by the textbook: along the circle, and to its middle [m/s²]."""
    tips, _ = kinematics.compute_tcps_and_axes(trajectory.start[None])
    radius = math.hypot(*tips[0, :2])
    _, qd, qdd = trajectory.samples
    return float(np.max(radius * np.hypot(qdd[:, 0], qd[:, 0] ** 2)))


@pytest.mark.parametrize("share", [0.25, 0.6, 0.9])
def test_flown_at_the_root_of_the_share_a_motion_is_just_affordable(sway, kinematics, share: float) -> None:
    bears = TOOL.safety_factor * KIND.mass * math.hypot(GRAVITY, share * strongest(sway, kinematics))
    payload = PayloadLimit(KIND, bears, TOOL, kinematics)
    gentle = payload.make_safe_motion(sway)
    rate = sway.duration / gentle.duration
    assert rate == pytest.approx(math.sqrt(share), rel=0.01)
    assert payload.find_acceleration_fraction(gentle) == pytest.approx(1.0, abs=0.01)
    assert payload.find_acceleration_fraction(sway.make_slower_copy(1.1 * rate)) < 0.9


def test_a_demand_is_what_the_seal_bears_beyond_weight_and_hold(sway, kinematics) -> None:
    """Of places STRIDE apart on a course, in centimetres for each metre per second squared."""
    bears = 3.0
    qs = np.array([sway.state_at(place).q for place in SAMPLE_FRACTIONS])
    demand = PayloadLimit(KIND, bears, TOOL, kinematics).linearize(qs, LENGTH / SAMPLES_PER_STEP, math.inf)
    middle = demand.samples[:, 1]
    assert np.array_equal(np.diff(middle), np.full(len(middle) - 1, SAMPLE_STRIDE))
    assert middle[0] < 2 * SAMPLE_STRIDE
    assert middle[-1] > len(qs) - 2 * SAMPLE_STRIDE
    radius = math.hypot(*kinematics.compute_tcps_and_axes(qs[:1])[0][0, :2])
    states = [sway.state_at(place) for place in SAMPLE_FRACTIONS[middle]]
    level = radius * np.array([math.hypot(state.qdd[0], state.qd[0] ** 2) for state in states])
    wanted = DISTANCE_PER_ACCELERATION * (bears / TOOL.safety_factor / KIND.mass - np.hypot(level, GRAVITY))
    assert demand.slack == pytest.approx(wanted, abs=DISTANCE_PER_ACCELERATION * 0.05)
    near = PayloadLimit(KIND, bears, TOOL, kinematics).linearize(qs, LENGTH / SAMPLES_PER_STEP, 0.096)
    assert 0 < len(near.slack) < len(demand.slack)
    for values, every in zip(near, demand, strict=True):
        assert np.array_equal(values, every[demand.slack < 0.096]), "what is far from its bounds is left out"
