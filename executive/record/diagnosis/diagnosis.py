"""Diagnosis of a run that did not succeed: causes with numbers, and advice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from executive.record.timeline.activation import Reading
from executive.record.timeline.items import Look, Sighting


@dataclass(frozen=True)
class DecidingNode:
    """Node that decided the end of a run.

    Attributes:
        path: Path of the node.
        name: Name of the node for a person: `Grasp of cube-1`, `look: retry`.
        place: File and line in the mission.
    """

    path: str
    name: str
    place: str


@dataclass(frozen=True)
class PassedNode:
    """Control node that did not handle a failure, or the origin of the failure.

    Attributes:
        path, name, place: As in `DecidingNode`.
        why: Reason why the node did not handle the failure; "" for the origin.
    """

    path: str
    name: str
    place: str
    why: str


@dataclass(frozen=True)
class ItemFailure:
    """Last failure of a skill that worked on an item.

    Attributes:
        what: Skill and reason: `Transit.dropped`.
        message: Message of the failure.
        clock: Time of the failure [s].
    """

    what: str
    message: str
    clock: float


@dataclass(frozen=True)
class LostItem:
    """Item that was lost.

    Attributes:
        item: Name of the item.
        look: Last look that showed the item, or None.
        unseen: Number of looks after `look`.
        held, dropped: Last times at which the tool picked and lost the item [s], or None.
        failed: Last failure of a skill that worked on the item, or None.
    """

    item: str
    look: Sighting | None
    unseen: int
    held: float | None
    dropped: float | None
    failed: ItemFailure | None


@dataclass(frozen=True)
class Diagnosis:
    """Explanation of a run that did not succeed.

    Attributes:
        status: `FAILURE`, `FAULT` or `HALTED`.
        reason: Reason of the failure.
        clock: Time of the end [s].
        mission: The mission file.
        verdict: The cause in one sentence.
        node: Node that determined the status, or None.
        item: Item that this node worked on, or "".
        chain: The nodes that did not handle the failure, from the root, and its origin.
        reads: Answers of the cell to the failed skill, the latest first.
        look: Last look that showed the item, or else the last look; None if there was no look.
        lost: Lost items.
        running: Skills that were halted, in words.
        left: Names of the items that are not sorted.
        arm: `at rest`, or a sentence about the arm.
        holds: Content of the tool, or "".
        raised_at: File, line and function in which the exception of a fault was raised, or "".
        recorded: True if the journal is complete.
        resumes: True if the run can be resumed.
        picture: File of the picture of the failure, relative to the run directory, or "".
        next: Advice in sentences, the most urgent first.
    """

    status: str
    reason: str
    clock: float
    mission: str
    verdict: str
    node: DecidingNode | None
    item: str
    chain: Sequence[PassedNode]
    reads: Sequence[Reading]
    look: Sighting | Look | None
    lost: Sequence[LostItem]
    running: Sequence[str]
    left: Sequence[str]
    arm: str
    holds: str
    raised_at: str
    recorded: bool
    resumes: bool
    picture: str
    next: Sequence[str]
