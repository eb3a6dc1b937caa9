"""Update of all items with one look: associate, update, count misses, recognize."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.config import LedgerConfig
from executive.cell.detection import Detections, Observation
from executive.ledger.association import associate, find_duplicate, find_moved, may_show
from executive.ledger.belief import ITEM_AREA_SHARE, Belief, viewpoint_of
from executive.ledger.coverage import Coverage
from executive.ledger.item import LYING, REASON_NOT_FOUND, REASON_UNCERTAIN, Record, State
from executive.ledger.records import Records
from executive.ledger.staleness import Staleness

EXPECTED_OBJECTS = 3.0
"""Number of objects expected on the table before the first look, correct to an order of magnitude."""


@dataclass(frozen=True)
class Update:
    """Update of all items with one look.

    Attributes:
        config: Limits of the cell file.
        records: All items; the update adds new ones.
        coverage: Searched areas; the update adds the area of the look.
        staleness: Changes of the table.
        look: The look.
    """

    config: LedgerConfig
    records: Records
    coverage: Coverage
    staleness: Staleness
    look: Detections

    def apply(self, observations: Sequence[Observation]) -> list[Record]:
        """Update the items with the observations on the table, and return the changed items.

        Observations at positions that the robot changed after the image was taken do not count.
        """
        epoch = self.look.frame.epoch
        current = [one for one in observations if self.staleness.is_unchanged(one.position, epoch)]
        known = [record for record in self.records if record.state in LYING]
        seen = self._update_seen(known, [one for one in current if one.confident])
        uncertain = self._update_uncertain(seen, [one for one in current if not one.confident])
        unseen = [record for record in known if record not in (*seen, *uncertain)]
        phantoms = self._update_unseen(
            [record for record in unseen if self.staleness.is_unchanged(record.position, epoch)]
        )
        # Further looks at a rejected item bring no further information.
        self.coverage.update(self.look, [one.position for one in uncertain if one.state is State.SEEN])
        moved = self._recognize_moved(seen)
        duplicates = self._remove_duplicates(seen)
        return list(dict.fromkeys([*seen, *uncertain, *phantoms, *moved, *duplicates]))

    def _update_seen(self, known: Sequence[Record], observations: Sequence[Observation]) -> list[Record]:
        """Update known items with confident observations, add new ones, and return both."""
        # An improbable item that may have been moved is not the object that lies there now.
        known = [one for one in known if self.staleness.is_settled(one) or one.belief.probability >= 0.5]
        matches = associate(observations, known, self.staleness, self.config.gate)
        unmatched = [record for record in known if record not in matches.values()]
        rates, viewpoint = self.look.error_rates, viewpoint_of(self.look)
        seen = []
        for one in observations:
            # The less probable an overlooked object, the more probable a false detection.
            record = matches.get(one) or self._add(one, self._find_prior_odds(one) / rates.invented)
            if record.why.startswith(REASON_UNCERTAIN) and not record.attempts:
                record.set_state(State.SEEN, "")
            is_settled = self.staleness.is_settled(record)
            if not is_settled:
                record.forget_answers()
            is_ambiguous = self._may_show_any(one, unmatched)
            record.belief.add_detection(one.detection.label, rates, viewpoint, is_ambiguous=is_ambiguous)
            record.observe(one, self.look.frame, rates.bias, is_settled=is_settled)
            seen.append(record)
        return seen

    def _update_uncertain(self, seen: Sequence[Record], observations: Sequence[Observation]) -> list[Record]:
        """Update items with low-confidence observations, and return these items.

        Such an observation shows the nearest item, which the look then did not miss, or a new item if an
        object may have been overlooked there. It shows nothing if it may show an item that the look detected.
        """
        updated: list[Record] = []
        for one in observations:
            if self._may_show_any(one, seen):
                continue
            near = [
                record
                for record in self.records
                if record.state in LYING
                and record.belief.miss_probability > self.config.overlooked
                and may_show(one, record, self.config.gate)
            ]
            record = min(near, key=lambda record: record.distance_to(one.position), default=None)
            if record is None:
                odds = self._find_prior_odds(one) * ITEM_AREA_SHARE
                if odds <= self.config.overlooked:
                    continue
                record = self._add(one, odds)
                record.observe(one, self.look.frame, 0.0, is_settled=True)
            if record not in updated:
                record.belief.uncertain_looks += 1
                # Evidence against another class is no evidence against the class of the item.
                if one.contradiction and one.detection.label == record.label:
                    record.contradictions += 1
                    record.contradiction = one.contradiction
                updated.append(record)
        return updated

    def _update_unseen(self, records: Sequence[Record]) -> list[Record]:
        """Count a miss of each item whose position was searched, and return those that prove phantoms."""
        if not records:
            return []
        searched = self.look.is_searched(np.array([record.position for record in records]))
        phantoms = []
        for record in (record for record, there in zip(records, searched, strict=True) if there):
            record.belief.add_miss(self.look.error_rates)
            if record.belief.probability <= self.config.overlooked:
                record.set_state(State.PHANTOM, REASON_NOT_FOUND)
                phantoms.append(record)
        return phantoms

    def _recognize_moved(self, seen: list[Record]) -> list[Record]:
        """Replace new items in `seen` that are moved items; return the new ones that were known before."""
        duplicates = []
        for index, new in enumerate(seen):
            old = find_moved(new, self.records, self.staleness, self.config)
            if old is None:
                continue
            old.merge(new)
            seen[index] = old
            if new.first_stamp == new.stamp:
                self.records.remove(new)
            else:
                new.set_state(State.PHANTOM, f"it is {old.item}")
                duplicates.append(new)
        return duplicates

    def _remove_duplicates(self, seen: Sequence[Record]) -> list[Record]:
        """Make the less certain one of two items at one position a phantom, and return the phantoms."""
        duplicates = []
        for record in seen:
            if other := find_duplicate(record, self.records, self.config.gate):
                less, more = sorted((record, other), key=self._rank)
                less.set_state(State.PHANTOM, f"it is {more.item}")
                duplicates.append(less)
        return duplicates

    def _rank(self, record: Record) -> tuple[bool, bool, int]:
        return record.belief.is_proved, self.staleness.is_settled(record), record.belief.looks

    def _add(self, one: Observation, odds: float) -> Record:
        """Add a new item with the prior odds that it exists."""
        belief, frame = Belief(one.detection.label, math.log(odds)), self.look.frame
        has_appeared = self.coverage.find_miss_probability(one.position) <= self.config.overlooked
        return self.records.add(belief, one.position, frame.epoch, frame.stamp, has_appeared)

    def _find_prior_odds(self, one: Observation) -> float:
        """Return the number of overlooked objects expected at the position of an observation."""
        return EXPECTED_OBJECTS * self.coverage.find_miss_probability(one.position)

    def _may_show_any(self, one: Observation, records: Sequence[Record]) -> bool:
        return any(may_show(one, record, self.config.gate) for record in records)
