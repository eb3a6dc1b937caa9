"""Contents of the bins: number of objects, and dropped items that a bin may contain."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.config import LedgerConfig
from executive.cell.detection import Detections, Observation
from executive.cell.error_rates import ErrorRates
from executive.cell.protocols import Routes
from executive.geometry import Array
from executive.ledger.association import MAX_STANDARD_DEVIATIONS
from executive.ledger.item import Record, State

WALL_MARGIN = 0.035
"""Minimum distance from the walls at which an object that lands in a bin is certain to stay there [m]."""
LOG_ODDS_FELL_IN_BIN = math.log(0.95 / 0.05)
"""Prior log odds that a dropped item lies in the bin over which it was predicted to land."""
BIN_AREA_SHARE = 0.04
"""Probability that a false detection lies in a given bin: its share of the searched area."""
FLOOR_POINTS = np.array([(0, 0, 0), (1, 1, 0), (1, -1, 0), (-1, 1, 0), (-1, -1, 0)])
"""Points of a bin's floor that a look must show, in halves of its length and width."""


@dataclass(frozen=True, eq=False)
class Bins:
    """Bins of the cell, and the bins that are right for each class.

    Attributes:
        config: Limits of the cell file.
        bins: Bins by name.
        routes: Names of the right bins by class.
    """

    config: LedgerConfig
    bins: Mapping[str, Bin]
    routes: Routes

    def count_in(self, bin: str, records: Iterable[Record]) -> int:
        """Return the number of items that were released in a bin or are believed to have fallen into it."""
        return sum(bin in (record.bin, find_believed_bin(record)) for record in records)

    def find_bin(self, observation: Observation, bias: float, records: Collection[Record]) -> str | None:
        """Return the bin in which an observed object lies, or None.

        Bins with content are enlarged by the measurement error. `bias` is the systematic error [m].
        """
        error = MAX_STANDARD_DEVIATIONS * math.hypot(observation.std, bias)
        for name, bin in self.bins.items():
            if bin.contains(observation.position, error if self.count_in(name, records) else 0.0):
                return name
        return None

    def set_prior(self, record: Record, landing: Array | None) -> None:
        """Set the prior log odds that a dropped item lies in a bin.

        `landing` `(3,)` [m] is the predicted position, or None if it is unknown.
        """
        record.bin_log_odds.clear()
        for bin in self.routes.get(record.label, ()):
            if landing is not None and self.bins[bin].contains(landing, -WALL_MARGIN):
                record.bin_log_odds[bin] = LOG_ODDS_FELL_IN_BIN

    def find_dropped(
        self, look: Detections, content: Mapping[Observation, str | None], records: Collection[Record]
    ) -> list[Record]:
        """Set dropped items that a look shows in a bin of their class to PLACED, and return these items.

        If a look shows more objects of a class in a bin than were released there, the others have fallen in.

        Args:
            look: A look at the whole image.
            content: Bin of each observation, or None.
            records: All items.
        """
        # The centre of an object that leans on a wall from the inside may lie over the wall.
        shown = Counter(
            (seen.detection.label, bin)
            for seen, bin in content.items()
            if seen.confident and bin and self.bins[bin].contains(seen.position, BIN_THICKNESS)
        )
        found = []
        for record in (record for record in records if record.state is State.DROPPED):
            for bin in self.routes.get(record.label, ()):
                known = sum(other.bin == bin and other.label == record.label for other in records)
                is_shown = shown[record.label, bin] > known
                if is_shown or self.is_searched(bin, look):
                    update_bin_log_odds(record, bin, look.error_rates, is_shown=is_shown)
                if record.bin_log_odds[bin] >= -math.log(self.config.overlooked):
                    record.bin = bin
                    record.set_state(State.PLACED, "")
                    found.append(record)
                    break
        return found

    def is_searched(self, name: str, look: Detections) -> bool:
        """Return True if a look shows the whole floor of a bin."""
        bin = self.bins[name]
        half_size = np.append(bin.size[:2] / 2 - WALL_MARGIN, 0.0)
        return bool(look.is_searched(bin.position + half_size * FLOOR_POINTS).all())


def find_believed_bin(record: Record) -> str | None:
    """Return the bin that contains a dropped item with a probability of at least 95 %, or None."""
    if record.state is not State.DROPPED:
        return None
    return next((bin for bin, odds in record.bin_log_odds.items() if odds >= LOG_ODDS_FELL_IN_BIN), None)


def update_bin_log_odds(record: Record, bin: str, rates: ErrorRates, *, is_shown: bool) -> None:
    """Update, by a look, the log odds that a dropped item lies in a bin; the minimum is 0.

    `is_shown` is True if the look showed an object that was not released in the bin.
    """
    ratio = (1.0 - rates.misses) / (rates.invented * BIN_AREA_SHARE) if is_shown else rates.misses
    record.bin_log_odds[bin] = max(0.0, record.bin_log_odds[bin] + math.log(ratio))
