"""What became of every item so far, as a person wants to see it."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

from executive.record.entry import OldEvent as Event


@dataclass(frozen=True)
class Row:
    """One item.

    Attributes:
        item: Its name.
        label: Its class.
        state: Its state.
        bin: The bin that it was placed in, or "".
        why: Reason of its state, or "".
        place: Its place on the table in words if it was left there, or "".
    """

    item: str
    label: str
    state: str
    bin: str
    why: str
    place: str = ""


class ItemTable:
    """Follows the `item` events of a run."""

    def __init__(self) -> None:
        self._rows: dict[str, Row] = {}

    def __call__(self, event: Event) -> Row | None:
        """Take an `item` event; return its row if something a person cares about changed."""
        data = event.data
        row = Row(*(str(data.get(key) or "") for key in ("item", "label", "state", "bin", "why")))
        if row.state in ("rejected", "skipped"):
            row = replace(row, place="x {:.2f} m, y {:.2f} m".format(*data["position"]))
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
                place_and_reason = ": ".join(filter(None, (row.place, row.why)))
                name = f"{row.item} ({place_and_reason})" if place_and_reason and not placed else row.item
                fates[row.bin if placed else row.state].append(name)
        return dict(fates)
