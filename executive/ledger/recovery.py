"""Recovery of the items that the tool may have moved after the last event of an incomplete journal."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping
from statistics import median_low

from executive.cell.detection import Detections, Observation
from executive.ledger.belief import LOG_ODDS_OF_PROOF, Belief
from executive.ledger.bins import Bins
from executive.ledger.item import Record, State
from executive.ledger.records import Records


class Recovery:
    """Search for items that the tool may have moved while nothing was recorded, on the table and in the bins.

    Args:
        records: All items.
        bins: The bins.
    """

    def __init__(self, records: Records, bins: Bins) -> None:
        self._records, self._bins = records, bins
        self._looks: dict[str, list[Counter[str]]] = defaultdict(list)

    def search(self, records: Collection[Record], epoch: int) -> None:
        """Set items to DROPPED, so that looks search for them on the table and in the bins.

        `epoch` is the number of changes of the table so far.
        """
        for record in records:
            record.epoch, record.is_untracked = epoch, True
            record.bin_log_odds.clear()
            self._records.change(record, State.DROPPED)

    def add(self, look: Detections, content: Mapping[Observation, str | None]) -> None:
        """Count the objects that a look has shown in the bins that it has searched.

        Args:
            look: A look at the whole image.
            content: Bin of each observation, or None.
        """
        for name in self._bins.bins:
            if self._bins.is_searched(name, look):
                inside = (seen for seen, bin in content.items() if bin == name and seen.confident)
                self._looks[name].append(Counter(seen.detection.label for seen in inside))

    def record_bin_contents(self, epoch: int) -> None:
        """Record a placed or rejected item for each object in a bin beyond the known items there.

        `epoch` is the number of changes of the table so far.
        """
        for label, bin in self._find_surplus():
            searched = (item for item in self._records if item.state is State.DROPPED and item.is_untracked)
            record = next((item for item in searched if item.label == label), None)
            if record is None:
                belief = Belief(label, LOG_ODDS_OF_PROOF, is_proved=True)
                record = self._records.add(belief, self._bins.bins[bin].position, epoch, 0.0, True)
            if bin in self._bins.routes.get(label, ()):
                record.reason = "found there when the run was resumed"
                self._records.place(record, bin)
            else:
                self._records.reject(record, f"found in {bin} when the run was resumed")

    def _find_surplus(self) -> Iterator[tuple[str, str]]:
        """Yield the class and the bin of each object in a bin beyond the known items there.

        The median of the looks counts. Classes for which the bin is right come first, because a look may show
        a known item with a wrong class.
        """
        for bin, looks in self._looks.items():
            shown = {label: median_low(look[label] for look in looks) for label in set().union(*looks)}
            surplus = sum(shown.values()) - self._bins.count_in(bin, self._records)
            right = {label for label in shown if bin in self._bins.routes.get(label, ())}
            for label in [*sorted(right), *sorted(shown.keys() - right)]:
                known = sum(item.bin == bin and item.label == label for item in self._records)
                count = max(min(shown[label] - known, surplus), 0)
                surplus -= count
                yield from [(label, bin)] * count
