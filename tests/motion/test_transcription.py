"""Programs of accelerations: they begin and end in the given states and keep the limits."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_states import LIMITS, positions, shares

from executive.cell.arm import JointState
from executive.geometry import Array
from executive.motion.trajectory import Connector
from executive.motion.transcription import (
    SAMPLE_FRACTIONS,
    STEP_COUNT,
    DiscreteMotion,
    LinearizedConstraints,
    Transcription,
)

CONNECTOR = Connector(LIMITS)
WIDE = 0.5
FINE = 40


def clear_of(rows: Array, slack: float, slopes: Array) -> LinearizedConstraints:
    """A wall that positions are so far from, whatever their number, however long the steps."""
    count = len(rows)
    return LinearizedConstraints(
        np.full(count, slack), rows[:, None], np.tile(slopes, (count, 1, 1)), np.zeros(count)
    )


NOTHING = [clear_of(np.zeros(0, dtype=np.intp), 0.0, np.zeros(7))]


@st.composite
def moves(draw: st.DrawFn, passing: float = 0.0) -> tuple[JointState, JointState]:
    """Start and end of moves that take half a second to a second and a half.

    `passing`: share of the limits of velocity and acceleration that they have at most.
    """
    near = draw(positions) / 2
    change = 0.9 * draw(shares) * np.where(np.arange(7) == draw(st.integers(0, 6)), 1.0, 0.3)
    joint = np.argmax(np.abs(change))
    change[joint] = np.copysign(max(0.3, abs(change[joint])), change[joint])
    ends = [
        JointState(q, passing * draw(shares) * LIMITS.velocity, passing * draw(shares) * LIMITS.acceleration)
        for q in (near, near + change)
    ]
    return ends[0], ends[1]


def direct(start: JointState, end: JointState) -> tuple[float, Array]:
    """How long the fastest motion takes, and its positions at the places looked at."""
    motion = CONNECTOR.connect(start, end)
    return motion.duration, motion.sample(SAMPLE_FRACTIONS * motion.duration).q


def fitted(start: JointState, end: JointState, slower: float = 1.6) -> tuple[Transcription, DiscreteMotion]:
    """A course that takes so much longer than the fastest motion."""
    program = Transcription(start, end, LIMITS)
    duration, first = direct(start, end)
    course = program.fit(slower * duration / STEP_COUNT, first)
    assert course is not None
    return program, course


def shortened(program: Transcription, course: DiscreteMotion, times: int = 12) -> DiscreteMotion:
    """What remains of a course after so many steps with nothing in the way."""
    for _ in range(times):
        found = program.solve_subproblem(course, NOTHING, WIDE)
        assert found is not None
        course = found
    return course


def flown(start: JointState, course: DiscreteMotion, fine: int = FINE) -> JointState:
    """States on a course, by adding up its accelerations, each array of shape `(N, 7)`."""
    dt = course.step_duration / fine
    q, qd, states = start.q, start.qd, []
    for before, after in zip(course.accelerations.T, course.accelerations.T[1:], strict=False):
        for k in range(fine):
            one, other = (before + (after - before) * share for share in (k / fine, (k + 1) / fine))
            states.append(JointState(q, qd, one))
            q = q + qd * dt + dt**2 * (2 * one + other) / 6
            qd = qd + dt * (one + other) / 2
    states.append(JointState(q, qd, course.accelerations[:, -1]))
    return JointState(*map(np.array, zip(*states, strict=True)))


@given(moves() | moves(passing=0.15))
@settings(max_examples=10)
def test_a_course_begins_and_ends_in_the_given_states(move) -> None:
    program, course = fitted(*move)
    last = program.solve_subproblem(course, NOTHING, WIDE)
    assert last is not None
    # The squares of the step are tangents: what they miss is its change squared.
    missed = (last.step_duration - course.step_duration) ** 2 * LIMITS.acceleration.max() / last.step_duration
    for found, miss in ((course, 0.0), (last, missed)):
        states = flown(move[0], found)
        for values, first in zip(states, move[0], strict=True):
            assert np.allclose(values[0], first, atol=1e-9)
        q, qd, qdd = (values[-1] for values in states)
        assert np.allclose(q, move[1].q, atol=1e-6 + miss * found.duration)
        assert np.allclose(qd, move[1].qd, atol=1e-6 + miss)
        assert np.allclose(qdd, move[1].qdd, atol=1e-9)


@given(moves(passing=0.15))
@settings(max_examples=10)
def test_a_course_keeps_the_limits(move) -> None:
    program, course = fitted(*move)
    for found in (course, shortened(program, course, 6)):
        states = flown(move[0], found)
        jerk = np.abs(np.diff(found.accelerations, axis=1).T) / found.step_duration
        assert np.max(jerk / LIMITS.jerk) <= 1
        assert np.max(np.abs(states.qdd) / LIMITS.acceleration) <= 1
        # Velocities are looked at every half step; between those they may be higher by what jerk makes of it.
        assert np.max(np.abs(states.qd[:: FINE // 2]) / LIMITS.velocity) <= 1
        bulge = jerk.max(axis=0) * (found.step_duration / 2) ** 2 / 8
        assert np.all(np.abs(states.qd) <= LIMITS.velocity + bulge)
