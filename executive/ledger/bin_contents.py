"""Contents of the bins by several looks, for a run that is resumed with an incomplete journal."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping
from statistics import median_low

from executive.cell.detection import Detections, Observation
from executive.ledger.bins import Bins
from executive.ledger.item import Record


class BinContents:
    """Objects that full looks have shown in bins.

    Args:
        bins: The bins.
    """

    def __init__(self, bins: Bins) -> None:
        self._bins = bins
        self._looks: dict[str, list[Counter[str]]] = defaultdict(list)

    def add(self, look: Detections, content: Mapping[Observation, str | None]) -> None:
        """Count the objects that a look has shown in the bins that it has searched.

        Args:
            look: A look at the whole image.
            content: Bin of each observation, or None.
        """
        for name in self._bins.bins:
            if self._bins.is_searched(name, look):
                inside = (one for one, bin in content.items() if bin == name and one.confident)
                self._looks[name].append(Counter(one.detection.label for one in inside))

    def find_surplus(self, records: Collection[Record]) -> Iterator[tuple[str, str]]:
        """Yield the class and the bin of each object in a bin that is none of the items there.

        The median of the looks counts. Objects of a class for which the bin is right come first: a look may
        take an item for one of another class.
        """
        for bin, looks in self._looks.items():
            shown = {label: median_low(look[label] for look in looks) for label in set().union(*looks)}
            surplus = sum(shown.values()) - self._bins.count_in(bin, records)
            wrong = {label for label in shown if bin not in self._bins.routes.get(label, ())}
            for is_wrong, label in sorted((label in wrong, label) for label in shown):
                del is_wrong
                known = sum(one.bin == bin and one.label == label for one in records)
                count = max(min(shown[label] - known, surplus), 0)
                surplus -= count
                yield from [(label, bin)] * count
