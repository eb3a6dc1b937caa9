"""Tracker of all items: record of the looks and of the actions of the robot, and answers to skills."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.config import LedgerConfig, TableConfig
from executive.cell.frame import Detections, Frame, FrameCaptured, Observation, Region
from executive.cell.objects import Bin, Item, KnownItem, ObjectClass, Quotas, Target
from executive.cell.protocols import Presence, Routes
from executive.cell.tools import ToolMeasurement
from executive.errors import Fault
from executive.events import BinsEmptied, Emit, ItemChanged
from executive.geometry import Array
from executive.ledger.bin_contents import REASON_PROBABLY_FELL, BinContents, find_probable_bin
from executive.ledger.certainty import FINAL_STATES, MIN_LOG_RATIO_OF_WEIGHT, Certainty, discard_moved_items
from executive.ledger.coverage import Coverage
from executive.ledger.item import ON_TABLE, ItemRecord, ItemRecords, State
from executive.ledger.look import AMBIGUITY_FACTOR, LookUpdate, make_look_event
from executive.ledger.unexplained import Unexplained
from executive.perception import evidence

BODY_LOOK_COUNT = 5
"""Number of looks after which an object of no item that was not detected again is forgotten. It is less than
the attempts of the library, so that an obstacle that is no longer there costs no object."""
MAX_BODY_WIDTH = 0.5
"""Maximum width of the box of an ignored object, as a fraction of the searched region's width; a wider box
shows the table or a tray, on which the objects lie."""
MIN_FAILED_PICKS_OF_BROKEN_TOOL = 8
"""Number of failed picks, more than the attempts for one item, after which one must have succeeded."""
MIN_LOOKS_WITHOUT_CLASS = 3
"""Minimum number of looks that show an item of no class before the table counts as searched."""


@dataclass(eq=False)
class Tracker:
    """Tracks each object from its first look to its final state; implements `Ledger` of the cell.

    A look is an image with its detections. The tracker emits each change of an item as an event.

    Attributes:
        config: Thresholds of the ledger, from the cell file.
        table, bins, classes: The workspace, the bins by name, and the classes by label.
        routes: Names of the permitted bins by class.
        quotas: Maximum numbers of objects in the bins.
        emit: Function that receives the events.
        ignored_labels: Labels that are not in the cell file, of objects that may lie on the table.
        distinct_labels: Classes that a measurement of the tool distinguishes from all others.
        unknown_labels: Other labels that are not in the cell file, each with its maximum number of boxes per
            frame.
        ignored_positions: Positions `(3,)` [m] of all detections with an ignored label so far.
        empty_load: Last load of the empty tool, before an approach or after a release [N].
        false_grasp_count: Number of contradicted grasps since a load confirmed a grasp.
        unexplained: All that images or sensors show and no item explains.
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
    distinct_labels: Collection[str] = ()

    def __post_init__(self) -> None:
        self.unknown_labels: Counter[str] = Counter()
        self.ignored_positions: list[Array] = []
        self._bodies: list[tuple[Array, int]] = []
        """Objects of no item: position `(3,)` [m], and number of further looks until it is forgotten."""
        self._records = ItemRecords(self.emit)
        self._certainty = Certainty(self.config, self.distinct_labels)
        self._bin_contents = BinContents(
            self.config, self.bins, self.routes, self._records, self.quotas, self.classes
        )
        self._coverage = Coverage(self.table)
        self._confirmed_labels: set[str] = set()
        """Classes that a measurement of the tool has confirmed, and "" after other measurements."""
        self._deferral_count = 0
        self._last_frame_id = 0
        self._last_stamp = 0.0
        """Capture time of the last look [s]."""
        self.empty_load = 0.0
        self._last_weighing: tuple[ItemRecord, float, float] | None = None
        """Item whose class the last weighing determined, its weight and the error of the weight [N]."""
        self._load_cell_problem = ""
        """Weight of the last object whose class the looks prove, if the weight contradicts the class."""
        self._is_load_cell_checked = False
        """True if an object was weighed whose class the looks prove."""
        self.false_grasp_count = 0
        self._has_grasped = False
        self.unexplained = Unexplained(self.emit)
        self.assumption_reasons: list[str] = []

    def observe(self, detections: Detections, observations: Sequence[Observation]) -> Sequence[Target]:
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
        if detections.view == "full":
            self._judge_proof(detections)
        if frame.id != self._last_frame_id:
            self._last_frame_id = frame.id
            self._last_stamp = frame.stamp
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

    def observe_regions(self, look: Detections, regions: Sequence[Region]) -> None:
        change_count = look.frame.change_count
        unmoved = [each for each in regions if self._coverage.is_unchanged(each.position, change_count)]
        self.unexplained.observe(look, unmoved, self.config.gate * AMBIGUITY_FACTOR)

    def choose_place_to_probe(self) -> Array | None:
        return self.unexplained.choose_place_to_probe()

    def record_probe(self, place: Array, height: float | None) -> None:
        self.unexplained.record_probe(place, height)
        # The tool may have moved what it touched.
        if height is not None:
            self.invalidate_positions()

    def update_presence(
        self, item: Item, detections: Detections, observations: Sequence[Observation]
    ) -> Presence:
        record = self._records.find(item)
        observations = [each for each in observations if each.detection.label not in self.ignored_labels]
        if record.state is State.PLACED and record.bin:
            presence = self._bin_contents.update_presence(record, detections, observations)
        elif record.state not in ON_TABLE:
            # The place of an item whose bin was emptied is outside of the cell.
            return Presence.HIDDEN if record.state in (State.HELD, State.PLACED) else Presence.GONE
        elif record.frame_id == detections.frame.id:
            return Presence.PRESENT
        else:
            is_searched = detections.compute_searched_mask(record.position[None])[0]
            presence = Presence.GONE if is_searched else Presence.HIDDEN
        if presence is not Presence.GONE:
            return presence
        if not self._certainty.is_position_empty(record):
            return Presence.UNSURE
        self._records.forget_failed_picks(record, self.config.gate)
        record.mark_as_taken_away(self.change_count)
        self._records.emit(record)
        return Presence.GONE

    @property
    def is_tool_plausible(self) -> bool:
        return self._has_grasped or len(self._records.failed_picks) < MIN_FAILED_PICKS_OF_BROKEN_TOOL

    def record_empty_load(self, load: float) -> None:
        shift = load - self.empty_load
        self.empty_load = load
        if self._last_weighing is not None:
            record, weight, std = self._last_weighing
            self._last_weighing = None
            log_ratios = evidence.compute_weight_log_ratios(weight - shift, std, self.classes)
            if log_ratios[record.label] < MIN_LOG_RATIO_OF_WEIGHT:
                text = f"the load cell's zero moved by {shift:+.2f} N; {record.item} may be no {record.label}"
                self.unexplained.report(f"weight of {record.item}", text)

    def record_measurement(self, item: Item, measurement: ToolMeasurement) -> bool:
        record = self._records.find(item)
        is_confirmed = self._certainty.add_measurement(record, measurement)
        self._confirmed_labels.add(record.confirmed_label)
        if is_confirmed:
            return True
        self._coverage.record_change(record.position, self.config.neighbourhood)
        self._records.emit(record)
        return False

    def record_weight(self, item: Item, weight: float, std: float) -> str:
        record = self._records.find(item)
        label_map = {label: other.detected_label for label, other in self.classes.items()}
        is_proved = self._is_class_proved_by_looks(record)
        record.belief.add_weighing(evidence.compute_weight_log_ratios(weight, std, self.classes), label_map)
        contradiction = "" if is_proved else self._load_cell_problem
        if not self._certainty.is_class_certain_by_weight(record):
            contradiction = evidence.describe_weight(weight, record.label, self.classes)
        if is_proved:
            self._is_load_cell_checked = True
            self._load_cell_problem = contradiction and f"the load cell may be wrong: {item}: {contradiction}"
            self.unexplained.withdraw("load cell")
        if self._load_cell_problem:
            self.unexplained.report("load cell", f"{self._load_cell_problem}; others may be wrong, too")
        if contradiction:
            record.last_contradiction = contradiction
        else:
            self._last_weighing = (record, weight, std)
        self._records.emit(record)
        return contradiction

    def record_failed_pick(self, item: Item, *, found_table: bool = False) -> None:
        record = self._records.find(item)
        self._records.count_failed_pick(record)
        record.empty_probe_count += found_table
        self.invalidate_positions()
        self._records.emit(record)

    def record_grasp(self, item: Item) -> None:
        if (held_item := self.find_held_item()) not in (None, item):
            raise Fault(
                f"the tool cannot hold {item}: it holds {held_item}; the skill that released {held_item} "
                "must call record_placement, record_drop or record_put_down of the ledger"
            )
        record = self._records.find(item)
        self._has_grasped = True
        self._records.change_state(record, State.HELD)
        record.belief.is_confirmed = True
        record.was_taken_away = False
        self._coverage.record_change(record.position, self.config.neighbourhood)

    def record_drop(self, item: Item, landing: Array | None = None) -> None:
        record = self._records.find(item)
        record.was_taken_away = False
        self._records.change_state(record, State.DROPPED)
        self._bin_contents.set_prior_log_odds(record, landing)
        self._records.count_failed_pick(record)
        record.drop_count += 1
        record.change_count = self.change_count
        self.invalidate_positions()

    def record_held_load(self) -> None:
        self.false_grasp_count = 0

    def record_false_grasp(self, item: Item) -> None:
        record = self._records.find(item)
        self._records.change_state(record, State.DROPPED)
        self._bin_contents.set_prior_log_odds(record, None)
        self._records.count_failed_pick(record)
        # `record.change_count` stays that before the grasp: looks after the grasp may show the item.
        self.false_grasp_count += 1
        self.invalidate_positions()

    def record_placement(self, item: Item, bin: str) -> None:
        record = self._records.find(item)
        if record.state is State.HELD:
            record.reason = ""
            record.slot = self._bin_contents.find_next_slot_index(bin)
            self._records.forget_failed_picks(record, self.config.gate)
        # If the item later leaves the bin, an object seen before this time is not taken for the item.
        record.stamp = self._last_stamp
        record.belief.miss_probability = 1.0
        record.clear_viewpoints()
        record.was_detected_in_bin = False
        self._records.set_placed(record, bin)
        self._return_items_that_were_not_picked()

    def record_put_down(self, item: Item, position: Array) -> None:
        record = self._records.find(item)
        record.update_position(position, self.config.gate, is_unmoved=False)
        record.change_count = self.change_count
        self._records.change_state(record, State.REJECTED if record.reason else State.SEEN)
        self.invalidate_positions()

    def reject(self, item: Item, reason: str) -> None:
        record = self._records.find(item)
        record.reason = f"{reason}: {record.last_contradiction}" if record.last_contradiction else reason
        # A held or dropped item keeps its state until a look shows the item on the table.
        is_off_table = record.state in (State.HELD, State.DROPPED)
        self._records.change_state(record, record.state if is_off_table else State.REJECTED)

    def defer(self, item: Item) -> None:
        record = self._records.find(item)
        self._deferral_count += 1
        record.deferral_rank = self._deferral_count
        record.deferral_count += 1

    def invalidate_positions(self) -> None:
        self._coverage.record_change(np.zeros(3), math.inf)

    def record_collision(self, point: Sequence[float] | None) -> None:
        self.invalidate_positions()
        if point is not None:
            for record in self._records.filter_by_state(*ON_TABLE):
                is_touched = math.dist(point[:2], record.position[:2]) <= self.config.gate
                record.belief.is_confirmed |= is_touched and record.belief.look_count > 0
            self._add_body(np.array(point))

    def empty_bins(self, bins: Collection[str]) -> None:
        self._bin_contents.archive_items(bins)
        self.emit(BinsEmptied(list(bins)))

    def record_bin_contents(self, contents: Mapping[str, tuple[float, bool]], frame: Frame) -> None:
        for name, text in self._bin_contents.compare_contents(contents).items():
            self.unexplained.report(f"contents {name}", text, frame=frame.id)

    def record_bins(self, contradictions: Mapping[str, str], frame: Frame) -> None:
        self._bin_contents.contradictions.update(contradictions)
        for name, contradiction in contradictions.items():
            if contradiction:
                self.unexplained.report(f"bin {name}", contradiction, frame=frame.id)
            else:
                self.unexplained.withdraw(f"bin {name}")

    def set_final_states(self, *, completed: bool) -> None:
        used_bins = {record.bin for record in self._records.filter_by_state(State.PLACED)}
        if unseen_bins := sorted(used_bins - self._bin_contents.views.keys() - {""}):
            self.assumption_reasons.append(f"no image showed what is in {', '.join(unseen_bins)}")
        for name, view in self._bin_contents.views.items():
            if view.change:
                self.unexplained.report(f"contents {name}", view.change)
        was_weighed = any(record.belief.weight_log_ratios for record in self._records.all)
        if was_weighed and not self._is_load_cell_checked:
            self.assumption_reasons.append("the load cell has the right gain: no known object proved it")
        has_confirmed_item = any(self._confirmed_labels)
        dropped = self._records.filter_by_state(State.DROPPED)
        dropped_items = [record for record in dropped if not record.was_taken_away]
        for record in self._records.all:
            self._settle_undeclared(record)
            final_state = self._certainty.find_final_state(
                record, skip_reason=self._explain_skipped_item(record),
                is_completed=completed, has_confirmed_item=has_confirmed_item,
            )  # fmt: skip
            if bin := find_probable_bin(record):
                record.bin = bin
                final_state = (State.PLACED, REASON_PROBABLY_FELL)
            if final_state is not None:
                record.set_state(*final_state)
                self._records.emit(record)
        self._records.emit(*discard_moved_items(self.records, dropped_items))
        missed = [record for record in self._records.all if record.may_have_left]
        for record in (each for each in missed if each.label not in self.unknown_labels):
            x, y, _ = record.position
            count = record.belief.look_count
            text = f"{count} look(s) showed {record.item} at ({x:.2f}, {y:.2f}) m, and later looks missed it"
            self.unexplained.report(
                f"item {record.item}", f"{text}: it was taken away, or detected by mistake",
                frame=record.frame_id,
            )  # fmt: skip

    def discard_rejected_and_skipped(self) -> None:
        self._records.failed_picks.clear()
        for record in self._records.filter_by_state(State.REJECTED, State.SKIPPED):
            record.set_state(State.PHANTOM, "the run was resumed; the next look adds the object again")
            self._records.emit(record)

    def count_states(self) -> dict[str, int]:
        counts = Counter(item.state for item in self.list_items())
        totals = {state.value: counts[state.value] for state in (*FINAL_STATES, State.PHANTOM)}
        return {"seen": counts.total() - counts[State.PHANTOM.value], **totals}

    def list_items(self) -> Sequence[ItemChanged]:
        return [*self._records.archived.values(), *(record.event for record in self._records.all)]

    @property
    def records(self) -> Sequence[ItemRecord]:
        """All items except those of emptied bins, in the order of the first detection."""
        return self._records.all

    @property
    def change_count(self) -> int:
        return self._coverage.change_count

    def find_targets(self) -> Sequence[Target]:
        unmoved_items = filter(self._coverage.is_unmoved, self._records.filter_by_state(State.SEEN))
        return [record.target for record in unmoved_items if record.label not in self.unknown_labels]

    def find_objects_on_table(self) -> Sequence[Target]:
        targets = [
            record.target
            for record in self._records.filter_by_state(*ON_TABLE)
            if record.belief.is_probable and not self._certainty.is_position_empty(record)
        ]
        bodies = [position for position, _ in reversed(self._bodies)]
        for position in (*bodies, *self.unexplained.positions):
            if self._is_separate(position, targets):
                targets.append(Target("an object of no item", "", position, 0.0, 0, 0, 0.0))
        return targets

    def find_uncertain_items(self) -> Sequence[Item]:
        possible_items = [record for record in self._records.all if self._certainty.may_be_on_table(record)]
        workspace_items = [item for item in possible_items if self._coverage.is_in_workspace(item.position)]
        unmoved_items = [record for record in workspace_items if self._coverage.is_unmoved(record)]
        certain_items = [record for record in unmoved_items if self._certainty.is_certain(record)]
        return [record.item for record in workspace_items if record not in certain_items]

    def find_held_item(self) -> Item | None:
        held = self._records.filter_by_state(State.HELD)
        return held[0].item if held else None

    def is_current(self, frame: Frame) -> bool:
        return self._coverage.is_table_unchanged(frame.change_count)

    def is_fresh(self, target: Target) -> bool:
        return self._coverage.is_unchanged(target.position, target.change_count)

    def is_certain(self, item: Item) -> bool:
        return self._certainty.is_certain(self._records.find(item))

    def is_confirmed_by_tool(self, label: str) -> bool:
        return label in self._confirmed_labels

    def is_table_empty(self, label: str | None = None, ignored_items: Collection[Item] = ()) -> bool:
        routed_labels = [routed_label for routed_label in self.routes if label in (None, routed_label)]
        labels = {entry for entry in routed_labels if not self._bin_contents.explain_skipped_class(entry)}
        if routed_labels and not labels:
            return True
        rejected = [record.position for record in self._records.filter_by_state(State.REJECTED)]
        object_probability = self._coverage.find_max_object_probability(rejected)
        if object_probability > self.config.max_miss_probability:
            return False
        if self.unexplained.needs_look:
            return False
        records = (record for record in self._records.all if record.item not in ignored_items)
        possible_items = [record for record in records if self._certainty.may_be_on_table(record)]
        visible_items = [record for record in possible_items if self._coverage.is_visible(record.position)]
        # An item without enough confident detections counts as an object of every class.
        return not any(
            labels.intersection(self.list_possible_labels(record.item)) or self._needs_look(record)
            for record in visible_items
        )

    def get_label(self, item: Item) -> str:
        return self._records.find(item).label

    def list_possible_labels(self, item: Item) -> Sequence[str]:
        record = self._records.find(item)
        label = record.label
        if self._certainty.is_class_certain_by_weight(record):
            return [label]
        detected_label = record.detected_label
        similar_classes = (other for other in self.classes.values() if other.detected_label == detected_label)
        return [label, *(other.label for other in similar_classes if other.label != label)]

    def describe(self, item: Item) -> KnownItem:
        record = self._records.find(item)
        state = record.state.value
        if record.state is State.DROPPED:
            state = State.REJECTED.value if record.reason else State.LOST.value
        elif record.state is State.SEEN:
            state = "deferred" if record.deferral_rank else "open"
            if self._explain_skipped_item(record):
                state = State.SKIPPED.value
        attempt_count = self._records.count_attempts(record, self.config.gate)
        return KnownItem(
            record.item, record.label, state, record.bin, record.position, attempt_count, record.drop_count,
            record.deferral_count, record.deferral_rank,
        )  # fmt: skip

    def list_known_items(self) -> Sequence[KnownItem]:
        records = (record for record in self._records.all if record.state is not State.PHANTOM)
        return [self.describe(record.item) for record in records if record.belief.is_probable]

    def count_objects_in(self, bin: str, label: str | None = None) -> int:
        return self._bin_contents.count_objects_in(bin, label)

    def count_items(self, state: str, label: str | None = None, bin: str | None = None) -> int:
        items = (self.describe(record.item) for record in self._records.all)
        archived_count = 0 if bin else self._records.count_archived(state, label)
        return archived_count + sum(
            item.state == state and label in (None, item.label) and bin in (None, item.bin) for item in items
        )

    def find_next_slot_index(self, bin: str) -> int:
        return self._bin_contents.find_next_slot_index(bin)

    @property
    def contradicted_bins(self) -> Mapping[str, str]:
        return {name: text for name, text in self._bin_contents.contradictions.items() if text}

    def has_unconfirmed_bin(self) -> bool:
        return len(self._bin_contents.contradictions) < len(self.bins)

    def explain_skipped_class(self, label: str) -> str:
        return self._bin_contents.explain_skipped_class(label)

    def _update(self, detections: Detections, observations: Sequence[Observation]) -> None:
        bias_std = detections.error_rates.bias
        self._bodies = [(position, count - 1) for position, count in self._bodies if count > 1]
        entries = self._omit_redundant_observations(observations)
        bin_names = {entry: self._bin_contents.find_bin_name(entry, bias_std) for entry in entries}
        observations_on_table = [entry for entry, bin_name in bin_names.items() if bin_name is None]
        update = LookUpdate(self._certainty, self._records, self._coverage, detections)
        for record in update.apply(observations_on_table):
            self._certainty.reject_if_uncertain(record, is_unmoved=self._coverage.is_unmoved(record))
            self._records.emit(record)
        self._return_items_that_were_not_picked()
        if detections.view == "full":
            self._bin_contents.record_surplus(detections, bin_names)
            self._bin_contents.confirm_placed_items(detections, observations)
            self._bin_contents.mark_dropped_items_as_placed(detections, bin_names)

    def _judge_proof(self, detections: Detections) -> None:
        """Report a look at the whole image that cannot prove an empty table, or withdraw the report."""
        if blindness := detections.error_rates.blindness:
            text = f"images cannot prove that the table is empty: {blindness}"
            self.unexplained.report("empty table", text, frame=detections.frame.id)
        else:
            self.unexplained.withdraw("empty table")

    def _return_items_that_were_not_picked(self) -> None:
        """Replace each placed item by the item that looks showed at its place after the pick."""
        for placed in self._records.filter_by_state(State.PLACED):
            # In a cell with stacks, the place may show a lower object.
            if self.table.stacked or (left := self._bin_contents.find_item_left_behind(placed)) is None:
                continue
            self.false_grasp_count += 1
            text = f"looks showed {left.item} where {placed.item} had been picked: {placed.bin} received"
            self.unexplained.report(f"pick {placed.item}", f"{text} another object, or nothing")
            placed.bin = ""
            placed.slot = None
            placed.set_state(State.PHANTOM, f"it is {left.item}")
            self._records.emit(placed)

    def _add_body(self, position: Array) -> None:
        """Record an object of no item at `position` `(3,)` [m], unless an item or a bin is there."""
        if self._is_separate(position, [target for target in self.find_objects_on_table() if target.label]):
            self._bodies.append((position, BODY_LOOK_COUNT))

    def _omit_redundant_observations(self, observations: Sequence[Observation]) -> list[Observation]:
        """Return the observations without those of undeclared labels that show no further object to sort.

        Such an observation is near another observation or a known object, or it is outside of the workspace.
        """
        kept = [entry for entry in observations if entry.detection.label not in self.unknown_labels]
        other_labels = ("", *self.unknown_labels)
        targets = [each for each in self.find_objects_on_table() if each.label not in other_labels]
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

    def _is_class_proved_by_looks(self, record: ItemRecord) -> bool:
        """Return True if an item's class is certain without its weight, which the cell declares."""
        alike = [each for each in self.classes.values() if each.detected_label == record.detected_label]
        has_known_mass = len(alike) == 1 and math.isfinite(alike[0].mass_std)
        return has_known_mass and self._certainty.is_class_certain(record)

    def _explain_skipped_item(self, record: ItemRecord) -> str:
        """Return the reason why the mission sorts none of the possible classes of an item, or ""."""
        if record.label in self.unknown_labels:
            return f'the cell has no class "{record.label}"; see `class_map` and `unknown` of the cell file'
        labels = self.list_possible_labels(record.item)
        reasons = [self._bin_contents.explain_skipped_class(label) for label in labels]
        return reasons[0] if all(reasons) else ""
