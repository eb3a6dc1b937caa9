"""Diagnosis of a run that did not succeed: cause, measured values and advice."""

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
class FailureNode(DecidingNode):
    """Control node that did not handle a failure, or node in which the failure began (origin).

    Attributes:
        explanation: Reason why the node did not handle the failure; "" for the origin.
    """

    explanation: str


@dataclass(frozen=True)
class ItemFailure:
    """Last failure of a skill that worked on an item.

    Attributes:
        failure: Name of the failure: `Transit.dropped`.
        message: Message of the failure.
        clock: Time of the failure [s].
    """

    failure: str
    message: str
    clock: float


@dataclass(frozen=True)
class LostItem:
    """Item that was lost.

    Attributes:
        item: Name of the item.
        look: Last look (image with its detections) in which the item was detected, or None.
        later_looks: Number of looks after `look`.
        held_at, dropped_at: Times of the last pick and the last drop of the item [s], or None.
        last_failure: Last failure of a skill that worked on the item, or None.
    """

    item: str
    look: Sighting | None
    later_looks: int
    held_at: float | None
    dropped_at: float | None
    last_failure: ItemFailure | None


@dataclass(frozen=True)
class Diagnosis:
    """Explanation of a run that did not succeed.

    Attributes:
        status: `FAILURE`, `FAULT` or `HALTED`.
        reason: Name of the failure.
        clock: Robot time at the end of the run [s].
        mission: Path of the mission file.
        verdict: Cause of the end of the run, as a sentence.
        node: Node that determined the status, or None.
        item: Name of the item of `node`, else of a halted skill, else of the first lost item; "" for none.
        passed_nodes: Failure path: nodes that did not handle the failure, from the root down, and the origin.
        readings: Inputs that the failed skill read from the cell, the latest first.
        last_look: Last look with a detection of `item`, else the last look of the run; None without a look.
        lost_items: Items whose loss made the run fail.
        halted_skills: Names of the halted skills with their items: `Grasp of cube-1`.
        unsorted_items: Names of the unsorted items whose class has a bin.
        arm_state: `at rest`, or a text about the state of the arm.
        held_item: Item that the tool holds, `something` for an unknown object, or "".
        raised_at: File, line and function in which the exception of a fault was raised, or "".
        is_recorded: True if the journal contains the whole run.
        can_resume: True if the run can be resumed.
        picture: File of the picture of the failure, relative to the run directory, or "".
        advice: Sentences with advice, the most urgent first.
    """

    status: str
    reason: str
    clock: float
    mission: str
    verdict: str
    node: DecidingNode | None
    item: str
    passed_nodes: Sequence[FailureNode]
    readings: Sequence[Reading]
    last_look: Sighting | Look | None
    lost_items: Sequence[LostItem]
    halted_skills: Sequence[str]
    unsorted_items: Sequence[str]
    arm_state: str
    held_item: str
    raised_at: str
    is_recorded: bool
    can_resume: bool
    picture: str
    advice: Sequence[str]
