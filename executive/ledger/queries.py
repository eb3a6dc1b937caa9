"""Answers of the ledger to skills: which items exist, where they are, and how certain that is."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from executive.cell.bins import Bin
from executive.cell.config import LedgerConfig, TableConfig
from executive.cell.detection import Observation
from executive.cell.frame import Frame
from executive.cell.objects import Item, KnownItem, ObjectClass, Target
from executive.cell.protocols import Routes
from executive.cell.quotas import Quotas
from executive.events import Emit
from executive.geometry import Array
from executive.ledger.association import AMBIGUITY_FACTOR
from executive.ledger.bin_contents import BinContents
from executive.ledger.certainty import Certainty
from executive.ledger.coverage import Coverage
from executive.ledger.item import ON_TABLE, ItemRecord, State
from executive.ledger.records import ItemRecords
from executive.ledger.staleness import Staleness
from executive.perception.evidence import find_classes_distinct_by_touch

MIN_LOG_RATIO_OF_WEIGHT = math.log(0.01)
"""Minimum log likelihood ratio of a weight that agrees with a class, against objects of no declared class. At
the minimum, the class and an undeclared class (prior odds 0.01) are equally probable."""

MIN_LOOKS_WITHOUT_CLASS = 3
"""Minimum number of looks that show an item of no class before the table counts as searched."""


@dataclass(eq=False)
class LedgerQueries:
    """Items of a run, and answers to queries that change nothing; `Tracker` adds the changes.

    `executive.cell.ledger.Ledger` documents the methods in detail.

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
