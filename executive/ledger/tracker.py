"""Tracker of all items: record of the looks and of the actions of the robot, and answers to skills."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.config import LedgerConfig, TableConfig
from executive.cell.frame import BinAppearance, Detections, Frame, FrameCaptured, Observation, Region
from executive.cell.ledger import Presence
from executive.cell.objects import Bin, Item, KnownItem, ObjectClass, Quotas, Target
from executive.cell.protocols import Routes
from executive.cell.tools import ToolMeasurement
from executive.errors import Fault
from executive.events import BinsEmptied, Emit, ItemChanged
from executive.geometry import Array, HeldPose
from executive.ledger.bin_contents import BinContents
from executive.ledger.certainty import Certainty
from executive.ledger.coverage import Coverage
from executive.ledger.final_states import FINAL_STATES, set_final_states
from executive.ledger.foreign import ForeignObjects
from executive.ledger.item import ON_TABLE, ItemRecord, ItemRecords, State
from executive.ledger.load_cell import LoadCell
from executive.ledger.look import AMBIGUITY_FACTOR, LookUpdate, make_look_event
from executive.ledger.unexplained import SETTLING_LOOK_COUNT, Unexplained

MIN_FAILED_PICKS_OF_BROKEN_TOOL = 8
"""Number of failed picks, more than the attempts for one item, after which one must have succeeded."""


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
        false_grasp_count: Number of contradicted grasps since a load confirmed a grasp.
        foreign: Objects that no item stands for.
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
        self._records = ItemRecords(self.emit)
        self._certainty = Certainty(self.config, self.distinct_labels)
        self._bin_contents = BinContents(
            self.config, self.bins, self.routes, self._records, self.quotas, self.classes
        )
        self._coverage = Coverage(self.table)
        self.foreign = ForeignObjects(
            self.config, self.bins, self.classes, self._coverage, self.ignored_labels
        )
        self.unexplained = Unexplained(self.emit)
        self._load_cell = LoadCell(self.classes, self._certainty, self.unexplained)
        self._last_frame_id = 0
        self._last_stamp = 0.0
        """Capture time of the last look [s]."""
        self.false_grasp_count = 0
        self._has_grasped = False
        self.assumption_reasons: list[str] = []

    @property
    def unknown_labels(self) -> Mapping[str, int]:
        return self.foreign.unknown_labels

    def observe(self, detections: Detections, observations: Sequence[Observation]) -> Sequence[Target]:
        frame = detections.frame
        self.foreign.record_unknown_labels(detections)
        kept_observations = self.foreign.omit_ignored(observations)
        # The text before the colon identifies a reason; the numbers after the colon differ between frames.
        reason = detections.error_rates.assumption_reason
        known_starts = [known.partition(":")[0] for known in self.assumption_reasons]
        if reason and reason.partition(":")[0] not in known_starts:
            self.assumption_reasons.append(reason)
        if detections.view == "full":
            blindness = detections.error_rates.blindness
            text = blindness and f"images cannot prove that the table is empty: {blindness}"
            self.unexplained.report("empty table", text, frame=frame.id)
        if frame.id != self._last_frame_id:
            self._last_frame_id = frame.id
            self._last_stamp = frame.stamp
            self._update(detections, kept_observations)
            self.foreign.record_ignored(detections, observations, self.find_objects_on_table())
        self.emit(FrameCaptured(frame))
        self.emit(make_look_event(detections, kept_observations))
        return self.find_targets()

    def observe_regions(self, look: Detections, regions: Sequence[Region]) -> None:
        change_count = look.frame.change_count
        unmoved = [each for each in regions if self._coverage.is_unchanged(each.position, change_count)]
        self.unexplained.observe(look, unmoved, self.config.gate * AMBIGUITY_FACTOR)
        for record in self._records.filter_by_state(State.SEEN):
            # Detector and witness agree.
            if record.belief.look_count >= SETTLING_LOOK_COUNT:
                record.belief.is_confirmed |= self.unexplained.explain(record.position, self.config.gate)

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
        if record.state is State.PLACED and record.bin:
            others = self.foreign.omit_ignored(observations)
            presence = self._bin_contents.update_presence(record, detections, others)
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

    def record_measurement(self, item: Item, measurement: ToolMeasurement) -> bool:
        record = self._records.find(item)
        if self._certainty.add_measurement(record, measurement):
            return True
        self._coverage.record_change(record.position, self.config.neighbourhood)
        self._records.emit(record)
        return False

    @property
    def empty_load(self) -> float:
        return self._load_cell.empty_load

    def record_empty_load(self, load: float) -> None:
        self._load_cell.record_empty_load(load)

    def record_weight(self, item: Item, weight: float, std: float) -> str:
        record = self._records.find(item)
        contradiction = self._load_cell.record_weight(record, weight, std)
        self._records.emit(record)
        return contradiction

    def record_failed_pick(self, item: Item, *, found_table: bool = False) -> None:
        record = self._records.find(item)
        self._records.count_failed_pick(record)
        record.empty_probe_count += found_table
        self.invalidate_positions()
        self._records.emit(record)

    def get_held_pose(self, item: Item) -> HeldPose | None:
        return self._records.find(item).held_pose

    def record_grasp(self, item: Item, held_pose: HeldPose | None = None) -> None:
        if (held_item := self.find_held_item()) not in (None, item):
            raise Fault(
                f"the tool cannot hold {item}: it holds {held_item}; the skill that released {held_item} "
                "must call record_placement, record_drop or record_put_down of the ledger"
            )
        record = self._records.find(item)
        self._has_grasped = True
        record.held_pose = held_pose
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
        self._check_picks()

    def record_put_down(self, item: Item, position: Array) -> None:
        record = self._records.find(item)
        record.update_position(position, self.config.gate, is_unmoved=False)
        record.change_count = self.change_count
        self._records.change_state(record, State.REJECTED if record.reason else State.SEEN)
        self.invalidate_positions()

    def reject(self, item: Item, reason: str) -> None:
        record = self._records.find(item)
        record.rejection_count += 1
        record.reason = f"{reason}: {record.last_contradiction}" if record.last_contradiction else reason
        # A held or dropped item keeps its state until a look shows the item on the table.
        is_off_table = record.state in (State.HELD, State.DROPPED)
        self._records.change_state(record, record.state if is_off_table else State.REJECTED)

    def defer(self, item: Item) -> None:
        record = self._records.find(item)
        record.deferral_rank = 1 + max(each.deferral_rank for each in self._records.all)
        record.deferral_count += 1

    def invalidate_positions(self) -> None:
        self._coverage.record_change(np.zeros(3), math.inf)

    def record_collision(self, point: Sequence[float] | None) -> None:
        self.invalidate_positions()
        if point is not None:
            for record in self._records.filter_by_state(*ON_TABLE):
                is_touched = math.dist(point[:2], record.position[:2]) <= self.config.gate
                record.belief.is_confirmed |= is_touched and record.belief.look_count > 0
            self.foreign.add(np.array(point), self.find_objects_on_table())

    def empty_bins(self, bins: Collection[str]) -> None:
        self._bin_contents.archive_items(bins)
        self.emit(BinsEmptied(list(bins)))

    def observe_bins(self, appearances: Mapping[str, BinAppearance], frame: Frame) -> None:
        for name, text in self._bin_contents.compare_contents(appearances, frame).items():
            self.unexplained.report(f"contents {name}", text, frame=frame.id)
        for name, appearance in appearances.items():
            if appearance.contradiction is not None:
                self._bin_contents.contradictions[name] = appearance.contradiction
                self.unexplained.report(f"bin {name}", appearance.contradiction, frame=frame.id)

    def set_final_states(self, *, completed: bool, finish_reason: str = "") -> None:
        assumptions = (self._bin_contents.describe_unseen_bins(), self._load_cell.assumption)
        self.assumption_reasons += [assumption for assumption in assumptions if assumption]
        for name, view in self._bin_contents.views.items():
            if view.change:
                self.unexplained.report(f"contents {name}", view.change)
        set_final_states(
            self._records, self._certainty, self._explain_skipped_item, self.unknown_labels,
            is_completed=completed, finish_reason=finish_reason,
        )  # fmt: skip
        for record in self._records.all:
            if record.may_have_left and record.label not in self.unknown_labels:
                text = record.describe_disappearance()
                self.unexplained.report(f"item {record.item}", text, frame=record.frame_id)

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
        for position in (*self.foreign.positions, *self.unexplained.positions):
            if self.foreign.is_separate(position, targets):
                targets.append(Target("an object of no item", "", position, 0.0, 0, 0, 0.0))
        return targets

    def find_uncertain_items(self) -> Sequence[Item]:
        possible_items = [record for record in self._records.all if self._certainty.may_be_on_table(record)]
        workspace_items = [item for item in possible_items if self._coverage.is_in_workspace(item.position)]
        unmoved_items = [record for record in workspace_items if self._coverage.is_unmoved(record)]
        certain_items = [record for record in unmoved_items if self._certainty.is_certain(record)]
        return [record.item for record in workspace_items if record not in certain_items]

    def find_held_item(self) -> Item | None:
        return next((record.item for record in self._records.filter_by_state(State.HELD)), None)

    def is_current(self, frame: Frame) -> bool:
        return self._coverage.is_table_unchanged(frame.change_count)

    def is_fresh(self, target: Target) -> bool:
        return self._coverage.is_unchanged(target.position, target.change_count)

    def is_certain(self, item: Item) -> bool:
        return self._certainty.is_certain(self._records.find(item))

    def is_confirmed_by_tool(self, label: str) -> bool:
        return label in self._certainty.confirmed_labels

    def is_table_empty(self, label: str | None = None, ignored_items: Collection[Item] = ()) -> bool:
        routed_labels = [routed_label for routed_label in self.routes if label in (None, routed_label)]
        labels = {entry for entry in routed_labels if not self._bin_contents.explain_skipped_class(entry)}
        if routed_labels and not labels:
            return True
        rejected = [record.position for record in self._records.filter_by_state(State.REJECTED)]
        object_probability = self._coverage.find_max_object_probability(rejected)
        if object_probability > self.config.max_miss_probability or self.unexplained.needs_look:
            return False
        records = (record for record in self._records.all if record.item not in ignored_items)
        possible_items = [record for record in records if self._certainty.may_be_on_table(record)]
        visible_items = [record for record in possible_items if self._coverage.is_visible(record.position)]
        # An item without enough confident detections counts as an object of every class.
        return not any(
            labels.intersection(self.list_possible_labels(record.item)) or self.foreign.needs_look(record)
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
        is_skipped = record.state is State.SEEN and self._explain_skipped_item(record)
        state = State.SKIPPED.value if is_skipped else record.known_state
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

    def explain_skipped_class(self, label: str) -> str:
        return self._bin_contents.explain_skipped_class(label)

    def _update(self, detections: Detections, observations: Sequence[Observation]) -> None:
        bias_std = detections.error_rates.bias
        self.foreign.forget_old()
        entries = self.foreign.omit_redundant(observations, self.find_objects_on_table())
        bin_names = {entry: self._bin_contents.find_bin_name(entry, bias_std) for entry in entries}
        observations_on_table = [entry for entry, bin_name in bin_names.items() if bin_name is None]
        update = LookUpdate(self._certainty, self._records, self._coverage, detections)
        for record in update.apply(observations_on_table):
            self._certainty.reject_if_uncertain(record, is_unmoved=self._coverage.is_unmoved(record))
            self._records.emit(record)
        self._check_picks()
        if detections.view == "full":
            self._bin_contents.record_surplus(detections, bin_names)
            self._bin_contents.confirm_placed_items(detections, observations)
            self._bin_contents.mark_dropped_items_as_placed(detections, bin_names)

    def _check_picks(self) -> None:
        # In a cell with stacks, the place of a picked item may show a lower object.
        if self.table.stacked:
            return
        for item, text in self._bin_contents.discard_items_left_behind().items():
            self.false_grasp_count += 1
            self.unexplained.report(f"pick {item}", text)

    def _explain_skipped_item(self, record: ItemRecord) -> str:
        """Return the reason why the mission sorts none of the possible classes of an item, or ""."""
        if record.label in self.unknown_labels:
            return f'the cell has no class "{record.label}"; see `class_map` and `unknown` of the cell file'
        labels = self.list_possible_labels(record.item)
        reasons = [self._bin_contents.explain_skipped_class(label) for label in labels]
        return reasons[0] if all(reasons) else ""
