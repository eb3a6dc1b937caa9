"""What became of every item so far, as a person wants to see it."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from executive.events import Event


@dataclass(frozen=True)
class Row:
    """One item: its class, what became of it, where it was placed, and why if it was given up."""

    item: str
    label: str
    state: str
    bin: str
    why: str


class ItemTable:
    """Follows the `item` events of a run."""

    def __init__(self) -> None:
        self._rows: dict[str, Row] = {}

    def __call__(self, event: Event) -> Row | None:
        """Take an `item` event; return its row if something a person cares about changed."""
        data = event.data
        row = Row(*(str(data.get(key) or "") for key in ("item", "label", "state", "bin", "why")))
        if self._rows.get(row.item) == row:
            return None
        self._rows[row.item] = row
        return row

    @property
    def rows(self) -> tuple[Row, ...]:
        """Every item, in the order of first sight."""
        return tuple(self._rows.values())

    def by_fate(self) -> dict[str, list[str]]:
        """Return the items by bin; those not placed by state, with the reason where there is one.

        Of phantoms only the number is told: they are nothing anybody could go and fetch.
        """
        fates: dict[str, list[str]] = defaultdict(list)
        phantoms = sum(row.state == "phantom" for row in self.rows)
        if phantoms:
            fates["phantom"].append(f"{phantoms} seen, and then no more")
        for row in self.rows:
            if row.state != "phantom":
                placed = row.state == "placed"
                name = f"{row.item} ({row.why})" if row.why and not placed else row.item
                fates[row.bin if placed else row.state].append(name)
        return dict(fates)
