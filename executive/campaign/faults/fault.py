"""Faults that a campaign injects into runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from executive.testing.faults.script import Disturbance

When = Literal["first", "middle", "late", "lasting"]
"""Time of a fault in a run: the first activation, the middle, near the end, or repeatedly."""


class InjectedError(Exception):
    """The error that a campaign raises inside a skill to imitate a bug."""


@dataclass(frozen=True)
class Breakage:
    """A skill that misbehaves without a cause in the cell.

    Attributes:
        node: Path of its node.
        how: The skill fails, raises an error, or raises an error when it is halted.
        reason: Reason of the failure; "" for an error.
        starts: Activations in which it misbehaves, counted from 1; empty: all activations.
        after: Number of control steps of the skill before the error.
    """

    node: str
    how: Literal["fails", "raises", "raises when halted"]
    reason: str = ""
    starts: tuple[int, ...] = ()
    after: int = 0


@dataclass(frozen=True)
class Fault:
    """A fault that is injected into a run; a value that can be sent to another process.

    Attributes:
        about: Path of the affected node, or the affected part: `detector`, `object`, `tool`.
        name: Label or skill of the node, or the same as `about`.
        place: File and line of the node in the mission; "" for a part.
        what: Reason with which the node must fail, or a description of the fault.
        when: Time of the fault in the run.
        means: Description of the cause.
        happenings: Disturbances of the cell that cause the fault.
        breakages: Misbehaviour of skills that causes the fault.
        reason: True if `what` is a reason of the node.
        leads_to: Reason with which skills fail because of a fault of a part; "" if there is none.
        behind: True if the node runs only after another fault.
        instead_of: Number of the fault that this one replaces if that fault did not provoke its reason; 0 if
            none.
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
        """True if the run ends with the status FAULT, as after any bug."""
        return any(breakage.how != "fails" for breakage in self.breakages)

    def __str__(self) -> str:
        """Return a description of the fault."""
        return f"{self.about} {self.what}, {self.when}: {self.means}"
