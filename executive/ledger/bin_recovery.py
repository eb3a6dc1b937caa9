"""Recovery of bin contents from images, because the journal of a resumed run may lack tool commands.

A look is an image with its detections.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator
from statistics import median_low

from executive.cell.detection import Detections
from executive.ledger.belief import CONFIRMATION_LOG_ODDS, Belief
from executive.ledger.bin_contents import BinContents, BinNameByObservation
from executive.ledger.item import ItemRecord, State


class BinRecovery:
    """Finds objects in the bins that are missing from the ledger, and records items for these objects.

    Args:
        bins: Contents of the bins according to the ledger.
    """

    def __init__(self, bins: BinContents) -> None:
        self._bins, self._records = bins, bins.records
        self._object_counts: dict[str, list[Counter[str]]] = defaultdict(list)
        """For each bin name: one counter per look, with the number of detected objects of each class."""

    def add_look(self, look: Detections, bin_names: BinNameByObservation) -> None:
        """Count the confident detections in each bin (`bin_names`) whose floor the look shows completely."""
        for name in self._bins.bins:
            if self._bins.is_floor_visible(name, look):
                observed_objects = [entry for entry in bin_names if bin_names[entry] == name]
                labels = (entry.detection.label for entry in observed_objects if entry.is_confident)
                self._object_counts[name].append(Counter(labels))

    def record_bin_contents(self, change_count: int) -> None:
        """Record an item in each bin for each object that the ledger does not know.

        The item is a dropped, untracked item of the same class, or else a new item. The item is placed if the
        bin is permitted for the class, and rejected otherwise. `change_count`: number of changes so far.
        """
        found_items: list[ItemRecord] = []
        for label, bin_name in self._find_unknown_objects():
            candidates = (
                item
                for item in self._records.filter_by_state(State.DROPPED)
                if item.is_untracked and item.detected_label == label and item not in found_items
            )
            record = next(candidates, None)
            if record is None:
                belief = Belief(label, CONFIRMATION_LOG_ODDS, is_confirmed=True)
                position = self._bins.bins[bin_name].position
                record = self._records.add(belief, position, change_count, 0.0, was_place_empty=True)
            found_items.append(record)
            if bin_name in self._bins.routes.get(record.label, ()):
                record.reason = "found in the bin when the run was resumed"
                self._records.set_placed(record, bin_name)
            else:
                self._records.reject(record, f"found in {bin_name} when the run was resumed")

    def _find_unknown_objects(self) -> Iterator[tuple[str, str]]:
        """For each object that lies in a bin and has no item in the ledger, yield its class and bin name.

        The number of objects of a class is the median over the looks. The number of unknown objects of a
        class is the number of objects minus the number of items of the class in the bin. The total number of
        unknown objects is limited to the number of objects minus the number of items in the bin. Classes with
        a route to the bin have priority: an object of another class may be a known item with a wrongly
        detected class, and must not be rejected.
        """
        for bin_name, counts in self._object_counts.items():
            labels = set().union(*counts)
            detected_counts = {label: median_low(count[label] for count in counts) for label in labels}
            max_unknown_count = sum(detected_counts.values()) - self._bins.count_objects_in(bin_name)
            wrong_labels = {label for label in labels if bin_name not in self._bins.routes.get(label, ())}
            for label in sorted(labels, key=lambda label: (label in wrong_labels, label)):
                key = (label, bin_name)
                known_count = sum((item.detected_label, item.bin) == key for item in self._records)
                unknown_count = max(min(detected_counts[label] - known_count, max_unknown_count), 0)
                max_unknown_count -= unknown_count
                yield from [(label, bin_name)] * unknown_count
