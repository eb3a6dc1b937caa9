"""What reaches into a cell past the robot: the truth about its objects, and brute force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from executive.geometry import Array


@dataclass(frozen=True, eq=False)
class Thing:
    """An object as it lies, hangs or falls now.

    Attributes:
        body: What the world knows it by.
        label: Its class.
        position: Its centre `(3,)` [m].
    """

    body: Any
    label: str
    position: Array


class Hand(Protocol):
    """Does to the world of a cell what no skill can."""

    @property
    def things(self) -> Sequence[Thing]:
        """Every loose object, in the order they came into the world."""

    @property
    def held(self) -> Thing | None:
        """What hangs at the tool, or None."""

    def remove(self, thing: Thing) -> None:
        """Take an object out of the world, out of the tool too."""

    def move(self, thing: Thing, by: tuple[float, float]) -> None:
        """Put an object elsewhere, `by` `(x, y)` [m], out of the tool too; it is at rest there."""

    def part(self) -> None:
        """Let the seal of the tool give way; what hangs there falls."""

    def leak(self, leaks: bool) -> None:
        """Keep the tool from sealing anything, or no longer."""

    def stick(self, sticks: bool) -> None:
        """Keep the tool from letting go when it is opened, or no longer."""

    def stand_in_the_way(self, what: str) -> None:
        """Let the arm run into `what` now: it breaks off its motion."""

    def settle(self) -> None:
        """Let time pass that is none of a run's: the arm comes to rest, and so does what was moved."""
