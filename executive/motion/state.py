"""Motion state of the joints, and the protocol of a piece of a motion."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from executive.geometry import Array


class JointState(NamedTuple):
    """Position [rad], velocity [rad/s] and acceleration [rad/s²] of `n` joints, each `(n,)` or `(N, n)`."""

    q: Array
    qd: Array
    qdd: Array

    @staticmethod
    def at_rest(q: Array) -> JointState:
        """Return the state of rest at `q` `(n,)` [rad]."""
        return JointState(q, np.zeros(len(q)), np.zeros(len(q)))


class MotionPiece(Protocol):
    """A piece of a motion, from time 0 to its duration."""

    @property
    def duration(self) -> float:
        """Duration [s]."""

    def state_at(self, time: float) -> JointState:
        """Return the state at `time`, 0 to `duration` [s]."""

    def sample(self, times: Array) -> JointState:
        """Return the states at `times` `(N,)` [s], each array of shape `(N, n)`."""
