"""Collection of the records of all items, which emits each change of an item as an event."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from executive.cell.objects import Item
from executive.errors import Fault
from executive.events import Emit
from executive.geometry import Array
from executive.ledger.belief import Belief
from executive.ledger.item import Record, State


class Records:
    """The items of a run, in the order of the first detection.

    Args:
        emit: Takes the events.
    """

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self._records: dict[Item, Record] = {}
        self._name_counts: Counter[str] = Counter()

    def __iter__(self) -> Iterator[Record]:
        """Yield all items; items may be added and removed during the iteration."""
        return iter(list(self._records.values()))

    def find(self, item: Item) -> Record:
        """Return the record of an item.

        Raises:
            Fault: There is no item of this name.
        """
        try:
            return self._records[item]
        except KeyError:
            known = ", ".join(self._records) or "none"
            raise Fault(f'the ledger knows no item "{item}"; it knows: {known}') from None

    def add(self, belief: Belief, position: Array, epoch: int, stamp: float, has_appeared: bool) -> Record:
        """Add an item, named by its class and a number, and return it; see `Record` for the arguments."""
        label = belief.first_label
        self._name_counts[label] += 1
        record = Record(f"{label}-{self._name_counts[label]}", belief, position, epoch, stamp, has_appeared)
        self._records[record.item] = record
        return record

    def remove(self, record: Record) -> None:
        """Remove an item that no event has reported."""
        del self._records[record.item]

    def report(self, record: Record) -> None:
        """Emit the present state of an item."""
        self._emit(record.summary)

    def change(self, record: Record, state: State) -> None:
        """Change the state of an item."""
        record.state = state
        self.report(record)

    def place(self, record: Record, bin: str) -> None:
        """Record that an item is in a bin."""
        record.bin = bin
        self.change(record, State.PLACED)

    def reject(self, record: Record, reason: str) -> None:
        """Reject an item; a held or dropped item keeps its state, with the reason of the later rejection."""
        record.reason = f"{reason}: {record.contradiction}" if record.contradiction else reason
        self.change(record, record.state if record.state in (State.HELD, State.DROPPED) else State.REJECTED)
