"""A fault script: what happens to a cell, and when."""

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
    """While a node runs.

    Attributes:
        pattern: Of the node's path, as in `build`: `*` stands for anything, `/` included.
        nth: Which activations of all nodes that fit, counted from 1; empty for every one.
        probability: Chance of each of them.
        seed: Decides by chance.
    """

    pattern: str
    nth: tuple[int, ...] = ()
    probability: float = 1.0
    seed: int = 0

    def fits(self, path: str) -> bool:
        """Tell whether this is about a node."""
        return fnmatchcase(path, self.pattern)

    def chosen(self, number: int) -> bool:
        """Tell whether it happens during the activation of a number."""
        if self.nth and number not in self.nth:
            return False
        return float(np.random.default_rng([self.seed, number]).random()) < self.probability


@dataclass(frozen=True)
class DuringTime:
    """From one time on the run's clock until before another [s]."""

    start: float
    end: float


@dataclass(frozen=True)
class ScheduledFault:
    """Something that happens to a cell, and when."""

    what: Effect
    when: DuringNode | DuringTime


def during(pattern: str, what: Effect, *, nth: int | Collection[int] = ()) -> ScheduledFault:
    """Return a fault that lasts as long as a node runs.

    Args:
        pattern: Of the node's path: `*/Grasp`.
        what: What happens.
        nth: In which activations of all nodes that fit, counted from 1; by default in every one.

    Raises:
        InputError: An activation has a number less than 1.
    """
    numbers = (nth,) if isinstance(nth, int) else tuple(nth)
    if any(number < 1 for number in numbers):
        raise InputError(f"activations are counted from 1, and nth is {nth}")
    return ScheduledFault(what, DuringNode(pattern, numbers))


def with_probability(probability: float, pattern: str, what: Effect, *, seed: int) -> ScheduledFault:
    """Return a fault that lasts as long as a node runs, in some of its activations.

    Args:
        probability: Chance of every activation, 0 to 1.
        pattern: Of the node's path: `*/Transit`.
        what: What happens.
        seed: Decides which activations; the same one always the same.

    Raises:
        InputError: The probability is none.
    """
    if not 0.0 <= probability <= 1.0:
        raise InputError(f"a probability is 0 to 1, not {probability:g}")
    return ScheduledFault(what, DuringNode(pattern, probability=probability, seed=seed))


def between(start: float, end: float, what: Effect) -> ScheduledFault:
    """Return a fault that lasts from one time on the run's clock until another [s].

    Raises:
        InputError: It would end before it begins.
    """
    if not 0.0 <= start < end:
        raise InputError(f"a fault lasts from some time until a later one, not from {start:g} s to {end:g} s")
    return ScheduledFault(what, DuringTime(start, end))


def after(start: float, what: Effect) -> ScheduledFault:
    """Return a fault that lasts from a time on the run's clock [s] until the end."""
    return between(start, math.inf, what)
