"""Tracker of all items: record of the looks and of the actions of the robot, and answers to skills."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.config import LedgerConfig, TableConfig
from executive.cell.frame import Detections, Frame, FrameCaptured, Observation
from executive.cell.objects import Bin, Item, KnownItem, ObjectClass, Quotas, Target
from executive.cell.protocols import Presence, Routes
from executive.errors import Fault
from executive.events import Emit, ItemChanged
from executive.geometry import Array
from executive.ledger import outcomes
from executive.ledger.belief import make_viewpoint_key
from executive.ledger.bin_contents import BinContents, find_probable_bin
from executive.ledger.coverage import Coverage, Staleness
from executive.ledger.item import ON_TABLE, ItemRecord, ItemRecords, State
from executive.ledger.look import AMBIGUITY_FACTOR, LookUpdate, make_look_event
from executive.ledger.outcomes import Certainty
from executive.perception.evidence import (
    compute_weight_log_ratios,
    describe_weight,
    find_classes_distinct_by_touch,
)

BODY_LOOK_COUNT = 5
"""Number of looks after which an object of no item that was not detected again is forgotten. It is less than
the attempts of the library, so that an obstacle that is no longer there costs no object."""

MAX_BODY_WIDTH = 0.5
"""Maximum width of the box of an ignored object, as a fraction of the searched region's width; a wider box
shows the table or a tray, on which the objects lie."""

MIN_LOG_RATIO_OF_WEIGHT = math.log(0.01)
"""Minimum log likelihood ratio of a weight that agrees with a class, against objects of no declared class. At
the minimum, the class and an undeclared class (prior odds 0.01) are equally probable."""

MIN_LOOKS_WITHOUT_CLASS = 3
"""Minimum number of looks that show an item of no class before the table counts as searched."""


@dataclass(eq=False)
class Tracker:
    """Tracks each object from its first look to its final state; implements `Ledger` of the cell.

    A look is an image with its detections. The tracker owns the records of the items and emits each change of
    an item as an event. `Ledger` documents the methods in detail.

    Attributes:
        config: Thresholds of the ledger, from the cell file.
        table: The workspace.
        bins: Bins by name.
        classes: Classes of the cell by label.
        routes: Names of the permitted bins by class.
        quotas: Maximum numbers of objects in the bins.
        emit: Function that receives the events.
        ignored_labels: Labels that are not in the cell file, of objects that may lie on the table.
        unknown_labels: Other labels that are not in the cell file, each with its maximum number of boxes per
            frame.
        ignored_positions: Positions `(3,)` [m] of all detections with an ignored label so far.
        empty_load: Load of the empty tool before the last approach [N].
        assumption_reasons: Reasons why error rates of detectors were assumed, and not measured.
    """

    config: LedgerConfig
    table: TableConfig
    bins: Mapping[str, Bin]
    classes: Mapping[str, ObjectClass]
    routes: Routes
    quotas: Quotas
    emit: Emit
    ignored_labels: Collection[str] = ()

    def __post_init__(self) -> None:
        self.unknown_labels: Counter[str] = Counter()
        self.ignored_positions: list[Array] = []
        self._failed_picks: list[tuple[Item, Array]] = []
        """Item and position `(3,)` [m] of each failed attempt to pick; see `_count_attempts`."""
        self._bodies: list[tuple[Array, int]] = []
        """Objects of no item: position `(3,)` [m], and number of further looks until it is forgotten."""
        self._records = ItemRecords(self.emit)
        self._certainty = Certainty(self.config, find_classes_distinct_by_touch(self.classes))
        self._bin_contents = BinContents(self.config, self.bins, self.routes, self._records, self.quotas)
        self._coverage, self._staleness = Coverage(self.table), Staleness()
        self._last_frame_id = self._deferral_count = 0
        self._last_stamp = 0.0
        """Capture time of the last look [s]."""
        self.empty_load = 0.0
        self.assumption_reasons: list[str] = []

    def observe(self, detections: Detections, observations: Sequence[Observation]) -> Sequence[Target]:
        """Update all items with the detections in one frame, and return the targets."""
        frame = detections.frame
        labels = (detection.label for detection in detections.unknown)
        self.unknown_labels |= Counter(label for label in labels if label not in self.ignored_labels)
        ignored = [entry for entry in observations if entry.detection.label in self.ignored_labels]
        observations = [entry for entry in observations if entry not in ignored]
        # The text before the colon identifies a reason; the numbers after the colon differ between frames.
        reason = detections.error_rates.assumption_reason
        reason_start = reason.partition(":")[0]
        if reason and not any(known.startswith(reason_start) for known in self.assumption_reasons):
            self.assumption_reasons.append(reason)
        if frame.id != self._last_frame_id:
            self._last_frame_id, self._last_stamp = frame.id, frame.stamp
            self._update(detections, observations)
            for entry in ignored:
                self.ignored_positions.append(entry.position)
                left, _, right, _ = entry.detection.box
                is_object = right - left < MAX_BODY_WIDTH * (detections.area[2] - detections.area[0])
                if is_object and self._coverage.is_in_workspace(entry.position):
                    self._add_body(entry.position)
        self.emit(FrameCaptured(frame))
        self.emit(make_look_event(detections, observations))
        return self.find_targets()

    def update_presence(
        self, item: Item, detections: Detections, observations: Sequence[Observation]
    ) -> Presence:
        """Record whether an image shows an item at its place, and return its presence.

        The item is gone if the probability that all images so far missed the item by chance is at most
        `max_miss_probability`; its position then becomes unknown.
        """
        record, frame = self._records.find(item), detections.frame
        observations = [each for each in observations if each.detection.label not in self.ignored_labels]
        if record.state is State.PLACED:
            presence = self._bin_contents.find_presence(record, detections, observations)
            if presence is Presence.GONE:
                record.belief.add_miss(
                    detections.error_rates, make_viewpoint_key(detections),
                    was_detected_here=record.was_detected_in_bin,
                )  # fmt: skip
            elif presence is Presence.PRESENT:
                record.stamp, record.belief.miss_probability = frame.stamp, 1.0
                record.was_detected_in_bin = True
                record.clear_viewpoints()
        elif record.state not in ON_TABLE:
            return Presence.HIDDEN if record.state is State.HELD else Presence.GONE
        elif record.frame_id == frame.id:
            return Presence.PRESENT
        else:
            is_searched = detections.compute_searched_mask(record.position[None])[0]
            presence = Presence.GONE if is_searched else Presence.HIDDEN
        if presence is not Presence.GONE:
            return presence
        if not self._certainty.is_position_empty(record):
            return Presence.UNSURE
        self._forget_failed_picks(record)
        record.mark_as_taken_away(self.change_count)
        self._records.emit(record)
        return Presence.GONE

    def record_empty_load(self, load: float) -> None:
        """Record the load of the empty tool at rest [N]."""
        self.empty_load = load

    def record_touch(self, item: Item, contradiction: str = "", *, may_have_missed_top: bool = False) -> bool:
        """Record a touch, and return False if the touch contradicts the class of the item.

        A touch proves that the item exists. After a touch at the height of the class, other heights are no
        contradiction, because the item may have tipped over. The first touch that is too low is no
        contradiction if `may_have_missed_top` is True and the looks prove the class.
        """
        record = self._records.find(item)
        record.belief.is_confirmed, record.had_contact, record.empty_probe_count = True, True, 0
        if not contradiction:
            record.touched_label, record.low_touch_count = record.label, 0
        elif record.touched_label != record.label:
            if may_have_missed_top and self._certainty.register_low_touch(record):
                return True
            record.last_contradiction = contradiction
            self._invalidate_near(record.position, self.config.neighbourhood)
            self._records.emit(record)
            return False
        return True

    def record_weight(self, item: Item, weight: float, std: float) -> str:
        """Update the class of an item by its weight, and return "" or a contradiction."""
        record, classes = self._records.find(item), self.classes
        log_ratios = compute_weight_log_ratios(weight, std, classes)
        label_map = {label: other.detected_label for label, other in classes.items()}
        record.belief.add_weighing(log_ratios, label_map)
        contradiction = ""
        if not self._is_class_certain_by_weight(record):
            contradiction = record.last_contradiction = describe_weight(weight, record.label, classes)
        self._records.emit(record)
        return contradiction

    def record_failed_pick(self, item: Item, *, found_table: bool = False) -> None:
        """Record a failed attempt to pick an item, which may have moved any object.

        `found_table` is True if the descent to the item touched nothing above the table.
        """
        record = self._records.find(item)
        self._count_failed_pick(record)
        record.empty_probe_count += found_table
        self.invalidate_positions()
        self._records.emit(record)

    def record_grasp(self, item: Item) -> None:
        """Record that the tool holds an item, and that the grasp may have moved neighbouring objects.

        Raises:
            Fault: According to the ledger, the tool still holds another item.
        """
        if (held_item := self.find_held_item()) not in (None, item):
            raise Fault(
                f"the tool cannot hold {item}: it holds {held_item}; the skill that released {held_item} "
                "must call record_placement, record_drop or record_put_down of the ledger"
            )
        record = self._records.find(item)
        self._records.change_state(record, State.HELD)
        record.belief.is_confirmed, record.was_taken_away = True, False
        self._invalidate_near(record.position, self.config.neighbourhood)

    def record_drop(self, item: Item, landing: Array | None = None) -> None:
        """Record that the tool lost an item; `landing` is the predicted landing position `(3,)` [m]."""
        record = self._records.find(item)
        record.was_taken_away = False
        self._records.change_state(record, State.DROPPED)
        self._bin_contents.set_prior_log_odds(record, landing)
        self._count_failed_pick(record)
        record.drop_count += 1
        record.change_count = self.change_count
        self.invalidate_positions()

    def record_placement(self, item: Item, bin: str) -> None:
        """Record that an item was released in a bin."""
        record = self._records.find(item)
        if record.state is State.HELD:
            record.reason, record.slot = "", self._bin_contents.find_next_slot_index(bin)
            self._forget_failed_picks(record)
        # If the item later leaves the bin, an object seen before this time is not taken for the item.
        record.stamp, record.belief.miss_probability = self._last_stamp, 1.0
        record.clear_viewpoints()
        record.was_detected_in_bin = False
        self._records.set_placed(record, bin)

    def record_put_down(self, item: Item, position: Array) -> None:
        """Record that an item was put down at `position` `(3,)` [m]; a look must confirm the position."""
        record = self._records.find(item)
        record.update_position(position, self.config.gate, is_unmoved=False)
        record.change_count = self.change_count
        self._records.change_state(record, State.REJECTED if record.reason else State.SEEN)
        self.invalidate_positions()

    def reject(self, item: Item, reason: str) -> None:
        """Reject an item, so that no skill selects the item again.

        A held item stays HELD until its release; a dropped item stays DROPPED until its next detection.
        """
        self._records.reject(self._records.find(item), reason)

    def defer(self, item: Item) -> None:
        """Defer an item: the item stays open, and skills select it after all others."""
        record = self._records.find(item)
        self._deferral_count += 1
        record.deferral_rank = self._deferral_count
        record.deferral_count += 1

    def invalidate_positions(self) -> None:
        """Record that any object on the table may have been moved."""
        self._invalidate_near(np.zeros(3), math.inf)

    def record_collision(self, point: Sequence[float] | None) -> None:
        """Record a collision of the arm at `point` `(x, y, z)` [m], or at an unknown point."""
        self.invalidate_positions()
        if point is not None:
            self._add_body(np.array(point))

    def set_final_states(self, *, completed: bool) -> None:
        """Set the final state of each item; `completed` is True if the behaviour tree succeeded."""
        has_touched_item = any(record.touched_label for record in self.records)
        dropped_items = [
            record for record in self._records.filter_by_state(State.DROPPED) if not record.was_taken_away
        ]
        for record in self.records:
            self._settle_undeclared(record)
            final_state = outcomes.find_final_state(
                record, self._certainty, skip_reason=self._explain_skipped_item(record),
                is_completed=completed, has_touched_item=has_touched_item,
            )  # fmt: skip
            if bin := find_probable_bin(record):
                record.bin, final_state = bin, (State.PLACED, "it probably fell into the bin")
            if final_state is not None:
                record.set_state(*final_state)
                self._records.emit(record)
        self._records.emit(*outcomes.discard_moved_items(self.records, dropped_items))

    def discard_rejected_and_skipped(self) -> None:
        """Discard all rejected and skipped items; the next look adds a new item for each visible object."""
        self._failed_picks.clear()
        for record in self._records.filter_by_state(State.REJECTED, State.SKIPPED):
            record.set_state(State.PHANTOM, "the run was resumed; the next look adds the object again")
            self._records.emit(record)

    def count_states(self) -> dict[str, int]:
        """Return the number of items by final state; the key `seen` counts all items except phantoms."""
        counts = Counter(record.state for record in self._records)
        totals = {state.value: counts[state] for state in (*outcomes.FINAL_STATES, State.PHANTOM)}
        return {"seen": counts.total() - counts[State.PHANTOM], **totals}

    def list_items(self) -> Sequence[ItemChanged]:
        """Return the current state of each item, in the order of the first detection."""
        return [record.event for record in self.records]

    @property
    def records(self) -> Sequence[ItemRecord]:
        """All items, in the order of the first detection."""
        return list(self._records)

    @property
    def change_count(self) -> int:
        """Number of actions of the robot so far that may have moved objects on the table."""
        return self._staleness.change_count

    def find_targets(self) -> Sequence[Target]:
        """Return a target for each open item of a class that cannot have moved since its last detection."""
        unmoved_items = filter(self._staleness.is_unmoved, self._records.filter_by_state(State.SEEN))
        return [record.target for record in unmoved_items if record.label not in self.unknown_labels]

    def find_objects_on_table(self) -> Sequence[Target]:
        """Return all items that are probably on the table, and what else is known to be there."""
        items = [record for record in self._records.filter_by_state(*ON_TABLE) if record.belief.is_probable]
        targets = [item.target for item in items if not self._certainty.is_position_empty(item)]
        for position, _ in reversed(self._bodies):
            if self._is_separate(position, targets):
                targets.append(Target("an object of no item", "", position, 0.0, 0, 0, 0.0))
        return targets

    def find_uncertain_items(self) -> Sequence[Item]:
        """Return the unsorted items in the workspace that are uncertain, or that may have been moved."""
        possible_items = [record for record in self.records if self._certainty.may_be_on_table(record)]
        workspace_items = [item for item in possible_items if self._coverage.is_in_workspace(item.position)]
        unmoved_items = [record for record in workspace_items if self._staleness.is_unmoved(record)]
        certain_items = [record for record in unmoved_items if self._certainty.is_certain(record)]
        return [record.item for record in workspace_items if record not in certain_items]

    def find_held_item(self) -> Item | None:
        """Return the item in the tool, or None."""
        return next((record.item for record in self._records.filter_by_state(State.HELD)), None)

    def is_current(self, frame: Frame) -> bool:
        """Return False if an action since the capture of a frame may have moved any object on the table."""
        return self._staleness.is_table_unchanged(frame.change_count)

    def is_fresh(self, target: Target) -> bool:
        """Return False if the robot may have moved a target since its last detection."""
        return self._staleness.is_unchanged(target.position, target.change_count)

    def is_certain(self, item: Item) -> bool:
        """Return True if the existence, class and position of an item are certain enough to sort the item."""
        return self._certainty.is_certain(self._records.find(item))

    def is_height_confirmed(self, label: str) -> bool:
        """Return True if the tool has touched an object of a class at the height of the class."""
        return any(record.touched_label == label for record in self.records)

    def is_table_empty(self, label: str | None = None, ignored_items: Collection[Item] = ()) -> bool:
        """Return True if almost certainly no object that the mission still sorts is visible on the table.

        `label` restricts the check to objects of one class; None: all classes with a route. The objects in
        `ignored_items` may be on the table.
        """
        routed_labels = [routed_label for routed_label in self.routes if label in (None, routed_label)]
        labels = {entry for entry in routed_labels if not self._bin_contents.explain_skipped_class(entry)}
        if routed_labels and not labels:
            return True
        if self._coverage.max_object_probability > self.config.max_miss_probability:
            return False
        records = (record for record in self.records if record.item not in ignored_items)
        possible_items = [record for record in records if self._certainty.may_be_on_table(record)]
        visible_items = [record for record in possible_items if self._coverage.is_visible(record.position)]
        # An item without enough confident detections counts as an object of every class.
        return not any(
            labels.intersection(self.list_possible_labels(record.item)) or self._needs_look(record)
            for record in visible_items
        )

    def get_label(self, item: Item) -> str:
        """Return the most probable class of an item."""
        return self._records.find(item).label

    def list_possible_labels(self, item: Item) -> Sequence[str]:
        """Return the classes of an item that a weighing may find, the most probable class first."""
        record = self._records.find(item)
        if self._is_class_certain_by_weight(record):
            return [record.label]
        detected_label = record.detected_label
        similar_classes = (other for other in self.classes.values() if other.detected_label == detected_label)
        return [record.label, *(other.label for other in similar_classes if other.label != record.label)]

    def describe(self, item: Item) -> KnownItem:
        """Return the present knowledge about an item."""
        record = self._records.find(item)
        is_skipped = bool(self._explain_skipped_item(record))
        return record.make_known_item(is_skipped=is_skipped, attempts=self._count_attempts(record))

    def list_known_items(self) -> Sequence[KnownItem]:
        """Return all items that exist with a probability of at least 0.5, in the order of detection."""
        records = (record for record in self._records if record.state is not State.PHANTOM)
        return [self.describe(record.item) for record in records if record.belief.is_probable]

    def count_objects_in(self, bin: str, label: str | None = None) -> int:
        """Return the number of objects in a bin; `label` restricts the count to one class."""
        return self._bin_contents.count_objects_in(bin, label)

    def count_items(self, state: str, label: str | None = None, bin: str | None = None) -> int:
        """Return the number of items in a state; `label` and `bin` restrict it to one class and bin."""
        items = (self.describe(record.item) for record in self._records)
        return sum(
            item.state == state and label in (None, item.label) and bin in (None, item.bin) for item in items
        )

    def find_next_slot_index(self, bin: str) -> int:
        """Return the index of the next free slot of a bin."""
        return self._bin_contents.find_next_slot_index(bin)

    def explain_skipped_class(self, label: str) -> str:
        """Return the reason why the mission does not sort further objects of a class, or ""."""
        return self._bin_contents.explain_skipped_class(label)

    def _update(self, detections: Detections, observations: Sequence[Observation]) -> None:
        """Update the items on the table and the dropped items with the observations of a look."""
        bias_std = detections.error_rates.bias
        self._bodies = [(position, count - 1) for position, count in self._bodies if count > 1]
        entries = self._omit_redundant_observations(observations)
        bin_names = {entry: self._bin_contents.find_bin_name(entry, bias_std) for entry in entries}
        observations_on_table = [entry for entry, bin_name in bin_names.items() if bin_name is None]
        update = LookUpdate(self._certainty, self._records, self._coverage, self._staleness, detections)
        for record in update.apply(observations_on_table):
            self._certainty.reject_if_uncertain(record, is_unmoved=self._staleness.is_unmoved(record))
            self._records.emit(record)
        if detections.view == "full":
            self._bin_contents.confirm_placed_items(detections, observations)
            self._bin_contents.mark_dropped_items_as_placed(detections, bin_names)

    def _count_failed_pick(self, record: ItemRecord) -> None:
        """Count a failed attempt to pick an item, for the item and for its position."""
        record.failed_pick_count += 1
        self._failed_picks.append((record.item, record.position))

    def _forget_failed_picks(self, record: ItemRecord) -> None:
        """Forget the failed attempts at the position of an item that left the position."""
        picks = self._failed_picks
        self._failed_picks = [pick for pick in picks if record.distance_to(pick[1]) > self.config.gate]

    def _add_body(self, position: Array) -> None:
        """Record an object of no item at `position` `(3,)` [m], unless an item or a bin is there."""
        if self._is_separate(position, [target for target in self.find_objects_on_table() if target.label]):
            self._bodies.append((position, BODY_LOOK_COUNT))

    def _omit_redundant_observations(self, observations: Sequence[Observation]) -> list[Observation]:
        """Return the observations without those of undeclared labels that show no further object to sort.

        Such an observation is near another observation or a known object, or it is outside of the workspace.
        """
        kept = [entry for entry in observations if entry.detection.label not in self.unknown_labels]
        targets = [
            each for each in self.find_objects_on_table() if each.label not in ("", *self.unknown_labels)
        ]
        for entry in (entry for entry in observations if entry not in kept):
            is_separate = self._is_separate(entry.position, (*targets, *kept))
            if is_separate and self._coverage.is_in_workspace(entry.position):
                kept.append(entry)
        return kept

    def _settle_undeclared(self, record: ItemRecord) -> None:
        """Reject an item of no class at the end of the run; discard it if it is not on the table any more."""
        if record.label not in self.unknown_labels or record.state not in (*ON_TABLE, State.DROPPED):
            return
        if record.state is State.DROPPED or self._certainty.is_position_empty(record):
            record.set_state(State.PHANTOM, "it is not on the table any more")
        else:
            record.set_state(State.REJECTED, self._explain_skipped_item(record))
        self._records.emit(record)

    def _invalidate_near(self, centre: Array, radius: float) -> None:
        """Record that any object within `radius` [m] of `centre` `(3,)` [m] may have been moved."""
        self._staleness.record_change(centre, radius)
        self._coverage.reset_near(centre, radius, self.change_count)

    def _count_attempts(self, record: ItemRecord) -> int:
        """Return the number of failed attempts to pick an item, or to pick another item at its position.

        Two objects of a class may exchange their items if looks miss one of them.
        """
        others = [position for item, position in self._failed_picks if item != record.item]
        return record.failed_pick_count + sum(record.distance_to(each) <= self.config.gate for each in others)

    def _is_separate(self, position: Array, targets: Collection[Target | Observation]) -> bool:
        """Return True if `position` `(3,)` [m] is neither in a bin nor at one of `targets`.

        Positions higher than the tallest class above the centre of a target show another, taller object.
        """
        margin = max([AMBIGUITY_FACTOR * self.config.gate, *(each.radius for each in self.classes.values())])
        is_in_bin = any(bin.contains(position, margin) for bin in self.bins.values())
        height = max((each.height for each in self.classes.values()), default=math.inf)
        near = [each for each in targets if math.dist(position[:2], each.position[:2]) <= margin]
        return not is_in_bin and all(position[2] > each.position[2] + height for each in near)

    def _needs_look(self, record: ItemRecord) -> bool:
        """Return True if too few looks showed an item; no touch proves an item of no class."""
        if record.label not in self.unknown_labels:
            return not record.belief.look_count
        return record.belief.look_count < MIN_LOOKS_WITHOUT_CLASS or record.belief.miss_probability < 1.0

    def _explain_skipped_item(self, record: ItemRecord) -> str:
        """Return the reason why the mission sorts none of the possible classes of an item, or ""."""
        if record.label in self.unknown_labels:
            return f'the cell has no class "{record.label}"; see `class_map` and `unknown` of the cell file'
        labels = self.list_possible_labels(record.item)
        reasons = [self._bin_contents.explain_skipped_class(label) for label in labels]
        return reasons[0] if all(reasons) else ""

    def _is_class_certain_by_weight(self, record: ItemRecord) -> bool:
        """Return True if the class of an item is certain according to its last weighing."""
        belief = record.belief
        fits = belief.weight_log_ratios.get(belief.label, -math.inf) >= MIN_LOG_RATIO_OF_WEIGHT
        return fits and belief.class_error <= self.config.max_class_error
