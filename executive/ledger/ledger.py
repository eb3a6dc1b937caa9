"""The ledger: who is who on the table, what may have moved, and what became of everything."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from executive.cell import Routes
from executive.cell_config import LedgerConfig
from executive.errors import Fault
from executive.events import Emit
from executive.geometry import Array
from executive.ledger.binding import bind
from executive.ledger.freshness import Freshness
from executive.ledger.item import ON_TABLE, OPEN, Record, State
from executive.messages import Bin, Detections, Frame, Item, Target


class ItemLedger:
    """Follows every object from its first look to its fate; implements `executive.cell.Ledger`.

    Every change is emitted as an `item` event, so that the record can be rebuilt from the journal.
    """

    def __init__(self, config: LedgerConfig, bins: Mapping[str, Bin], routes: Routes, emit: Emit) -> None:
        self._config = config
        self._bins = bins
        self._routes = routes
        self._emit = emit
        self._records: dict[Item, Record] = {}
        self._counts: Counter[str] = Counter()
        self._freshness = Freshness()
        self._frame = 0
        self._empty_looks = 0

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

    def observe(self, detections: Detections, positions: Sequence[Array]) -> Sequence[Target]:
        """Record a look and return one target per detection outside the bins.

        A detection where the robot has changed the table since the frame was taken shows what is no
        longer there, and gives none. The same frame a second time is no second look.
        """
        frame = detections.frame
        inside = [i for i, position in enumerate(positions) if self._bin_at(position) is not None]
        outside = [
            i
            for i, position in enumerate(positions)
            if i not in inside and self._freshness.holds(position, frame.epoch)
        ]
        again, self._frame = frame.id == self._frame, frame.id
        found = [detections.found[i] for i in outside]
        places = [positions[i] for i in outside]
        records = [record for record in self._records.values() if record.state in ON_TABLE]
        bound = bind(
            records, [detection.label for detection in found], places, gate=self._config.gate,
            settled=lambda record: self._freshness.holds(record.position, record.epoch),
        )  # fmt: skip
        targets = []
        for index, (detection, place) in enumerate(zip(found, places, strict=True)):
            record = bound.get(index) or self._enter(detection.label, place)
            if not again or not record.looks:
                record.looks += 1
                record.votes[detection.label] += detection.confidence
            record.position, record.epoch, record.absent = place, frame.epoch, 0
            if record.state is State.DROPPED:
                record.state = State.SEEN
            self._report(record)
            targets.append(
                Target(
                    record.item, record.label, place, detection.confidence, frame.id, frame.epoch, frame.stamp
                )
            )
        self._emit_look(detections, positions)
        if detections.view == "full":
            self._recognize_in_bins([(detections.found[i].label, positions[i]) for i in inside])
        if again:
            return targets
        seen = {target.item for target in targets}
        for record in records:
            missing = record.item not in seen and self._freshness.holds(record.position, frame.epoch)
            if missing and detections.searched(record.position):
                record.absent += 1
        if frame.epoch != self.epoch or any(self._waits(target.item) for target in targets):
            self._empty_looks = 0
        elif detections.view == "full":
            self._empty_looks += 1
        return targets

    def is_fresh(self, target: Target) -> bool:
        """Tell whether nothing the robot did since has put the target's position in doubt."""
        return self._freshness.holds(target.position, target.epoch)

    def is_open(self, item: Item) -> bool:
        """Tell whether the item still waits to be sorted."""
        return self._record(item).state in OPEN

    def believes_empty(self) -> bool:
        """Tell whether enough looks at the full frame agree that nothing with a route is left."""
        return self._empty_looks >= self._config.looks_to_believe

    def touched(self, item: Item) -> None:
        """Record that the tool met the item, which proves that it exists."""
        self._record(item).touched = True

    def missed(self, item: Item) -> None:
        """Record a grasp that did not hold: the cup may have pushed anything, so all is in doubt."""
        record = self._record(item)
        record.attempts += 1
        self._disturb(record.position, math.inf)
        self._report(record)

    def held(self, item: Item) -> None:
        """Record that the tool holds the item; its neighbours may have moved."""
        record = self._change(item, State.HELD)
        record.touched = True
        self._disturb(record.position, self._config.neighbourhood)

    def dropped(self, item: Item) -> None:
        """Record that the tool lost the item on the way; the whole table is in doubt now."""
        record = self._change(item, State.DROPPED)
        record.attempts += 1
        self._disturb(record.position, math.inf)

    def placed(self, item: Item, bin: str) -> None:
        """Record that the item was let go in a bin."""
        self._record(item).bin = bin
        self._change(item, State.PLACED)

    def returned(self, item: Item) -> None:
        """Record that the item was put back on the table, where the next look will find it."""
        record = self._change(item, State.DROPPED)
        self._disturb(record.position, math.inf)

    def rejected(self, item: Item, why: str) -> None:
        """Record that the item is given up; it is reported and not tried again."""
        self._record(item).why = why
        self._change(item, State.REJECTED)

    def label(self, item: Item) -> str:
        """Return the class the item is believed to be of."""
        return self._record(item).label

    def attempts(self, item: Item) -> int:
        """Return how many grasps of the item have failed."""
        return self._record(item).attempts

    def objects_in(self, bin: str) -> int:
        """Return how many objects were let go in `bin` so far: the number of its next free slot."""
        return sum(record.bin == bin for record in self._records.values())

    def in_tool(self) -> Item | None:
        """Return the item that the tool is believed to hold, or None."""
        return next((r.item for r in self._records.values() if r.state is State.HELD), None)

    def close(self) -> None:
        """Decide what became of everything still open: the run is over.

        An item seen where it was left is rejected, one that is known to exist and was not found again is
        lost, given up or not, one that a single look believed in and another one did not is a phantom.
        """
        for record in self._records.values():
            if record.state is State.HELD:
                record.why = "still in the tool when the run ended"
                self._change(record.item, State.REJECTED)
            elif record.state not in ON_TABLE:
                continue
            elif not record.exists and record.absent:
                self._change(record.item, State.PHANTOM)
            elif record.state is State.REJECTED and record.absent < self._config.looks_to_believe:
                continue
            elif record.state is State.DROPPED or record.absent:
                record.why = "known to exist, not found again"
                self._change(record.item, State.LOST)
            else:
                routed = record.label in self._routes
                record.why = "the run ended before its turn" if routed else "the mission has no route for it"
                self._change(record.item, State.REJECTED)

    def balance(self) -> dict[str, int]:
        """Return the counts `seen, placed, rejected, lost, phantom`.

        After `close`, seen = placed + rejected + lost.
        """
        states = Counter(record.state for record in self._records.values())
        real = len(self._records) - states[State.PHANTOM]
        return {
            "seen": real,
            "placed": states[State.PLACED],
            "rejected": states[State.REJECTED],
            "lost": states[State.LOST],
            "phantom": states[State.PHANTOM],
        }

    def rows(self) -> list[dict[str, object]]:
        """Return a plain row per item, in the order of first sight."""
        return [_row(record) for record in self._records.values()]

    def _waits(self, item: Item) -> bool:
        """Tell whether the mission still has to do something about the item."""
        record = self._record(item)
        return record.state in OPEN and record.label in self._routes

    def _enter(self, label: str, position: Array) -> Record:
        self._counts[label] += 1
        record = Record(f"{label}-{self._counts[label]}", position, position, self.epoch)
        self._records[record.item] = record
        return record

    def _record(self, item: Item) -> Record:
        try:
            return self._records[item]
        except KeyError:
            known = ", ".join(self._records) or "none"
            raise Fault(f'the ledger knows no item "{item}"; it knows: {known}') from None

    def _change(self, item: Item, state: State) -> Record:
        record = self._record(item)
        record.state = state
        self._report(record)
        return record

    def _disturb(self, centre: Array, radius: float) -> None:
        self._freshness.disturb(np.asarray(centre, dtype=float), radius)
        self._empty_looks = 0

    def _bin_at(self, position: Array) -> str | None:
        return next((name for name, bin in self._bins.items() if bin.contains(position)), None)

    def _recognize_in_bins(self, inside: Sequence[tuple[str, Array]]) -> None:
        """Find dropped items again that fell into a bin that is right for them.

        More objects of a class in one of its bins than were let go there can only be ones that fell.
        """
        shown = Counter((label, self._bin_at(position)) for label, position in inside)
        for record in self._records.values():
            if record.state is not State.DROPPED:
                continue
            label = record.label
            for bin in self._routes.get(label, ()):
                there = sum(r.bin == bin and r.label == label for r in self._records.values())
                if shown[label, bin] > there:
                    self.placed(record.item, bin)
                    break

    def _emit_look(self, detections: Detections, positions: Sequence[Array]) -> None:
        frame = detections.frame
        found = [
            {
                "label": detection.label,
                "confidence": round(detection.confidence, 4),
                "box": [round(float(edge), 2) for edge in detection.box],
                "position": [round(float(value), 4) for value in position],
            }
            for detection, position in zip(detections.found, positions, strict=True)
        ]
        self._emit(
            "look", frame=frame.id, camera=frame.camera, view=detections.view, found=found, frame_object=frame
        )

    def _report(self, record: Record) -> None:
        self._emit("item", **_row(record))


def _row(record: Record) -> dict[str, object]:
    return {
        "item": record.item,
        "label": record.label,
        "state": record.state.value,
        "position": [round(float(value), 4) for value in record.position],
        "looks": record.looks,
        "attempts": record.attempts,
        "bin": record.bin,
        "why": record.why,
    }
