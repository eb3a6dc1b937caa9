"""Where the joints are and how they move, at one moment of a motion."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from executive.geometry import Array


class JointState(NamedTuple):
    """Position [rad], velocity [rad/s] and acceleration [rad/s²] of the joints, each `(n,)`."""

    q: Array
    qd: Array
    qdd: Array

    @staticmethod
    def rest(q: Array) -> JointState:
        """Return the state of standing still at `q` `(n,)` [rad]."""
        return JointState(q, np.zeros(len(q)), np.zeros(len(q)))


class Piece(Protocol):
    """A part of a motion, from its time 0 to its duration."""

    @property
    def duration(self) -> float:
        """Time it takes [s]."""

    def at(self, s: float) -> JointState:
        """Return the state at time `s`, 0 to `duration` [s]."""

    def over(self, times: Array) -> JointState:
        """Return the states at `times` `(N,)` [s], each array of shape `(N, n)`."""
