"""Tracker of all items: record of the looks and of the actions of the robot."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from executive.cell.detection import Detections, Observation
from executive.cell.frame import FrameCaptured
from executive.cell.ledger import Presence
from executive.cell.objects import Item, Target
from executive.errors import Fault
from executive.events import ItemChanged
from executive.geometry import Array
from executive.ledger import outcomes
from executive.ledger.belief import make_viewpoint_key
from executive.ledger.bin_contents import BinRecovery, find_probable_bin
from executive.ledger.item import ON_TABLE, ItemRecord, State
from executive.ledger.look import LookUpdate, make_look_event
from executive.ledger.queries import LedgerQueries
from executive.perception.evidence import compute_weight_log_ratios, describe_weight

BODY_LOOK_COUNT = 5
"""Number of looks after which an object of no item that was not detected again is forgotten. It is less than
the attempts of the library, so that an obstacle that is no longer there costs no object."""

MAX_BODY_WIDTH = 0.5
"""Maximum width of the box of an ignored object, as a fraction of the searched region's width; a wider box
shows the table or a tray, on which the objects lie."""


class Tracker(LedgerQueries):
    """Tracks each object from its first look to its final state; implements `executive.cell.ledger.Ledger`.

    A look is an image with its detections. The tracker owns the records of the items and emits each change of
    an item as an event. `Ledger` documents the methods in detail.

    Attributes:
        empty_load: Load of the empty tool before the last approach [N].
        assumption_reasons: Reasons why error rates of detectors were assumed, and not measured.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        self._bin_recovery: BinRecovery | None = None
        """Recovery of the bin contents between `record_interruption` and `record_bin_contents`, or None."""
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
        record.is_untracked = record.was_taken_away = False
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

    def record_interruption(self) -> None:
        """Record an interruption of the run: the tool may have moved any item that is not in a bin."""
        self._bin_recovery = BinRecovery(self._bin_contents)
        for record in self._records.filter_by_state(State.HELD, State.DROPPED, State.SEEN):
            if record.state is not State.SEEN or record.belief.is_probable:
                record.change_count = self.change_count
                record.is_untracked = True
                record.was_taken_away = False
                record.bin_log_odds.clear()
                self._records.change_state(record, State.DROPPED)
        self.invalidate_positions()

    def record_bin_contents(self) -> None:
        """Record an item for each unknown object that a look after `record_interruption` showed in a bin."""
        recovery, self._bin_recovery = self._bin_recovery, None
        assert recovery is not None, "the contents of bins are recorded after `record_interruption`"
        recovery.record_bin_contents(self.change_count)

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
        if detections.view == "full" and self._bin_recovery is not None:
            self._bin_recovery.add_look(detections, bin_names)
        elif detections.view == "full":
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
