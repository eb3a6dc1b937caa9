"""Fault script: the faults of a cell and their times."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from executive.errors import InputError
from executive.testing.faults.effect import Effect


@dataclass(frozen=True)
class DuringNode:
    """Activations of nodes.

    Attributes:
        pattern: Pattern of the nodes' paths; `*` matches any text, `/` included.
        nth: Numbers of activations, counted from 1 over all matching nodes; empty: all.
        probability: Probability of a fault in each of them.
        seed: Random seed.
    """

    pattern: str
    nth: tuple[int, ...] = ()
    probability: float = 1.0
    seed: int = 0

    def matches(self, path: str) -> bool:
        """Return True if the path of a node matches the pattern."""
        return fnmatchcase(path, self.pattern)

    def includes(self, number: int) -> bool:
        """Return True if the fault occurs in the activation with this number."""
        if self.nth and number not in self.nth:
            return False
        return float(np.random.default_rng([self.seed, number]).random()) < self.probability


@dataclass(frozen=True)
class DuringTime:
    """Time on the run's clock from `start` until before `end` [s]."""

    start: float
    end: float


@dataclass(frozen=True)
class ScheduledFault:
    """An effect on a cell, and its time."""

    effect: Effect
    time: DuringNode | DuringTime


def during(pattern: str, effect: Effect, *, nth: int | Collection[int] = ()) -> ScheduledFault:
    """Return a fault that lasts while a node runs.

    Args:
        pattern: Pattern of the node's path: `*/Grasp`.
        effect: Effect of the fault.
        nth: Numbers of activations, counted from 1 over all matching nodes; by default all.

    Raises:
        InputError: A number is less than 1.
    """
    numbers = (nth,) if isinstance(nth, int) else tuple(nth)
    if any(number < 1 for number in numbers):
        raise InputError(f"the number of an activation is at least 1, not {nth}")
    return ScheduledFault(effect, DuringNode(pattern, numbers))


def with_probability(probability: float, pattern: str, effect: Effect, *, seed: int) -> ScheduledFault:
    """Return a fault that lasts while a node runs, in a random part of its activations.

    Args:
        probability: Probability in each activation, 0 to 1.
        pattern: Pattern of the node's path: `*/Transit`.
        effect: Effect of the fault.
        seed: Random seed, which determines the activations.

    Raises:
        InputError: The probability is not in 0 to 1.
    """
    if not 0.0 <= probability <= 1.0:
        raise InputError(f"a probability is 0 to 1, not {probability:g}")
    return ScheduledFault(effect, DuringNode(pattern, probability=probability, seed=seed))


def between(start: float, end: float, effect: Effect) -> ScheduledFault:
    """Return a fault that lasts from one time on the run's clock until another [s].

    Raises:
        InputError: The end is not after the start.
    """
    if not 0.0 <= start < end:
        raise InputError(f"a fault needs times with 0 <= start < end, not {start:g} s and {end:g} s")
    return ScheduledFault(effect, DuringTime(start, end))


def after(start: float, effect: Effect) -> ScheduledFault:
    """Return a fault that lasts from a time on the run's clock [s] until the end."""
    return between(start, math.inf, effect)
