"""States of the joints for tests: random ones, and those that a motion passes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from executive.cell.arm import Goal, JointState
from executive.geometry import Array
from executive.mission.cell_file import load_cell
from executive.motion.configurations import find_configuration_pairs
from executive.motion.joints import JointLimits, Kinematics, build_kinematics
from executive.motion.trajectory import MotionPiece
from executive.text.files import get_shipped_folder

CONFIG = load_cell(get_shipped_folder() / "cells" / "overhead.yaml")
ARM = build_kinematics(CONFIG)
LIMITS = replace(
    JointLimits.from_config(CONFIG.arm.limits),
    stop_acceleration=np.full(7, 20.0),
    stop_jerk=np.full(7, 300.0),
)
"""Limits of `ARM` for tests whose examples hypothesis finds."""

SOONER = 1e-3
"""Time between sampled states [s]."""

shares = st.lists(st.floats(-1, 1), min_size=7, max_size=7).map(np.array)
"""A number between -1 and 1 for every joint."""

positions = shares.map(lambda share: share * LIMITS.position.upper)
"""Joint positions inside the limits."""


@st.composite
def states(draw: st.DrawFn) -> JointState:
    """States that can be entered and left inside the limits, most of them moving."""
    qdd = 0.9 * draw(shares) * LIMITS.acceleration
    most = LIMITS.velocity - qdd**2 / (2 * LIMITS.jerk)
    return JointState(draw(positions), 0.99 * draw(shares) * most, qdd)


def passed(motion: MotionPiece, spacing: float = SOONER) -> JointState:
    """The states of a motion every `spacing` [s], the last one included, each array of shape `(N, 7)`."""
    times = [*np.arange(0.0, motion.duration, spacing), motion.duration]
    return JointState(*map(np.array, zip(*(motion.state_at(float(s)) for s in times), strict=True)))


def peaks(states: JointState, limits: JointLimits, spacing: float = SOONER) -> tuple[float, float, float]:
    """The largest velocity, acceleration and jerk of any joint, as shares of its limits."""
    jerk = np.diff(states.qdd, axis=0) / spacing
    pairs = (states.qd, limits.velocity), (states.qdd, limits.acceleration), (jerk, limits.jerk)
    v, a, j = (float(np.max(np.abs(values) / limit, initial=0.0)) for values, limit in pairs)
    return v, a, j


def tool_velocities(kinematics: Kinematics, states: JointState) -> Array:
    """The tool centre point's velocities `(N, 3)` [m/s] in states, each array of shape `(N, 7)`."""
    h = 1e-6
    ahead, behind = (kinematics.compute_tcps_and_axes(states.q + step * states.qd)[0] for step in (h, -h))
    return (ahead - behind) / (2 * h)


def reach(kinematics: Kinematics, place: ArrayLike, q: Array) -> Array:
    """The joint positions `(7,)` nearest to `q` with the tool straight down at a place `(3,)` [m]."""
    x, y, z = np.asarray(place, dtype=float).tolist()
    found = find_configuration_pairs(kinematics, Goal((x, y, z)), 0.0, q).lower_qs
    return found[np.argmin(np.max(np.abs(found - q), axis=1))]
