"""Record of one item: its position, its state, and the evidence about it."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from executive.cell.detection import Observation
from executive.cell.frame import Frame
from executive.cell.objects import Target
from executive.cell.plain import round_values
from executive.events import ItemChanged
from executive.geometry import Array
from executive.ledger.belief import Belief

SAME_POSITION_TOLERANCE = 0.01
"""Maximum distance between two measurements of the same position [m]."""
REASON_NOT_FOUND = "more looks missed it than saw it"
"""Reason of a phantom that looks have missed."""
REASON_UNTRACKED = "its place is unknown: the journal lacks actions of the tool, and no look showed it since"
"""Reason of the rejection of an item that the tool may have moved while nothing was recorded."""
REASON_UNCERTAIN = "no look is sure of it"
"""Reason of the rejection of an item with low-confidence detections only."""


class State(Enum):
    """State of an item; the last four are final."""

    SEEN = "seen"
    """The item lies on the table and is not sorted yet."""
    HELD = "held"
    """The tool holds the item."""
    DROPPED = "dropped"
    """The tool lost the item, and no look has found it again. With a reason, the next look that finds it
    rejects it."""
    PLACED = "placed"
    """The item was released in a bin."""
    REJECTED = "rejected"
    """The item stays on the table because the mission had to sort it and could not."""
    SKIPPED = "skipped"
    """The item stays on the table because the mission did not have to sort it."""
    LOST = "lost"
    """The item exists, and no look finds it."""
    PHANTOM = "phantom"
    """The item does not exist, or is another item of the ledger."""


LYING = (State.SEEN, State.REJECTED)
"""States of an item that lies at the position of its last detection."""


@dataclass(eq=False)
class Record:
    """Record of one item.

    Attributes:
        item: Name, unique in the run.
        belief: Existence and class.
        first_position: Position before the first possible move of the item `(3,)` [m].
        first_epoch: Number of changes of the table at the first detection.
        first_stamp: Time of the first detection [s].
        has_appeared: True if looks had found its position empty before the first detection.
        position: Mean of the measured positions since the last possible move `(3,)` [m].
        std: Standard error of `position` along each axis [m].
        bias: Standard deviation of the systematic error of `position` along each axis [m].
        was_moved: True if the item was detected after a possible move.
        epoch: Number of changes of the table at the last detection.
        frame: Id of the frame of the last detection.
        stamp: Time of the last detection [s].
        confidence: Confidence of the last detection, 0 to 1.
        state: State.
        bin: Bin that contains the item, or "".
        reason: Reason of the state, or "".
        attempts: Number of failed attempts to pick the item.
        empty_probes: Number of probes that found only the table there, since its last move or touch.
        had_contact: True if the tool has touched the item, at any height.
        touched_label: Class at whose height the tool has last touched the item, or "".
        low_touches: Number of touches below the height of its class since the last touch at this height.
        contradictions: Number of looks with evidence against its class, since the last possible move.
        contradiction: Last evidence against its class besides the detector's score, or "".
        bin_log_odds: Log odds, by bin, that the dropped item lies in the bin.
        is_untracked: True if the tool may have moved the item while nothing was recorded.
    """

    item: str
    belief: Belief
    first_position: Array
    first_epoch: int
    first_stamp: float
    has_appeared: bool
    position: Array = field(init=False)
    std: float = math.inf
    bias: float = 0.0
    was_moved: bool = False
    epoch: int = 0
    frame: int = 0
    stamp: float = 0.0
    confidence: float = 0.0
    state: State = State.SEEN
    bin: str = ""
    reason: str = ""
    attempts: int = 0
    empty_probes: int = 0
    had_contact: bool = False
    touched_label: str = ""
    low_touches: int = 0
    contradictions: int = 0
    contradiction: str = ""
    bin_log_odds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    is_untracked: bool = False

    def __post_init__(self) -> None:
        self.position = self.first_position

    @property
    def label(self) -> str:
        """Most probable class."""
        return self.belief.label

    @property
    def target(self) -> Target:
        """The item on the table as skills see it."""
        return Target(
            self.item, self.label, self.position, self.confidence, self.frame, self.epoch, self.stamp
        )

    @property
    def summary(self) -> ItemChanged:
        """The item as an event, its position rounded to 0.1 mm."""
        return ItemChanged(
            self.item, self.label, self.state.value, round_values(self.position, 4),
            self.belief.looks, self.attempts, self.bin, self.reason,
        )  # fmt: skip

    def distance_to(self, position: Array) -> float:
        """Return the distance [m] between the item and a position `(3,)` [m]."""
        return float(np.linalg.norm(self.position - position))

    def set_state(self, state: State, reason: str) -> None:
        """Set the state and its reason."""
        self.state, self.reason = state, reason

    def forget_answers(self) -> None:
        """Forget the answers of earlier looks: after a possible move, later errors are independent."""
        self.belief.answers.clear()
        self.belief.repeats = self.contradictions = 0

    def locate(self, position: Array, std: float, *, is_settled: bool) -> None:
        """Update the position with a measurement.

        The measurement is averaged with earlier ones if the item is settled, and replaces them otherwise.

        Args:
            position: Measured position `(3,)` [m].
            std: Standard deviation of its random error along each axis [m].
            is_settled: True if nothing may have moved the item since its last detection.
        """
        if self.distance_to(position) > SAME_POSITION_TOLERANCE:
            self.empty_probes = 0
        if is_settled and math.isfinite(self.std):
            old, new = self.std**-2, std**-2
            self.position = np.asarray((self.position * old + position * new) / (old + new))
            self.std = (old + new) ** -0.5
        else:
            self.was_moved = math.isfinite(self.std)
            self.position, self.std = position, std
        if not self.was_moved:
            self.first_position = self.position
        self.belief.miss_probability = 1.0

    def observe(self, observation: Observation, frame: Frame, bias: float, *, is_settled: bool) -> None:
        """Update the position with an observation, and record the frame of the last detection.

        `bias` is the systematic error of the detector's positions [m]; `is_settled` is as in `locate`.
        """
        self.locate(observation.position, observation.std, is_settled=is_settled)
        self.bias, self.confidence = bias, observation.detection.confidence
        self.epoch, self.frame, self.stamp = frame.epoch, frame.id, frame.stamp

    def merge(self, found: Record) -> None:
        """Add the evidence of `found`, a new item that is this item after a move."""
        self.belief.merge(found.belief)
        self.empty_probes = 0
        self.position, self.std, self.epoch = found.position, found.std, found.epoch
        self.frame, self.stamp, self.confidence = found.frame, found.stamp, found.confidence
        # `first_position` remains the position before the fall or the push.
        self.was_moved = True
        if self.state is State.PHANTOM:
            self.belief.log_odds, self.reason = found.belief.log_odds, ""
        if self.state in (State.DROPPED, State.PHANTOM):
            self.state = State.REJECTED if self.reason else State.SEEN
