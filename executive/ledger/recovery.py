"""Recovery of items that the tool may have moved after the last event of an incomplete journal."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping
from statistics import median_low

from executive.cell.detection import Detections, Observation
from executive.ledger.belief import LOG_ODDS_OF_PROOF, Belief
from executive.ledger.bin_contents import BinContents
from executive.ledger.item import Record, State
from executive.ledger.records import Records


class Recovery:
    """Search, on the table and in the bins, for items that the tool may have moved without a record.

    Args:
        records: All items.
        bins: Contents of the bins.
    """

    def __init__(self, records: Records, bins: BinContents) -> None:
        self._records, self._bins = records, bins
        self._label_counts_by_bin: dict[str, list[Counter[str]]] = defaultdict(list)
        """Number of visible objects of each class, by bin, in each look that shows the whole bin."""

    def mark_as_dropped(self, records: Collection[Record], change_count: int) -> None:
        """Set items to DROPPED, so that looks search for them on the table and in the bins.

        `change_count` is the number of changes of the table so far.
        """
        for record in records:
            record.change_count, record.is_untracked = change_count, True
            record.bin_log_odds.clear()
            self._records.change_state(record, State.DROPPED)

    def add_look(self, look: Detections, bin_by_observation: Mapping[Observation, str | None]) -> None:
        """Count the objects in each bin whose whole floor is visible in a look.

        Args:
            look: Detections in a whole image.
            bin_by_observation: Name of the bin in which each observed object lies, or None.
        """
        for name in self._bins.bins:
            if self._bins.is_floor_visible(name, look):
                inside = (seen for seen, bin in bin_by_observation.items() if bin == name and seen.confident)
                self._label_counts_by_bin[name].append(Counter(seen.detection.label for seen in inside))

    def record_bin_contents(self, change_count: int) -> None:
        """Record a placed or rejected item for each object in a bin that is no known item of the bin.

        `change_count` is the number of changes of the table so far.
        """
        for label, bin in self._find_unknown_objects():
            untracked = (item for item in self._records if item.state is State.DROPPED and item.is_untracked)
            record = next((item for item in untracked if item.label == label), None)
            if record is None:
                belief = Belief(label, LOG_ODDS_OF_PROOF, is_proved=True)
                position = self._bins.bins[bin].position
                record = self._records.add(belief, position, change_count, 0.0, appeared_during_run=True)
            if bin in self._bins.routes.get(label, ()):
                record.reason = "found in the bin when the run was resumed"
                self._records.set_placed(record, bin)
            else:
                self._records.reject(record, f"found in {bin} when the run was resumed")

    def _find_unknown_objects(self) -> Iterator[tuple[str, str]]:
        """Yield class and bin of each object in a bin that is no known item of the bin.

        The number of visible objects is the median over the looks. Classes with a route to the bin come
        first, because a look may show a known item with a wrong class.
        """
        for bin, looks in self._label_counts_by_bin.items():
            counts = {label: median_low(look[label] for look in looks) for label in set().union(*looks)}
            unknown_count = sum(counts.values()) - self._bins.count_objects_in(bin, self._records)
            permitted = {label for label in counts if bin in self._bins.routes.get(label, ())}
            for label in [*sorted(permitted), *sorted(counts.keys() - permitted)]:
                known_count = sum(item.bin == bin and item.label == label for item in self._records)
                count = max(min(counts[label] - known_count, unknown_count), 0)
                unknown_count -= count
                yield from [(label, bin)] * count
