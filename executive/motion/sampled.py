"""A motion known by its states every 1/240 s."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from scipy.interpolate import BPoly

from executive.clock import STEP
from executive.geometry import Array
from executive.motion.state import State
from executive.motion.trajectory import Trajectory


class Sampled:
    """A piece between given states: polynomials of fifth degree that agree with them; implements `Piece`.

    Args:
        states: Every `STEP`, and at the end; each array of shape `(N, 7)`.
        duration: Time it takes [s].
    """

    def __init__(self, states: State, duration: float) -> None:
        self.duration = duration
        self._times = np.append(np.arange(0.0, duration, STEP), duration)
        self._states = states

    def at(self, s: float) -> State:
        """Return the state at time `s` [s]."""
        return State(*(curve(s) for curve in self._curves))

    def over(self, times: Array) -> State:
        """Return the states at `times` `(N,)` [s]."""
        return State(*(curve(times) for curve in self._curves))

    @cached_property
    def _curves(self) -> tuple[BPoly, BPoly, BPoly]:
        if len(self._times) == 1:  # a motion to where the arm is: it takes no time
            q = BPoly(self._states.q[None], [0.0, 1.0])
        else:
            q = BPoly.from_derivatives(self._times, np.stack(self._states, axis=1))
        return q, q.derivative(), q.derivative(2)


def sampled(states: State, duration: float, guarded: float = math.inf) -> Trajectory:
    """Return the motion that `Trajectory.samples` gave these states of."""
    return Trajectory([Sampled(states, duration)], guarded)
