"""Diagnosis of a run that did not succeed: causes with measured values, and advice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from executive.record.timeline.activation import Reading
from executive.record.timeline.items import Look, Sighting


@dataclass(frozen=True)
class DecidingNode:
    """Node that determined the status of a run.

    Attributes:
        path: Path of the node in the tree.
        name: Name of the node with its item or subtree: `Grasp of cube-1`, `look: retry`.
        place: File and line of the node.
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
        what: Name of the failure, which consists of skill and reason: `Transit.dropped`.
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
        look: Last look (image with its detections) in which the item was detected, or None.
        unseen: Number of looks after `look`.
        held, dropped: Last times at which the tool picked and dropped the item [s], or None.
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
        reason: Name of the failure.
        clock: Time of the end of the run [s].
        mission: The mission file.
        verdict: The cause in one sentence.
        node: Node that determined the status, or None.
        item: Item that this node worked on, or "".
        chain: Nodes that did not handle the failure, from the root on, and the origin of the failure.
        reads: Inputs that the failed skill read from the cell, the latest first.
        look: Last look in which the item was detected, or else the last look; None without a look.
        lost: Lost items.
        running: Names of the skills that were halted, with their items.
        left: Names of the items that the mission had to sort and did not sort.
        arm: `at rest`, or a text about the state of the arm.
        holds: Item that the tool holds, `something` for an unknown object, or "".
        raised_at: File, line and function in which the exception of a fault was raised, or "".
        recorded: True if the journal contains the whole run.
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
