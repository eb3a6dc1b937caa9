"""Collection of the records of all items; each change of an item is emitted as an event."""

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
    """Records of the items of a run, in the order of the first detection.

    Args:
        emit: Function that receives the events.
    """

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self._records: dict[Item, Record] = {}
        self._name_counts: Counter[str] = Counter()

    def __iter__(self) -> Iterator[Record]:
        """Return an iterator over all records; records may be added and removed during the iteration."""
        return iter(list(self._records.values()))

    def find(self, item: Item) -> Record:
        """Return the record of an item.

        Raises:
            Fault: No item has this name.
        """
        try:
            return self._records[item]
        except KeyError:
            known = ", ".join(self._records) or "none"
            raise Fault(f'the ledger knows no item "{item}"; it knows: {known}') from None

    def add(
        self, belief: Belief, position: Array, change_count: int, stamp: float, *, appeared_during_run: bool
    ) -> Record:
        """Add an item with the name `<class>-<number>` at a position `(3,)` [m], and return its record.

        `change_count` is the number of changes of the table before the first detection, `stamp` the time of
        the detection [s]; `appeared_during_run` is True if earlier looks had found the position empty.
        """
        label = belief.first_label
        self._name_counts[label] += 1
        name = f"{label}-{self._name_counts[label]}"
        record = Record(name, belief, position, change_count, stamp, appeared_during_run)
        self._records[name] = record
        return record

    def remove(self, record: Record) -> None:
        """Remove an item; no event may have reported the item before."""
        del self._records[record.item]

    def emit_item(self, record: Record) -> None:
        """Emit the present state of an item as an event."""
        self._emit(record.summary)

    def change_state(self, record: Record, state: State) -> None:
        """Set the state of an item, and emit the item."""
        record.state = state
        self.emit_item(record)

    def set_placed(self, record: Record, bin: str) -> None:
        """Set the state of an item to PLACED in the bin with the name `bin`."""
        record.bin = bin
        self.change_state(record, State.PLACED)

    def reject(self, record: Record, reason: str) -> None:
        """Reject an item; a held or dropped item keeps its state until it lies on the table again."""
        record.reason = f"{reason}: {record.last_contradiction}" if record.last_contradiction else reason
        is_off_table = record.state in (State.HELD, State.DROPPED)
        self.change_state(record, record.state if is_off_table else State.REJECTED)
