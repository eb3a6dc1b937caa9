"""Records of the items: position, state and evidence of each item; each change is emitted as an event."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from executive.cell.frame import Frame, Observation
from executive.cell.json_values import round_values
from executive.cell.objects import Item, Target
from executive.errors import Fault
from executive.events import Emit, ItemChanged
from executive.geometry import Array, HeldPose, Yaw
from executive.ledger.belief import Belief

SAME_POSITION_TOLERANCE = 0.01
"""Maximum distance between two measurements of the same position [m]."""
MAX_YAW_STDS = 4.0
"""Maximum difference between a measured yaw and the mean of an unmoved item, in its standard deviations."""
REASON_NOT_FOUND = "more looks missed it than saw it"
"""Reason of the state PHANTOM of an item whose position was empty in most looks."""
REASON_UNCERTAIN = "it has no confident detection"
"""Reason for the rejection of an item with doubtful detections only."""

MAX_REJECTIONS = 3
"""Number of rejections of an item after which a look at another place no longer opens it again."""
MIN_REMOVAL_PROBABILITY = 0.05
"""Minimum probability of a removal (`Belief.removal_probability`) with which the result names a phantom. In
62 runs of five shipped missions without a removal, no item was a phantom."""


class State(Enum):
    """State of an item; the final states are PLACED, REJECTED, SKIPPED, LOST and PHANTOM."""

    SEEN = "seen"
    """The item lies on the table and is not sorted yet."""
    HELD = "held"
    """The tool holds the item."""
    DROPPED = "dropped"
    """The position is unknown: the tool lost the item, or images showed its place empty. The next detection
    on the table sets the state to SEEN; if the item was rejected before (`reason` is set), to REJECTED."""
    PLACED = "placed"
    """The item was released in a bin."""
    REJECTED = "rejected"
    """The item stays on the table because the mission had to sort it and could not."""
    SKIPPED = "skipped"
    """The item stays on the table because the mission did not have to sort it."""
    LOST = "lost"
    """Final state of an item that existed, and whose position was unknown or empty at the end of the run."""
    PHANTOM = "phantom"
    """The item does not exist, or is the same object as another item of the ledger."""


ON_TABLE = (State.SEEN, State.REJECTED)
"""States, during the run, of an item on the table at the position of its last detection."""


@dataclass(eq=False)
class ItemRecord:
    """Record of one item.

    A look is an image with its detections. A change of the table is an action of the robot that may have
    moved objects (`Ledger.change_count` is the number of changes so far).

    Attributes:
        item: Name of the item, unique in the run.
        belief: Posterior of existence and class.
        first_position: Position before the first possible move of the item `(3,)` [m].
        first_change_count: Number of changes of the table before the first detection.
        first_stamp: Capture time of the first detection [s].
        was_place_empty: True if earlier looks showed the position of the first detection empty.
        was_place_searched: True if an earlier look searched the position of the first detection.
        position: Mean of the positions measured since the last possible move of the item `(3,)` [m].
        standard_error: Standard error of `position` along each axis [m].
        bias_std: Standard deviation of the systematic error of `position` along each axis [m].
        was_detected_after_move: True if the item was detected after a possible move.
        change_count: Number of changes of the table before the last detection.
        frame_id: Number of the frame of the last detection.
        stamp: Capture time of the last image that showed the item, or of the last image before its placement
            [s].
        confidence: Confidence of the last detection, 0 to 1.
        yaw: Mean of the angles measured since the last possible move of the item; None if it is unknown.
        yaw_weight: Sum of the inverse variances of these angles [1/rad²].
        held_pose: Place relative to the tool at the last grasp; None if the yaw is unknown.
        state: State of the item.
        bin: Name of the bin that contains the item, or "".
        reason: Reason of the state, or "".
        failed_pick_count: Number of failed attempts to pick the item.
        drop_count: Number of times that the tool dropped the item.
        empty_probe_count: Number of descents that found only the table, since the item was moved or touched.
        had_contact: True if the tool has touched the item at any height.
        confirmed_label: Class that the last measurement of the tool confirmed, or "".
        doubtful_measurement_count: Number of measurements that may be wrong, since the last confirmed class.
        contradiction_count: Number of images that contradict the class since the last possible move.
        last_contradiction: Last evidence of an image, measurement or weight against the class, or "".
        bin_log_odds: For each bin, log odds that the dropped item lies in the bin.
        deferral_count: Number of times that the item was deferred.
        deferral_rank: Rank among the deferred items; 0 if the item is not deferred.
        was_taken_away: True if images showed the place of the item empty, because a person removed it.
        was_detected_in_bin: True if a look has shown the placed item in its bin.
        slot: Index of the slot of the bin over which the item was released, or None.
        has_appeared: True if a look, since the robot last may have moved objects to the position of the first
            detection, searched this position before the first detection.
        rejection_count: Number of times that the mission rejected the item.
        common_frame_counts: For each near item, number of times that a frame showed both items separately.
    """

    item: str
    belief: Belief
    first_position: Array
    first_change_count: int
    first_stamp: float
    was_place_empty: bool = False
    was_place_searched: bool = False
    position: Array = field(init=False)
    standard_error: float = math.inf
    bias_std: float = 0.0
    was_detected_after_move: bool = False
    change_count: int = 0
    frame_id: int = 0
    stamp: float = 0.0
    confidence: float = 0.0
    yaw: Yaw | None = None
    yaw_weight: float = 0.0
    held_pose: HeldPose | None = None
    state: State = State.SEEN
    bin: str = ""
    reason: str = ""
    failed_pick_count: int = 0
    drop_count: int = 0
    empty_probe_count: int = 0
    had_contact: bool = False
    confirmed_label: str = ""
    doubtful_measurement_count: int = 0
    contradiction_count: int = 0
    last_contradiction: str = ""
    bin_log_odds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    deferral_count: int = 0
    deferral_rank: int = 0
    was_taken_away: bool = False
    was_detected_in_bin: bool = False
    slot: int | None = None
    has_appeared: bool = False
    rejection_count: int = 0
    common_frame_counts: Counter[Item] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.position = self.first_position

    @property
    def label(self) -> str:
        """Most probable class."""
        return self.belief.label

    @property
    def detected_label(self) -> str:
        """Class that the detectors report for an object of the class `label`."""
        return self.belief.detected_label

    @property
    def target(self) -> Target:
        """The item as the target that skills receive."""
        return Target(
            self.item, self.label, self.position, self.confidence, self.frame_id, self.change_count,
            self.stamp, self.yaw,
        )  # fmt: skip

    @property
    def event(self) -> ItemChanged:
        """Event with the current state of the item, and with the position rounded to 0.1 mm."""
        return ItemChanged(
            self.item, self.label, self.state.value, round_values(self.position, 4),
            self.belief.look_count, self.failed_pick_count, self.bin, self.reason,
        )  # fmt: skip

    @property
    def may_have_left(self) -> bool:
        """True if looks showed the item and then missed it, and it is uncertain whether it ever existed."""
        is_missed = self.state is State.PHANTOM and self.reason == REASON_NOT_FOUND
        return is_missed and self.belief.removal_probability >= MIN_REMOVAL_PROBABILITY

    def describe_disappearance(self) -> str:
        """Return a sentence on an item that looks showed and then missed."""
        place = f"({self.position[0]:.2f}, {self.position[1]:.2f}) m"
        shown = f"{self.belief.look_count} look(s) showed {self.item} at {place}"
        return f"{shown}, and later looks missed it: it was taken away, or detected by mistake"

    @property
    def known_state(self) -> str:
        """State for skills (`KnownItem.state`) of an item that the mission sorts."""
        if self.state is State.DROPPED:
            return State.REJECTED.value if self.reason else State.LOST.value
        if self.state is State.SEEN:
            return "deferred" if self.deferral_rank else "open"
        return self.state.value

    def distance_to(self, position: Array) -> float:
        """Return the distance [m] of the item from a position `(3,)` [m]."""
        return float(np.linalg.norm(self.position - position))

    def set_state(self, state: State, reason: str) -> None:
        """Set the state and its reason."""
        self.state = state
        self.reason = reason

    def mark_as_taken_away(self, change_count: int) -> None:
        """Set the item to DROPPED, because looks showed that it left its place on the table or in a bin."""
        if self.state is State.PLACED:
            self.bin = ""
            self.reason = ""
            self.slot = None
        self.state = State.DROPPED
        self.was_taken_away = True
        self.change_count = change_count
        self.bin_log_odds.clear()
        self.belief.miss_probability = 1.0
        self.clear_viewpoints()

    def clear_viewpoints(self) -> None:
        """Clear the looks by viewpoint, and the counts of repeats and contradictions, which are obsolete."""
        self.belief.last_label_by_viewpoint.clear()
        self.belief.miss_count_by_viewpoint.clear()
        self.belief.repeat_count = 0
        self.contradiction_count = 0

    def update_position(self, position: Array, std: float, *, is_unmoved: bool) -> None:
        """Set the position to a measurement or, if the item is unmoved, to the weighted mean of positions.

        Args:
            position: Measured position `(3,)` [m].
            std: Standard deviation of the random error of the measurement along each axis [m].
            is_unmoved: True if the item cannot have moved since its last detection.
        """
        if self.distance_to(position) > SAME_POSITION_TOLERANCE:
            self.empty_probe_count = 0
        if is_unmoved and math.isfinite(self.standard_error):
            old_weight = self.standard_error**-2
            new_weight = std**-2
            weight = old_weight + new_weight
            self.position = np.asarray((self.position * old_weight + position * new_weight) / weight)
            self.standard_error = weight**-0.5
        else:
            self.was_detected_after_move = math.isfinite(self.standard_error)
            self.position = position
            self.standard_error = std
        if not self.was_detected_after_move:
            self.first_position = self.position
        self.belief.miss_probability = 1.0

    def store(self, observation: Observation, frame: Frame, bias_std: float, *, is_unmoved: bool) -> None:
        """Store an observation as the last detection of the item, and update the position.

        `bias_std` is the standard deviation of the systematic error along each axis [m]; `is_unmoved` is True
        if the item cannot have moved since its last detection.
        """
        self.update_position(observation.position, observation.std, is_unmoved=is_unmoved)
        self.bias_std = bias_std
        self.confidence = observation.detection.confidence
        self.change_count = frame.change_count
        self.frame_id = frame.id
        self.stamp = observation.stamp
        self._update_yaw(observation.yaw, is_unmoved=is_unmoved)

    def _update_yaw(self, yaw: Yaw | None, *, is_unmoved: bool) -> None:
        """Set the yaw to a measurement or, if the item is unmoved, to the weighted mean of yaws.

        A measurement that contradicts the mean replaces it. The mean is not more certain than the best look:
        outlines in images from one place have nearly the same errors (correlation 0.99 in rendered images).
        """
        mean = self.yaw
        if mean is not None and is_unmoved:
            if yaw is None:
                return
            difference = mean.compute_difference(yaw)
            if abs(difference) <= MAX_YAW_STDS * math.hypot(mean.std, yaw.std):
                self.yaw_weight += yaw.std**-2
                # The yaw with the lower symmetry tells which of the equal rotations is meant.
                start = mean.angle if mean.symmetry <= yaw.symmetry else yaw.angle - difference
                angle = start + difference * yaw.std**-2 / self.yaw_weight
                self.yaw = Yaw(angle, min(mean.std, yaw.std), min(mean.symmetry, yaw.symmetry))
                return
        self.yaw = yaw
        self.yaw_weight = yaw.std**-2 if yaw else 0.0

    def mark_as_detected_in_bin(self, frame: Frame) -> None:
        """Record that a frame shows the placed item in its bin."""
        self.stamp = frame.stamp
        self.was_detected_in_bin = True

    def merge(self, new_item: ItemRecord, max_class_error: float) -> None:
        """Add the evidence and the position of `new_item`, which is the same object after a move.

        If the class error of `new_item` is above `max_class_error`, only its own looks count for the class,
        because another object may have moved to its position; the failed attempts stay counted.
        """
        if new_item.belief.class_error <= max_class_error:
            self.belief.merge(new_item.belief)
        else:
            is_confirmed = self.belief.is_confirmed
            self.belief = new_item.belief
            self.belief.is_confirmed |= is_confirmed
            self.confirmed_label = ""
            self.doubtful_measurement_count = 0
        self.empty_probe_count = 0
        self.was_taken_away = False
        # `first_position` stays the position before the move.
        self.was_detected_after_move = True
        self.position = new_item.position
        self.standard_error = new_item.standard_error
        self.change_count = new_item.change_count
        self.frame_id = new_item.frame_id
        self.stamp = new_item.stamp
        self.confidence = new_item.confidence
        self.yaw = new_item.yaw
        self.yaw_weight = new_item.yaw_weight
        if self.state is State.PHANTOM:
            self.belief.log_odds = new_item.belief.log_odds
            is_hopeless = self.rejection_count >= MAX_REJECTIONS
            self.reason = f"it was rejected {self.rejection_count} times" if is_hopeless else ""
        if self.state in (State.DROPPED, State.PHANTOM):
            self.state = State.REJECTED if self.reason else State.SEEN


class ItemRecords:
    """Records of the items of a run, in the order of the first detection.

    Args:
        emit: Function that receives the events.

    Attributes:
        all: All records; adding or removing a record makes a new tuple.
        archived: Last states of the items that the ledger no longer tracks, by name.
        failed_picks: Item and position `(3,)` [m] of each failed attempt to pick; see `count_attempts`.
    """

    def __init__(self, emit: Emit) -> None:
        self.all: tuple[ItemRecord, ...] = ()
        self.archived: dict[Item, ItemChanged] = {}
        self.failed_picks: list[tuple[Item, Array]] = []
        self._archived_counts: Counter[tuple[str, str]] = Counter()
        self._emit = emit
        self._records: dict[Item, ItemRecord] = {}
        self._name_counts: Counter[str] = Counter()

    def find(self, item: Item) -> ItemRecord:
        """Return the record of an item, of an archived item a copy of its last state, which is in no bin.

        Raises:
            Fault: No item has this name.
        """
        if (last := self.archived.get(item)) is not None:
            return ItemRecord(
                item, Belief(last.label, math.inf), np.array(last.position), 0, 0.0,
                state=State(last.state), reason=last.reason, failed_pick_count=last.attempts,
            )  # fmt: skip
        if item not in self._records:
            known_items = ", ".join(self._records) or "none"
            raise Fault(f'the ledger knows no item "{item}"; it knows: {known_items}')
        return self._records[item]

    def filter_by_state(self, *states: State) -> list[ItemRecord]:
        """Return the records of all items in one of the given states."""
        return [record for record in self.all if record.state in states]

    def add(self, belief: Belief, position: Array, frame: Frame) -> ItemRecord:
        """Add an item with the name `<class>-<number>` and return its record.

        `position` `(3,)` [m] and `frame` are values of the first detection.
        """
        label = belief.first_label
        self._name_counts[label] += 1
        name = f"{label}-{self._name_counts[label]}"
        record = ItemRecord(name, belief, position, frame.change_count, frame.stamp)
        self._records[name] = record
        self.all = (*self.all, record)
        return record

    def remove(self, record: ItemRecord) -> None:
        """Remove an item that no event has reported yet."""
        del self._records[record.item]
        self.all = tuple(self._records.values())

    def archive(self, records: Sequence[ItemRecord]) -> None:
        """Keep only the last states of items that no longer change, which limits the memory of a long run."""
        for record in records:
            self.archived[record.item] = self._records.pop(record.item).event
            self._archived_counts[record.state.value, record.label] += 1
        self.all = tuple(self._records.values())
        self.failed_picks = [pick for pick in self.failed_picks if pick[0] in self._records]

    def count_archived(self, state: str, label: str | None = None) -> int:
        """Return the number of archived items in a state; `label` restricts the count to one class."""
        counts = self._archived_counts.items()
        return sum(count for key, count in counts if key[0] == state and label in (None, key[1]))

    def count_failed_pick(self, record: ItemRecord) -> None:
        """Count a failed attempt to pick an item."""
        record.failed_pick_count += 1
        self.failed_picks.append((record.item, record.position))

    def forget_failed_picks(self, record: ItemRecord, gate: float) -> None:
        """Forget the failed attempts within `gate` [m] of an item that left its position."""
        self.failed_picks = [pick for pick in self.failed_picks if record.distance_to(pick[1]) > gate]

    def count_attempts(self, record: ItemRecord, gate: float) -> int:
        """Return the number of failed attempts to pick an item, or another item within `gate` [m] of it.

        Two objects of a class may exchange their items if looks miss one of them.
        """
        others = [position for item, position in self.failed_picks if item != record.item]
        return record.failed_pick_count + sum(record.distance_to(each) <= gate for each in others)

    def emit(self, *records: ItemRecord) -> None:
        """Emit the current state of each given item as an event."""
        for record in records:
            self._emit(record.event)

    def change_state(self, record: ItemRecord, state: State) -> None:
        """Set the state of an item, and emit the item."""
        record.state = state
        self.emit(record)

    def set_placed(self, record: ItemRecord, bin_name: str) -> None:
        """Set the state of an item to PLACED in a bin, and emit the item."""
        record.bin = bin_name
        record.was_taken_away = False
        self.change_state(record, State.PLACED)
