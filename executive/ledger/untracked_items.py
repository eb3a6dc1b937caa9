"""Recovery of items that the tool may have moved after the last event of an incomplete journal."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from statistics import median_low

from executive.cell.detection import Detections, Observation
from executive.ledger.belief import MIN_LOG_ODDS_OF_PROOF, Belief
from executive.ledger.bin_contents import BinContents
from executive.ledger.item import State
from executive.ledger.records import ItemRecords


class Recovery:
    """Recovery of the items that the tool may have moved in actions that are missing in the journal.

    Args:
        records: All items.
        bins: Contents of the bins.
    """

    def __init__(self, records: ItemRecords, bins: BinContents) -> None:
        self._records, self._bins = records, bins
        self._counts_by_bin: dict[str, list[Counter[str]]] = defaultdict(list)
        """Number of visible objects of each class, by bin, in each look that shows the whole bin."""

    def add_look(self, look: Detections, bin_names: Mapping[Observation, str | None]) -> None:
        """Count the objects in each bin whose floor is completely visible.

        `look` contains the detections in the whole image. `bin_names` contains the bin of each observed
        object, or None.
        """
        for name in self._bins.bins:
            if self._bins.is_floor_visible(name, look):
                observed_objects = [entry for entry in bin_names if bin_names[entry] == name]
                labels = (entry.detection.label for entry in observed_objects if entry.is_confident)
                self._counts_by_bin[name].append(Counter(labels))

    def record_bin_contents(self, change_count: int) -> None:
        """Record a placed or rejected item for each unknown object in a bin.

        `change_count` is the number of actions so far that may have moved objects on the table.
        """
        for label, bin_name in self._find_unknown_objects():
            untracked_items = (item for item in self._records if item.is_untracked and item.label == label)
            record = next((item for item in untracked_items if item.state is State.DROPPED), None)
            if record is None:
                belief = Belief(label, MIN_LOG_ODDS_OF_PROOF, is_proved=True)
                position = self._bins.bins[bin_name].position
                record = self._records.add(belief, position, change_count, 0.0, has_appeared=True)
            if bin_name in self._bins.routes.get(label, ()):
                record.reason = "found in the bin when the run was resumed"
                self._records.set_placed(record, bin_name)
            else:
                self._records.reject(record, f"found in {bin_name} when the run was resumed")

    def _find_unknown_objects(self) -> Iterator[tuple[str, str]]:
        """Yield class and bin name of each object in a bin that is not an item of the ledger.

        The number of visible objects of a class is the median over the looks. The limit of unknown objects in
        a bin is the number of visible objects minus the number of tracked items. Classes that belong in the
        bin use up this limit first, so that an item that was detected with a wrong class is not rejected.
        """
        for bin_name, look_counts in self._counts_by_bin.items():
            labels = set().union(*look_counts)
            visible_counts = {label: median_low(counts[label] for counts in look_counts) for label in labels}
            tracked_count = self._bins.count_objects_in(bin_name, self._records)
            unknown_count = sum(visible_counts.values()) - tracked_count
            forbidden_labels = {label for label in labels if bin_name not in self._bins.routes.get(label, ())}
            for label in sorted(labels, key=lambda label: (label in forbidden_labels, label)):
                known_count = sum((item.label, item.bin) == (label, bin_name) for item in self._records)
                count = max(min(visible_counts[label] - known_count, unknown_count), 0)
                unknown_count -= count
                yield from [(label, bin_name)] * count
