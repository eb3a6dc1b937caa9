"""One thing that goes wrong in a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from executive.testing.faults.script import Disturbance

When = Literal["first", "middle", "late", "lasting"]
"""When something goes wrong: the first time, half-way, towards the end, or again and again."""


class InjectedError(Exception):
    """A bug that a campaign put into a skill."""


@dataclass(frozen=True)
class Breakage:
    """A skill that goes wrong by itself, where nothing in the cell makes it.

    Attributes:
        node: Path of its node.
        how: It fails; it raises an error; or it raises one when it is halted.
        reason: Why it fails.
        starts: In which of its activations, counted from 1; empty for every one.
        after: Control steps that it runs before.
    """

    node: str
    how: Literal["fails", "raises", "raises when halted"]
    reason: str = ""
    starts: tuple[int, ...] = ()
    after: int = 0


@dataclass(frozen=True)
class Fault:
    """One thing that goes wrong in a run; a value that can be sent to another process.

    Attributes:
        about: Path of the node, or what else is at fault: `detector`, `object`, `tool`.
        name: Of the node's skill, or as `about`.
        place: Where the node stands in the mission: file and line; "" for what is no node.
        what: Reason that the node is to fail with, or what happens.
        when: When it happens.
        means: How it is brought about, in words.
        happenings: What happens to the cell.
        breakages: What goes wrong by itself.
        reason: True where `what` is a reason of the node.
        leads_to: Reason that skills fail with because of it, where `what` is none; "" where there is no one.
        behind: True where the node runs only once something else has gone wrong.
        instead_of: Number of the fault that this one is tried for, if that one does not come to its reason.
    """

    about: str
    name: str
    place: str
    what: str
    when: When
    means: str
    happenings: tuple[Disturbance, ...] = ()
    breakages: tuple[Breakage, ...] = ()
    reason: bool = False
    leads_to: str = ""
    behind: bool = False
    instead_of: int = 0

    @property
    def ends_run(self) -> bool:
        """True where the run ends as a fault, as after any bug."""
        return any(breakage.how != "fails" for breakage in self.breakages)

    def __str__(self) -> str:
        """Return it in words."""
        return f"{self.about} {self.what}, {self.when}: {self.means}"
