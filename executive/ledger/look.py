"""Looks: the event of a look, and the update of all items with a look."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np

from executive.cell.config import LedgerConfig
from executive.cell.detection import Detections, Observation
from executive.cell.plain import round_values
from executive.events import DetectedObject, FrameSearched
from executive.ledger.association import associate, find_duplicate, find_moved, may_show
from executive.ledger.belief import ITEM_AREA_SHARE, Belief, viewpoint_of
from executive.ledger.coverage import Coverage
from executive.ledger.item import LYING, REASON_NOT_FOUND, REASON_UNCERTAIN, Record, State
from executive.ledger.records import Records
from executive.ledger.staleness import Staleness

EXPECTED_OBJECTS = 3.0
"""Number of objects expected on the table before the first look, correct to an order of magnitude."""


def describe_look(look: Detections, observations: Sequence[Observation]) -> FrameSearched:
    """Return the event of a look; `observations` are its localized detections."""

    def describe(*, confident: bool) -> list[DetectedObject]:
        return [
            DetectedObject(
                seen.detection.label,
                round(seen.detection.confidence, 4),
                round_values(seen.detection.box, 2),
                round_values(seen.position, 4), seen.contradiction,
            )
            for seen in observations if seen.confident == confident
        ]  # fmt: skip

    return FrameSearched(
        look.frame.id, look.frame.camera, look.detector, look.view, describe(confident=True),
        describe(confident=False), [detection.label for detection in look.unknown],
    )  # fmt: skip


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
        current = [new for new in observations if self.staleness.is_unchanged(new.position, epoch)]
        known = [record for record in self.records if record.state in LYING]
        seen = self._update_seen(known, [new for new in current if new.confident])
        uncertain = self._update_uncertain(seen, [new for new in current if not new.confident])
        unseen = [record for record in known if record not in (*seen, *uncertain)]
        phantoms = self._update_unseen(
            [record for record in unseen if self.staleness.is_unchanged(record.position, epoch)]
        )
        # A rejected item needs no further looks, so that its place counts as searched.
        self.coverage.update(self.look, [item.position for item in uncertain if item.state is State.SEEN])
        moved = self._recognize_moved(seen)
        duplicates = self._remove_duplicates(seen)
        return list(dict.fromkeys([*seen, *uncertain, *phantoms, *moved, *duplicates]))

    def _update_seen(self, known: Sequence[Record], observations: Sequence[Observation]) -> list[Record]:
        """Update known items with confident observations, add new ones, and return both."""
        # An improbable item that may have been moved is not the object that lies there now.
        known = [old for old in known if self.staleness.is_settled(old) or old.belief.probability >= 0.5]
        matches = associate(observations, known, self.staleness, self.config.gate)
        unmatched = [record for record in known if record not in matches.values()]
        rates, viewpoint = self.look.error_rates, viewpoint_of(self.look)
        seen = []
        for observation in observations:
            # The prior odds compare the expected overlooked objects at the place with false detections.
            odds = self._find_prior_odds(observation) / rates.invented
            record = matches.get(observation) or self._add(observation, odds)
            if record.reason.startswith(REASON_UNCERTAIN) and not record.attempts:
                record.set_state(State.SEEN, "")
            is_settled = self.staleness.is_settled(record)
            if not is_settled:
                record.forget_answers()
            label, is_ambiguous = observation.detection.label, self._may_show_any(observation, unmatched)
            record.belief.add_detection(label, rates, viewpoint, is_ambiguous=is_ambiguous)
            record.observe(observation, self.look.frame, rates.bias, is_settled=is_settled)
            seen.append(record)
        return seen

    def _update_uncertain(self, seen: Sequence[Record], observations: Sequence[Observation]) -> list[Record]:
        """Update items with low-confidence observations, and return these items.

        A low-confidence observation shows the nearest item, or a new item if looks may have overlooked an
        object there. The observation is ignored if it may show an item that the look detected confidently.
        """
        updated: list[Record] = []
        for observation in observations:
            if self._may_show_any(observation, seen):
                continue
            near = [
                record
                for record in self.records
                if record.state in LYING
                and record.belief.miss_probability > self.config.overlooked
                and may_show(observation, record, self.config.gate)
            ]
            record = min(near, key=lambda record: record.distance_to(observation.position), default=None)
            if record is None:
                odds = self._find_prior_odds(observation) * ITEM_AREA_SHARE
                if odds <= self.config.overlooked:
                    continue
                record = self._add(observation, odds)
                record.observe(observation, self.look.frame, 0.0, is_settled=True)
            if record not in updated:
                record.belief.uncertain_looks += 1
                # The contradiction concerns the detected class, which may not be the class of the item.
                if observation.contradiction and observation.detection.label == record.label:
                    record.contradictions += 1
                    record.contradiction = observation.contradiction
                updated.append(record)
        return updated

    def _update_unseen(self, records: Sequence[Record]) -> list[Record]:
        """Count a miss of each item whose position was searched, and return the new phantoms."""
        positions = np.array([record.position for record in records]).reshape(-1, 3)
        phantoms = []
        for record in compress(records, self.look.is_searched(positions)):
            record.belief.add_miss(self.look.error_rates)
            if record.belief.probability <= self.config.overlooked:
                record.set_state(State.PHANTOM, REASON_NOT_FOUND)
                phantoms.append(record)
        return phantoms

    def _recognize_moved(self, seen: list[Record]) -> list[Record]:
        """Replace each item in `seen` that is a moved item by the moved item.

        Returns:
            The replaced items that an earlier look had added, which are phantoms now.
        """
        duplicates = []
        for index, new in enumerate(seen):
            if old := find_moved(new, self.records, self.staleness, self.config):
                old.merge(new)
                seen[index] = old
                if new.first_stamp == new.stamp:
                    self.records.remove(new)
                else:
                    new.set_state(State.PHANTOM, f"it is {old.item}")
                    duplicates.append(new)
        return duplicates

    def _remove_duplicates(self, seen: Sequence[Record]) -> list[Record]:
        """Set the less certain of two items at one position to PHANTOM, and return the phantoms."""
        duplicates = []
        for record in seen:
            if other := find_duplicate(record, self.records, self.config.gate):
                less, more = sorted((record, other), key=self._rank)
                less.set_state(State.PHANTOM, f"it is {more.item}")
                duplicates.append(less)
        return duplicates

    def _rank(self, record: Record) -> tuple[bool, bool, int]:
        """Return a sort key; the key of a more certain item is larger."""
        return record.belief.is_proved, self.staleness.is_settled(record), record.belief.looks

    def _add(self, observation: Observation, odds: float) -> Record:
        """Add a new item with the prior odds that it exists."""
        belief, frame = Belief(observation.detection.label, math.log(odds)), self.look.frame
        has_appeared = self.coverage.find_miss_probability(observation.position) <= self.config.overlooked
        return self.records.add(belief, observation.position, frame.epoch, frame.stamp, has_appeared)

    def _find_prior_odds(self, observation: Observation) -> float:
        """Return the prior odds of an observed object: the expected number of overlooked objects there."""
        return EXPECTED_OBJECTS * self.coverage.find_miss_probability(observation.position)

    def _may_show_any(self, observation: Observation, records: Sequence[Record]) -> bool:
        return any(may_show(observation, record, self.config.gate) for record in records)
