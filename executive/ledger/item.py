"""One physical object as the ledger knows it."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from enum import Enum

from executive.geometry import Array


class State(Enum):
    """What became of an item so far."""

    SEEN = "seen"
    """On the table, waiting."""
    HELD = "held"
    """Sealed to the tool."""
    DROPPED = "dropped"
    """Lost by the tool on the way, not found again yet."""
    PLACED = "placed"
    """Let go in a bin."""
    REJECTED = "rejected"
    """Given up and left where it is."""
    LOST = "lost"
    """Known to exist, and nowhere to be found."""
    PHANTOM = "phantom"
    """Believed for one look, contradicted by others: no object at all."""


OPEN = (State.SEEN, State.DROPPED)
ON_TABLE = (State.SEEN, State.DROPPED, State.REJECTED)


@dataclass(eq=False)
class Record:
    """What is known of one item.

    Attributes:
        item: Its name, unique in the run.
        position: Where it was seen last `(3,)` [m].
        first: Where it was seen first `(3,)` [m].
        epoch: Change count of the table when it was seen last.
        state: What became of it.
        looks: In how many looks it was seen.
        absent: In how many looks at its place since then it was not seen.
        touched: True once the tool has met it.
        attempts: Failed grasps so far.
        bin: Where it was placed, or "".
        why: Why it was rejected or is lost, or "".
        votes: Sum of confidences by class.
    """

    item: str
    position: Array
    first: Array
    epoch: int
    state: State = State.SEEN
    looks: int = 0
    absent: int = 0
    touched: bool = False
    attempts: int = 0
    bin: str = ""
    why: str = ""
    votes: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    @property
    def label(self) -> str:
        """The class with the most votes; the first in the alphabet among equals."""
        return min(self.votes, key=lambda label: (-self.votes[label], label))

    @property
    def exists(self) -> bool:
        """True once two looks agree or the tool has touched it."""
        return self.looks >= 2 or self.touched
