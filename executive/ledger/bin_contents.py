"""Contents of the bins: counts of the objects, and dropped items that probably fell into a bin."""

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
"""Minimum distance from the walls at which an object that lands in a bin certainly stays there [m]."""
LOG_ODDS_FELL_IN_BIN = math.log(0.95 / 0.05)
"""Prior log odds that a dropped item lies in the bin over which it was predicted to land."""
BIN_AREA_FRACTION = 0.04
"""Probability that a false detection lies in a given bin: area of the bin as a fraction of the image."""
FLOOR_POINTS = np.array([(0, 0, 0), (1, 1, 0), (1, -1, 0), (-1, 1, 0), (-1, -1, 0)])
"""Points of a bin's floor that must be visible, in units of half its length and half its width `(5, 3)`."""


@dataclass(frozen=True, eq=False)
class BinContents:
    """Bins of the cell, the permitted bins of each class, and rules for the items in the bins.

    Attributes:
        config: Thresholds of the ledger, from the cell file.
        bins: Bins by name.
        routes: Names of the permitted bins by class.
    """

    config: LedgerConfig
    bins: Mapping[str, Bin]
    routes: Routes

    def count_objects_in(self, bin: str, records: Iterable[Record]) -> int:
        """Return the number of items that were released in a bin or have probably fallen into the bin."""
        return sum(bin in (record.bin, find_probable_bin(record)) for record in records)

    def find_bin(self, observation: Observation, bias_std: float, records: Collection[Record]) -> str | None:
        """Return the name of the bin in which an observed object lies, or None.

        Bins that contain items are enlarged by the measurement error; `bias_std` is the standard deviation of
        the systematic measurement error along each axis [m].
        """
        error = MAX_STANDARD_DEVIATIONS * math.hypot(observation.std, bias_std)
        for name, bin in self.bins.items():
            if bin.contains(observation.position, error if self.count_objects_in(name, records) else 0.0):
                return name
        return None

    def set_prior_log_odds(self, record: Record, landing: Array | None) -> None:
        """Set the prior log odds that a dropped item lies in each permitted bin.

        `landing` is the predicted landing position `(3,)` [m], or None if the position is unknown.
        """
        record.bin_log_odds.clear()
        for bin in self.routes.get(record.label, ()):
            if landing is not None and self.bins[bin].contains(landing, -WALL_MARGIN):
                record.bin_log_odds[bin] = LOG_ODDS_FELL_IN_BIN

    def place_dropped_items(
        self,
        look: Detections,
        bin_by_observation: Mapping[Observation, str | None],
        records: Collection[Record],
    ) -> list[Record]:
        """Set the state of dropped items that a look shows in a permitted bin to PLACED; return these items.

        If a look shows more objects of a class in a bin than known items, the rest are dropped items.

        Args:
            look: Detections in a whole image.
            bin_by_observation: Name of the bin in which each observed object lies, or None.
            records: All items.
        """
        # The centre of an object that leans on a wall from the inside may lie over the wall.
        visible_counts = Counter(
            (seen.detection.label, bin)
            for seen, bin in bin_by_observation.items()
            if seen.confident and bin and self.bins[bin].contains(seen.position, BIN_THICKNESS)
        )
        placed = []
        for record in (record for record in records if record.state is State.DROPPED):
            for bin in self.routes.get(record.label, ()):
                known_count = sum(other.bin == bin and other.label == record.label for other in records)
                is_visible = visible_counts[record.label, bin] > known_count
                if is_visible or self.is_floor_visible(bin, look):
                    update_bin_log_odds(record, bin, look.error_rates, is_visible=is_visible)
                if record.bin_log_odds[bin] >= -math.log(self.config.max_miss_probability):
                    record.bin = bin
                    record.set_state(State.PLACED, "")
                    placed.append(record)
                    break
        return placed

    def is_floor_visible(self, bin_name: str, look: Detections) -> bool:
        """Return True if the whole floor of a bin is visible in a look and not occluded by the arm."""
        bin = self.bins[bin_name]
        half_size = np.append(bin.size[:2] / 2 - WALL_MARGIN, 0.0)
        return bool(look.is_searched(bin.position + half_size * FLOOR_POINTS).all())


def find_probable_bin(record: Record) -> str | None:
    """Return the bin that contains a dropped item with a probability of at least 95 %, or None."""
    if record.state is not State.DROPPED:
        return None
    log_odds_by_bin = record.bin_log_odds.items()
    return next((bin for bin, log_odds in log_odds_by_bin if log_odds >= LOG_ODDS_FELL_IN_BIN), None)


def update_bin_log_odds(record: Record, bin: str, rates: ErrorRates, *, is_visible: bool) -> None:
    """Update, with one look, the log odds that a dropped item lies in a bin; they never fall below 0.

    `is_visible` is True if the look shows more objects of the item's class in the bin than known items.
    """
    miss_rate, false_positive_rate = rates.miss_rate, rates.false_detections * BIN_AREA_FRACTION
    likelihood_ratio = (1.0 - miss_rate) / false_positive_rate if is_visible else miss_rate
    record.bin_log_odds[bin] = max(0.0, record.bin_log_odds[bin] + math.log(likelihood_ratio))
