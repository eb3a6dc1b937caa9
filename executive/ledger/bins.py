"""What lies in bins: nothing to pick, and where a dropped item may be found again."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from executive.cell import Routes
from executive.cell_config import LedgerConfig
from executive.geometry import Array
from executive.ledger.binding import SURE
from executive.ledger.item import Record, State
from executive.messages import Bin, Detections, Item


class Bins:
    """Tells what lies in which bin, by the items that were let go there.

    Args:
        config: When what is believed.
        bins: By name.
        routes: Class label to the bins that are right for it.
        records: All items by name, as they are at any time.
    """

    def __init__(
        self,
        config: LedgerConfig,
        bins: Mapping[str, Bin],
        routes: Routes,
        records: Mapping[Item, Record],
    ) -> None:
        self._config = config
        self._bins = bins
        self._routes = routes
        self._records = records

    def objects_in(self, bin: str) -> int:
        """Return how many objects were let go in `bin` so far."""
        return sum(record.bin == bin for record in self._records.values())

    def at(self, position: Array, spread: float) -> str | None:
        """Return the bin that something measured with a standard deviation of `spread` [m] lies in, if any.

        What seems to lie just beside a bin is in it, if something was let go there.
        """
        for name, bin in self._bins.items():
            if bin.contains(position, SURE * spread if self.objects_in(name) else 0.0):
                return name
        return None

    def fallen(
        self, look: Detections, positions: Sequence[Array], inside: Iterable[str | None]
    ) -> Iterator[tuple[Record, str]]:
        """Yield the dropped items that a look finds in a bin that is right for them, and that bin.

        More objects of a class in one of its bins than were let go there can only be ones that fell, once
        it is as good as certain that the detector did not invent them.

        Args:
            look: A look at everything the camera sees.
            positions: Where what it found is `(3,)` [m], one to one.
            inside: The bins that these are in or just beside.
        """
        shown = Counter(
            (detection.label, bin)
            for detection, bin, position in zip(look.found, inside, positions, strict=True)
            if bin is not None and self._bins[bin].contains(position)
        )
        for record in self._records.values():
            if record.state is not State.DROPPED:
                continue
            label = record.label
            for bin in self._routes.get(label, ()):
                there = sum(r.bin == bin and r.label == label for r in self._records.values())
                record.fell(bin, shown[label, bin] > there, look.reliability)
                if record.fallen[bin] >= -math.log(self._config.overlooked):
                    yield record, bin
                    break
