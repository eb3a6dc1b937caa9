"""Tracker of all items: records looks and actions of the robot, and answers the queries of skills."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from executive.cell.bins import Bin
from executive.cell.config import LedgerConfig, TableConfig
from executive.cell.detection import Detections, Observation
from executive.cell.frame import Frame, FrameTaken
from executive.cell.objects import Item, Target
from executive.cell.protocols import Routes
from executive.errors import Fault
from executive.events import Emit, ItemChanged
from executive.geometry import Array
from executive.ledger.accounts import count_states, find_final_state, find_lost_elsewhere, forget_rejected
from executive.ledger.bins import Bins, find_believed_bin
from executive.ledger.certainty import Certainty
from executive.ledger.coverage import Coverage
from executive.ledger.item import LYING, Record, State
from executive.ledger.look import Update, describe_look
from executive.ledger.records import Records
from executive.ledger.recovery import Recovery
from executive.ledger.staleness import Staleness


class Tracker:
    """Tracks each object from its first look to its final state; implements `executive.cell.ledger.Ledger`.

    The tracker owns the records of the items and emits each change of an item as an event. The methods of the
    protocol are documented there.

    Args:
        config: Limits of the cell file.
        table: The workspace.
        bins: Bins by name.
        routes: Names of the right bins by class.
        emit: Emits an event.
        distinct_by_touch: Classes whose height distinguishes them from all others.

    Attributes:
        unknown: Largest number of boxes in one look for each label that is not in the cell file.
        doubts: Reasons for assuming the error rates of detectors, in the order of the looks.
    """

    def __init__(
        self,
        config: LedgerConfig,
        table: TableConfig,
        bins: Mapping[str, Bin],
        routes: Routes,
        emit: Emit,
        distinct_by_touch: Collection[str] = (),
    ) -> None:
        self._config, self._routes, self._emit = config, routes, emit
        self._records = Records(emit)
        self._certainty = Certainty(config, distinct_by_touch)
        self._bins = Bins(config, bins, routes)
        self._coverage, self._staleness = Coverage(table), Staleness()
        self._recovery: Recovery | None = None
        """Search for untracked items since `lose_track`, until `record_bin_contents`."""
        self._frame = 0
        self.unknown: Counter[str] = Counter()
        self.doubts: list[str] = []

    @property
    def records(self) -> Sequence[Record]:
        """All items, in the order of the first detection."""
        return list(self._records)

    @property
    def epoch(self) -> int:
        """Number of changes of the table by the robot."""
        return self._staleness.epoch

    def observe(self, detections: Detections, observations: Sequence[Observation]) -> Sequence[Target]:
        """Update all items with one search of a frame, and return the targets."""
        frame = detections.frame
        self.unknown |= Counter(detection.label for detection in detections.unknown)
        # The numbers after the colon in the text of a doubt differ between frames: one text per kind is kept.
        kind = detections.error_rates.doubt.partition(":")[0]
        if kind and not any(doubt.startswith(kind) for doubt in self.doubts):
            self.doubts.append(detections.error_rates.doubt)
        if frame.id != self._frame:
            self._frame = frame.id
            self._update(detections, observations)
        self._emit(FrameTaken(frame))
        self._emit(describe_look(detections, observations))
        return self.find_targets()

    def find_targets(self) -> Sequence[Target]:
        """Return one target per open item on the table whose position is known now."""
        return [
            record.target
            for record in self.records
            if record.state is State.SEEN and self._staleness.is_settled(record)
        ]

    def find_objects_on_table(self) -> Sequence[Target]:
        """Return all items that lie on the table with a probability of at least 0.5."""
        return [
            record.target
            for record in self.records
            if record.state in LYING
            and record.belief.probability >= 0.5
            and not self._certainty.is_gone(record)
        ]

    def find_uncertain_items(self) -> Sequence[Item]:
        """Return the open items in the workspace that need a further look."""
        return [
            record.item
            for record in self.records
            if self._certainty.is_possible(record)
            and self._coverage.is_in_workspace(record.position)
            and not (self._certainty.is_sure(record) and self._staleness.is_settled(record))
        ]

    def find_held_item(self) -> Item | None:
        """Return the item in the tool, or None."""
        return next((record.item for record in self.records if record.state is State.HELD), None)

    def is_current(self, frame: Frame) -> bool:
        """Return True if no change of the whole table happened after the capture of a frame."""
        return self._staleness.is_table_unchanged(frame.epoch)

    def is_fresh(self, target: Target) -> bool:
        """Return True if no change after the last detection of a target may have moved it."""
        return self._staleness.is_unchanged(target.position, target.epoch)

    def is_open(self, item: Item) -> bool:
        """Return True if an item is still to be sorted."""
        record = self._records.find(item)
        return record.state in (State.SEEN, State.DROPPED) and not record.reason

    def is_sure(self, item: Item) -> bool:
        """Return True if the existence, class and position of an item are certain enough."""
        return self._certainty.is_sure(self._records.find(item))

    def is_table_empty(self, label: str | None = None) -> bool:
        """Return True if no object with a route is left on the visible table."""
        return self._coverage.max_object_probability <= self._config.overlooked and not any(
            # An item without a confident detection counts with any class, because its class is uncertain.
            ((record.label in self._routes and label in (None, record.label)) or not record.belief.looks)
            and self._certainty.is_possible(record)
            and self._coverage.is_in_sight(record.position)
            for record in self.records
        )

    def get_label(self, item: Item) -> str:
        """Return the most probable class of an item."""
        return self._records.find(item).label

    def count_attempts(self, item: Item) -> int:
        """Return the number of failed attempts to pick an item."""
        return self._records.find(item).attempts

    def count_in(self, bin: str) -> int:
        """Return the number of objects in a bin."""
        return self._bins.count_in(bin, self.records)

    def record_touch(self, item: Item, contradiction: str = "", *, may_miss_top: bool = False) -> bool:
        """Record a touch, which proves that an item exists, and return True if the item may be of its class.

        If an earlier touch was at the height of the class, no later height contradicts the class, because the
        item may have fallen over.
        """
        record = self._records.find(item)
        record.belief.is_proved, record.had_contact, record.empty_probes = True, True, 0
        if not contradiction:
            record.touched_label, record.low_touches = record.label, 0
        elif record.touched_label != record.label:
            if may_miss_top and self._certainty.count_low_touch(record):
                return True
            record.contradiction = contradiction
            self._invalidate(record.position, self._config.neighbourhood)
            self._records.report(record)
            return False
        return True

    def record_miss(self, item: Item, *, found_table: bool = False) -> None:
        """Record a failed attempt to pick an item; all positions are uncertain now."""
        record = self._records.find(item)
        record.attempts += 1
        record.empty_probes += found_table
        self.invalidate_positions()
        self._records.report(record)

    def record_grasp(self, item: Item) -> None:
        """Record that the tool holds an item; its neighbours may have been moved.

        Raises:
            Fault: The tool holds another item, and no skill has recorded the end of that grasp.
        """
        if (other := self.find_held_item()) not in (None, item):
            raise Fault(
                f"the tool cannot hold {item}: it holds {other}; the skill that released {other} must call "
                "record_placement, record_drop or record_put_down of the ledger"
            )
        record = self._records.find(item)
        self._records.change(record, State.HELD)
        record.belief.is_proved = True
        self._invalidate(record.position, self._config.neighbourhood)

    def record_drop(self, item: Item, landing: Array | None = None) -> None:
        """Record that the tool lost an item during a motion; all positions are uncertain now."""
        record = self._records.find(item)
        record.is_untracked = False
        self._records.change(record, State.DROPPED)
        self._bins.set_prior(record, landing)
        record.attempts += 1
        record.epoch = self.epoch
        self.invalidate_positions()

    def record_placement(self, item: Item, bin: str) -> None:
        """Record that an item was released in a bin."""
        record = self._records.find(item)
        if record.state is State.HELD:
            record.reason = ""
        self._records.place(record, bin)

    def record_put_down(self, item: Item, position: Array) -> None:
        """Record that an item was put back on the table at `position` `(3,)` [m]; a look must confirm it."""
        record = self._records.find(item)
        record.locate(position, self._config.gate, is_settled=False)
        record.epoch = self.epoch
        self._records.change(record, State.REJECTED if record.reason else State.SEEN)
        self.invalidate_positions()

    def reject(self, item: Item, reason: str) -> None:
        """Reject an item: it is reported and not tried again.

        A held item stays HELD until its release; looks continue to search for a dropped item.
        """
        self._records.reject(self._records.find(item), reason)

    def invalidate_positions(self) -> None:
        """Record that any object on the table may have been moved."""
        self._invalidate(np.zeros(3), math.inf)

    def lose_track(self) -> None:
        """Record that the tool may have moved any item that is not in a bin."""
        self._recovery = Recovery(self._records, self._bins)
        self._search_everywhere([item for item in self._records if item.state in (State.HELD, State.DROPPED)])

    def mark_unseen_as_dropped(self) -> None:
        """Have looks search for every item that none has shown since `lose_track`."""
        self._search_everywhere(
            [
                record
                for record in self.records
                if record.state is State.SEEN
                and record.belief.probability >= 0.5
                and not self._staleness.is_settled(record)
            ]
        )

    def record_bin_contents(self) -> None:
        """Record an item for each object that the full looks since `lose_track` have shown in a bin."""
        recovery, self._recovery = self._recovery, None
        assert recovery is not None, "the contents of bins are recorded after `lose_track`"
        recovery.record_bin_contents(self.epoch)

    def close(self, *, completed: bool) -> None:
        """Decide the final state of each item; `completed` is True if the tree succeeded."""
        touched_any = any(record.touched_label for record in self.records)
        dropped = [record for record in self.records if record.state is State.DROPPED]
        for record in self.records:
            final = find_final_state(
                record, self._certainty, has_route=record.label in self._routes, completed=completed,
                touched_any=touched_any,
            )  # fmt: skip
            if bin := find_believed_bin(record):
                record.bin, final = bin, (State.PLACED, "it fell there")
            if final is not None:
                record.set_state(*final)
                self._records.report(record)
        for record in find_lost_elsewhere(self.records, dropped):
            self._records.report(record)

    def reopen(self) -> None:
        """Forget the items that were left on the table; the next look adds those that still lie there."""
        for record in forget_rejected(self.records):
            self._records.report(record)

    def count_states(self) -> dict[str, int]:
        """Return the counts `seen, placed, rejected, skipped, lost, phantom`."""
        return count_states(self.records)

    def summaries(self) -> Sequence[ItemChanged]:
        """Return the present state of each item, in the order of the first detection."""
        return [record.summary for record in self.records]

    def _update(self, detections: Detections, observations: Sequence[Observation]) -> None:
        """Update the items on the table with observations there, and dropped items with those in bins."""
        bias = detections.error_rates.bias
        bins = {seen: self._bins.find_bin(seen, bias, self.records) for seen in observations}
        update = Update(self._config, self._records, self._coverage, self._staleness, detections)
        for record in update.apply([seen for seen, bin in bins.items() if bin is None]):
            self._certainty.reject_if_uncertain(record, is_settled=self._staleness.is_settled(record))
            self._records.report(record)
        if detections.view == "full" and self._recovery is not None:
            self._recovery.add(detections, bins)
        elif detections.view == "full":
            for record in self._bins.find_dropped(detections, bins, self.records):
                self._records.report(record)

    def _search_everywhere(self, records: Collection[Record]) -> None:
        assert self._recovery is not None, "items are searched everywhere after `lose_track`"
        self._recovery.search(records, self.epoch)
        self.invalidate_positions()

    def _invalidate(self, centre: Array, radius: float) -> None:
        self._staleness.record_change(centre, radius)
        self._coverage.reset_near(centre, radius, self.epoch)
