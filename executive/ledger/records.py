"""Collection of the records of all items; each change of an item is emitted as an event."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from executive.cell.objects import Item
from executive.errors import Fault
from executive.events import Emit
from executive.geometry import Array
from executive.ledger.belief import Belief
from executive.ledger.item import ItemRecord, State


class ItemRecords:
    """Records of the items of a run, in the order of the first detection.

    Args:
        emit: Function that receives the events.
    """

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self._records: dict[Item, ItemRecord] = {}
        self._name_counts: Counter[str] = Counter()

    def __iter__(self) -> Iterator[ItemRecord]:
        """Return an iterator over all records; records may be added and removed during the iteration."""
        return iter(list(self._records.values()))

    def find(self, item: Item) -> ItemRecord:
        """Return the record of an item.

        Raises:
            Fault: No item has this name.
        """
        if item not in self._records:
            known_items = ", ".join(self._records) or "none"
            raise Fault(f'the ledger knows no item "{item}"; it knows: {known_items}')
        return self._records[item]

    def filter_by_state(self, *states: State) -> list[ItemRecord]:
        """Return the records of all items in one of the given states."""
        return [record for record in self if record.state in states]

    def add(
        self, belief: Belief, position: Array, change_count: int, stamp: float, *, was_place_empty: bool
    ) -> ItemRecord:
        """Add an item with the name `<class>-<number>` and return its record.

        `position` `(3,)` [m], `change_count` and `stamp` [s] are values of the first detection.
        """
        label = belief.first_label
        self._name_counts[label] += 1
        name = f"{label}-{self._name_counts[label]}"
        self._records[name] = ItemRecord(name, belief, position, change_count, stamp, was_place_empty)
        return self._records[name]

    def remove(self, record: ItemRecord) -> None:
        """Remove an item that no event has reported yet."""
        del self._records[record.item]

    def emit(self, *records: ItemRecord) -> None:
        """Emit the current state of each given item as an event."""
        for record in records:
            self._emit(record.event)

    def change_state(self, record: ItemRecord, state: State) -> None:
        """Set the state of an item, and emit the item."""
        record.state = state
        self.emit(record)

    def set_placed(self, record: ItemRecord, bin_name: str) -> None:
        """Set the state of an item to PLACED in a bin, and emit the item."""
        record.bin, record.was_taken_away = bin_name, False
        self.change_state(record, State.PLACED)

    def reject(self, record: ItemRecord, reason: str) -> None:
        """Reject an item; a held or dropped item keeps its state until a look shows the item on the table."""
        record.reason = f"{reason}: {record.last_contradiction}" if record.last_contradiction else reason
        is_off_table = record.state in (State.HELD, State.DROPPED)
        self.change_state(record, record.state if is_off_table else State.REJECTED)
