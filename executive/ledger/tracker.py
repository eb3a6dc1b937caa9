"""The ledger: who is who on the table, what may have moved, and what became of everything."""

from __future__ import annotations

import math
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
from executive.ledger.accounts import (
    Remarks,
    count_states,
    find_final_state,
    find_lost_elsewhere,
    forget_rejected,
)
from executive.ledger.bins import Bins
from executive.ledger.certainty import Certainty
from executive.ledger.coverage import Coverage
from executive.ledger.item import LYING, OPEN, Record, State
from executive.ledger.look_event import frame_searched
from executive.ledger.staleness import Freshness
from executive.ledger.update import Looks


class ItemLedger:
    """Follows every object from its first look to its fate; implements `executive.cell.protocols.Ledger`.

    Every change is emitted as an `item` event, so that the record can be rebuilt from the journal.

    Attributes:
        unknown, doubts: See `Remarks`.
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
        self._config = config
        self._certainty = Certainty(config, distinct_by_touch)
        self._routes = routes
        self._emit = emit
        self._records: dict[Item, Record] = {}
        self._in_bins = Bins(config, bins, routes, self._records)
        self._freshness = Freshness()
        self._coverage = Coverage(table)
        self._looks = Looks(config, self._coverage, self._freshness)
        self._frame = 0
        self._remarks = Remarks()
        self.unknown, self.doubts = self._remarks.unknown, self._remarks.doubts

    @property
    def records(self) -> Sequence[Record]:
        """Everything known, in the order of first sight."""
        return list(self._records.values())

    @property
    def epoch(self) -> int:
        """How often the table has been changed by the robot so far."""
        return self._freshness.epoch

    def is_current(self, frame: Frame) -> bool:
        """Tell whether nothing has put the whole table in doubt since the frame was taken."""
        return self._freshness.anywhere_holds(frame.epoch)

    def observe(self, detections: Detections, observations: Sequence[Observation]) -> Sequence[Target]:
        """Record a look and return the `targets` that are known now.

        What lies in a bin is no target. A detection where the robot has changed the table since the frame
        was taken shows what is no longer there, and counts for nothing. The same frame a second time is no
        second look.
        """
        frame = detections.frame
        self._remarks.add(detections)
        if frame.id != self._frame:
            self._frame = frame.id
            self._take(detections, observations)
        self._emit(FrameTaken(frame))
        self._emit(frame_searched(detections, observations))
        return self.targets()

    def targets(self) -> Sequence[Target]:
        """Return one target per item that is open and whose place is known now."""
        return [
            record.target
            for record in self._records.values()
            if record.state is State.SEEN and self._looks.settled(record)
        ]

    def is_fresh(self, target: Target) -> bool:
        """Tell whether nothing the robot did since has put the target's position in doubt."""
        return self._freshness.holds(target.position, target.epoch)

    def is_open(self, item: Item) -> bool:
        """Tell whether the item still waits to be sorted."""
        record = self._record(item)
        return record.state in OPEN and not record.why

    def is_sure(self, item: Item) -> bool:
        """Tell whether there is enough evidence that the item exists, of which class it is, and where."""
        return self._certainty.is_sure(self._record(item))

    def in_doubt(self) -> Sequence[Item]:
        """Return the open items in the workspace that a further look may make sure, or show to be gone."""
        return [
            record.item
            for record in self._records.values()
            if self._may_wait(record)
            and self._coverage.in_workspace(record.position)
            and not self._is_known(record)
        ]

    def believes_empty(self, label: str | None = None) -> bool:
        """Return True if it is as good as certain that nothing with a route is left where one can look.

        Args:
            label: Only objects of this class count; None: those of all classes.
        """
        waiting = any(
            # Before any look is sure, its class is a guess.
            ((record.label in self._routes and label in (None, record.label)) or not record.votes)
            and self._may_wait(record)
            and self._coverage.in_sight(record.position)
            for record in self._records.values()
        )
        return not waiting and self._coverage.max_object_probability <= self._config.overlooked

    def touched(self, item: Item, contradiction: str = "", *, beside_top: bool = False) -> bool:
        """Record a touch, which proves that an item exists; return True if it may be of its class.

        `contradiction` and `beside_top` are as in `executive.cell.protocols.Ledger`. An item that was touched
        at the height of its class before may have fallen since: then no height contradicts its class.
        """
        record = self._record(item)
        record.exists, record.had_contact, record.empty_probes = True, True, 0
        if not contradiction:
            record.touched, record.low_touches = record.label, 0
        elif record.touched != record.label and not (beside_top and self._certainty.count_low_touch(record)):
            record.contradiction = contradiction
            self._disturb(record.position, self._config.neighbourhood)
            self._emit(record.summary)
            return False
        return True

    def missed(self, item: Item, *, found_table: bool = False) -> None:
        """Record a failed attempt: the cup may have pushed anything, so all is in doubt."""
        record = self._record(item)
        record.attempts += 1
        record.empty_probes += found_table
        self._disturb(record.position, math.inf)
        self._emit(record.summary)

    def held(self, item: Item) -> None:
        """Record that the tool holds the item; its neighbours may have moved.

        Raises:
            Fault: It holds another already, and no skill has said that this one left it.
        """
        if (other := self.in_tool()) not in (None, item):
            raise Fault(
                f"the tool cannot hold {item}: it holds {other}; the skill that ended this must say so to "
                "the ledger, by placed, dropped or returned"
            )
        record = self._change(item, State.HELD)
        record.exists = True
        self._disturb(record.position, self._config.neighbourhood)

    def dropped(self, item: Item, landing: Array | None = None) -> None:
        """Record that the tool lost the item on the way; the whole table is in doubt now.

        It is sought everywhere; `landing` `(3,)` [m] is where it must have come down, if one knows.
        """
        record = self._change(item, State.DROPPED)
        self._in_bins.let_fall(record, landing)
        record.attempts += 1
        record.epoch = self.epoch
        self._disturb(record.position, math.inf)

    def placed(self, item: Item, bin: str) -> None:
        """Record that the item was let go in a bin."""
        record = self._record(item)
        record.bin, record.why = bin, "" if record.state is State.HELD else record.why
        self._change(item, State.PLACED)

    def returned(self, item: Item, position: Array) -> None:
        """Record that the item was put back on the table at a place `(3,)` [m]; a look has to confirm it."""
        record = self._record(item)
        record.locate(position, self._config.gate, settled=False)
        record.epoch = self.epoch
        self._change(item, State.REJECTED if record.why else State.SEEN)
        self._disturb(record.position, math.inf)

    def rejected(self, item: Item, why: str) -> None:
        """Record that the item is given up; it is reported and not tried again.

        A held item stays HELD until it is released; looks continue to search for a dropped item.
        """
        record = self._record(item)
        record.why = f"{why}: {record.contradiction}" if record.contradiction else why
        self._change(item, record.state if record.state in (State.HELD, State.DROPPED) else State.REJECTED)

    def label(self, item: Item) -> str:
        """Return the class the item is believed to be of."""
        return self._record(item).label

    def attempts(self, item: Item) -> int:
        """Return how many grasps of the item have failed."""
        return self._record(item).attempts

    def objects_in(self, bin: str) -> int:
        """Return how many objects were let go in `bin` so far: the number of its next free slot."""
        return self._in_bins.objects_in(bin)

    def standing(self) -> Sequence[Target]:
        """Return where everything is that is believed to stand on the table, to be sorted or not."""
        return [
            record.target
            for record in self._records.values()
            if record.state in LYING and record.probability >= 0.5 and not self._is_gone(record)
        ]

    def bumped(self) -> None:
        """Record that the arm ran into something: the whole table is in doubt now."""
        self._disturb(np.zeros(3), math.inf)

    def in_tool(self) -> Item | None:
        """Return the item that the tool is believed to hold, or None."""
        return next((r.item for r in self._records.values() if r.state is State.HELD), None)

    def close(self, *, completed: bool) -> None:
        """Decide the final state of each item; `completed` is True if the tree succeeded."""
        touched_any = any(record.touched for record in self._records.values())
        dropped = [record for record in self._records.values() if record.state is State.DROPPED]
        for record in self._records.values():
            if bin := self._in_bins.believed(record):
                record.why = "it fell there"
                self.placed(record.item, bin)
            final = find_final_state(
                record, gone=self._is_gone(record), sure=self._certainty.is_sure(record),
                routed=record.label in self._routes, completed=completed, touched_any=touched_any,
            )  # fmt: skip
            if final is not None:
                record.why = final[1]
                self._change(record.item, final[0])
        for record in find_lost_elsewhere(self._records.values(), dropped):
            self._emit(record.summary)

    def reopen(self) -> None:
        """Forget the items that were left on the table; the next look enters those that still lie there."""
        for record in forget_rejected(self._records.values()):
            self._emit(record.summary)

    def balance(self) -> dict[str, int]:
        """Return the counts `seen, placed, rejected, skipped, lost, phantom`."""
        return count_states(self._records.values())

    def summaries(self) -> Sequence[ItemChanged]:
        """Return the present state of each item, in the order of first sight."""
        return [record.summary for record in self._records.values()]

    def _take(self, detections: Detections, observations: Sequence[Observation]) -> None:
        bias = detections.error_rates.bias
        inside = [(one, self._in_bins.at(one, bias)) for one in observations]
        on_table = [one for one, bin in inside if bin is None]
        for record in self._looks.take(self._records, detections, on_table):
            self._certainty.reject_if_uncertain(record, settled=self._looks.settled(record))
            self._emit(record.summary)
        if detections.view == "full":
            confident = [(one, bin) for one, bin in inside if one.confident]
            for record, bin in self._in_bins.fallen(detections, confident):
                record.why = ""
                self.placed(record.item, bin)

    def _may_wait(self, record: Record) -> bool:
        """Tell whether an item may be an object that lies on the table to be sorted."""
        likely = record.probability > self._config.overlooked
        return record.state is State.SEEN and likely and not self._is_gone(record)

    def _is_known(self, record: Record) -> bool:
        return self._certainty.is_sure(record) and self._looks.settled(record)

    def _is_gone(self, record: Record) -> bool:
        return record.overlooked <= self._config.overlooked

    def _record(self, item: Item) -> Record:
        try:
            return self._records[item]
        except KeyError:
            known = ", ".join(self._records) or "none"
            raise Fault(f'the ledger knows no item "{item}"; it knows: {known}') from None

    def _change(self, item: Item, state: State) -> Record:
        record = self._record(item)
        record.state = state
        self._emit(record.summary)
        return record

    def _disturb(self, centre: Array, radius: float) -> None:
        self._freshness.disturb(np.asarray(centre, dtype=float), radius)
        self._coverage.reset_near(centre, radius, self.epoch)
