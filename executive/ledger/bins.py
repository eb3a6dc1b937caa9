"""What lies in bins: nothing to pick, and where a dropped item may be found again."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.config import LedgerConfig
from executive.cell.detection import Detections, Observation
from executive.cell.objects import Item
from executive.cell.protocols import Routes
from executive.geometry import Array
from executive.ledger.item import Record, State
from executive.ledger.update import SURE

WALL = 0.035
"""How far from a bin's wall the middle of something has to come down to be in it for sure [m]: its radius."""
FELL = math.log(0.95 / 0.05)
"""Log odds that something is in a bin that it fell into by all one knows of its fall."""
CORNERS = np.array([(0, 0, 0), (1, 1, 0), (1, -1, 0), (-1, 1, 0), (-1, -1, 0)])
"""Places on a bin's floor that a look has to search, in halves of its length and width."""


@dataclass(frozen=True, eq=False)
class Bins:
    """Tells what lies in which bin, by the items that were let go there.

    Attributes:
        config: When what is believed.
        bins: By name.
        routes: Class label to the bins that are right for it.
        records: All items by name, as they are at any time.
    """

    config: LedgerConfig
    bins: Mapping[str, Bin]
    routes: Routes
    records: Mapping[Item, Record]

    def objects_in(self, bin: str) -> int:
        """Return how many objects were let go in `bin` so far, or must have fallen into it."""
        return sum(bin in (record.bin, self.believed(record)) for record in self.records.values())

    def at(self, observation: Observation, bias: float) -> str | None:
        """Return the bin in which an observed object lies, None if there is none.

        An object just beside a bin counts as in it, if something was let go there.
        """
        error = math.hypot(observation.std, bias)
        for name, bin in self.bins.items():
            if bin.contains(observation.position, SURE * error if self.objects_in(name) else 0.0):
                return name
        return None

    def let_fall(self, record: Record, landing: Array | None) -> None:
        """Note where something fell that the tool lost; None: nobody knows."""
        record.fallen.clear()
        for bin in self.routes.get(record.label, ()):
            if landing is not None and self.bins[bin].contains(landing, -WALL):
                record.fallen[bin] = FELL

    def believed(self, record: Record) -> str | None:
        """Return the bin that a dropped item must have fallen into, or None where that is not sure enough."""
        if record.state is not State.DROPPED:
            return None
        return next((bin for bin, odds in record.fallen.items() if odds >= FELL), None)

    def fallen(
        self, look: Detections, inside: Iterable[tuple[Observation, str | None]]
    ) -> Iterator[tuple[Record, str]]:
        """Yield the dropped items that a look finds in a bin that is right for them, and that bin.

        More objects of a class in one of its bins than were let go there can only be ones that fell, once
        it is as good as certain that the detector did not invent them.

        Args:
            look: A look at everything the camera sees.
            inside: Each confident observation and the bin in which it lies, or None.
        """
        # What leans on a wall from inside may have its middle over it.
        shown = Counter(
            (observation.detection.label, bin)
            for observation, bin in inside
            if bin is not None and self.bins[bin].contains(observation.position, BIN_THICKNESS)
        )
        for record in self.records.values():
            if record.state is not State.DROPPED:
                continue
            label = record.label
            for bin in self.routes.get(label, ()):
                there = sum(r.bin == bin and r.label == label for r in self.records.values())
                more = shown[label, bin] > there
                if more or self._is_searched(bin, look):
                    record.fell(bin, more, look.error_rates)
                if record.fallen[bin] >= -math.log(self.config.overlooked):
                    yield record, bin
                    break

    def _is_searched(self, name: str, look: Detections) -> bool:
        """Tell whether a look shows the whole floor of a bin."""
        bin = self.bins[name]
        reach = np.append(bin.size[:2] / 2 - WALL, 0.0)
        return bool(look.is_searched(bin.position + reach * CORNERS).all())
