"""Scheduled faults of a fault script: in activations of a node, in random activations, or in a time span."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from executive.errors import InputError
from executive.testing.faults.effect import Effect


@dataclass(frozen=True)
class NodeActivations:
    """Activations of nodes in which a fault occurs; an activation lasts from the start to the end of a node.

    Attributes:
        pattern: Pattern that the path of the node matches; `*` matches any text, also with `/`.
        numbers: Numbers of the activations, counted from 1 over all matching nodes; empty: all activations.
        probability: Probability of the fault in each of these activations, 0 to 1.
        seed: Random seed, which determines the activations.
    """

    pattern: str
    numbers: tuple[int, ...] = ()
    probability: float = 1.0
    seed: int = 0

    def matches(self, path: str) -> bool:
        """Return True if the path of a node matches the pattern."""
        return fnmatchcase(path, self.pattern)

    def includes(self, number: int) -> bool:
        """Return True if the fault occurs in the activation with this number, from 1."""
        if self.numbers and number not in self.numbers:
            return False
        return float(np.random.default_rng([self.seed, number]).random()) < self.probability


@dataclass(frozen=True)
class TimeSpan:
    """Time span of a fault on the run's clock, from `start` (included) to `end` (excluded) [s]."""

    start: float
    end: float


class ScheduledFault(NamedTuple):
    """A fault of a script: an effect on the cell, and the activations or the time span in which it occurs."""

    effect: Effect
    time: NodeActivations | TimeSpan


def during(pattern: str, effect: Effect, *, activations: int | Collection[int] = ()) -> ScheduledFault:
    """Return a fault that lasts while a node runs.

    Args:
        pattern: Pattern that the path of the node matches, for instance `*/Grasp`.
        effect: Effect of the fault.
        activations: One or more numbers of activations, counted from 1 over all matching nodes; empty: all.

    Raises:
        InputError: A number is less than 1.
    """
    numbers = (activations,) if isinstance(activations, int) else tuple(activations)
    if any(number < 1 for number in numbers):
        raise InputError(f"the number of an activation must be at least 1, not {activations}")
    return ScheduledFault(effect, NodeActivations(pattern, numbers))


def with_probability(probability: float, pattern: str, effect: Effect, *, seed: int) -> ScheduledFault:
    """Return a fault that lasts while a node runs, in randomly chosen activations.

    Args:
        probability: Probability of the fault in each activation, 0 to 1.
        pattern: Pattern that the path of the node matches, for instance `*/Transit`.
        effect: Effect of the fault.
        seed: Random seed, which determines the activations.

    Raises:
        InputError: The probability is less than 0 or more than 1.
    """
    if not 0.0 <= probability <= 1.0:
        raise InputError(f"a probability must be 0 to 1, not {probability:g}")
    return ScheduledFault(effect, NodeActivations(pattern, probability=probability, seed=seed))


def between(start: float, end: float, effect: Effect) -> ScheduledFault:
    """Return a fault that lasts from `start` (included) to `end` (excluded) on the run's clock [s].

    Raises:
        InputError: `start` is negative, or not before `end`.
    """
    if not 0.0 <= start < end:
        raise InputError(f"a fault needs times with 0 <= start < end, not {start:g} s and {end:g} s")
    return ScheduledFault(effect, TimeSpan(start, end))


def after(start: float, effect: Effect) -> ScheduledFault:
    """Return a fault that lasts from `start` on the run's clock [s] until the end of the run."""
    return between(start, math.inf, effect)
