"""Where the joints are and how they move, at one moment of a motion."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from executive.geometry import Array


class State(NamedTuple):
    """Position [rad], velocity [rad/s] and acceleration [rad/s²] of the joints, each `(n,)`."""

    q: Array
    qd: Array
    qdd: Array

    @staticmethod
    def rest(q: Array) -> State:
        """Return the state of standing still at `q` `(n,)` [rad]."""
        return State(q, np.zeros(len(q)), np.zeros(len(q)))


class Piece(Protocol):
    """A part of a motion, from its time 0 to its duration."""

    @property
    def duration(self) -> float:
        """Time it takes [s]."""

    def at(self, s: float) -> State:
        """Return the state at time `s`, 0 to `duration` [s]."""

    def over(self, times: Array) -> State:
        """Return the states at `times` `(N,)` [s], each array of shape `(N, n)`."""
