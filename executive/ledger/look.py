"""Event of a look (an image with its detections), and update of all items with a look."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np

from executive.cell.config import LedgerConfig
from executive.cell.detection import Detections, Observation
from executive.cell.json_values import round_values
from executive.events import DetectedObject, FrameSearched
from executive.ledger.association import associate, find_duplicate, find_moved_item, may_show
from executive.ledger.belief import ITEM_AREA_FRACTION, Belief, make_viewpoint_key
from executive.ledger.coverage import Coverage
from executive.ledger.item import ON_TABLE, REASON_NOT_FOUND, REASON_UNCERTAIN, Record, State
from executive.ledger.records import Records
from executive.ledger.staleness import Staleness

EXPECTED_OBJECTS = 3.0
"""Prior expectation of the number of objects on the table, correct to an order of magnitude."""


def make_look_event(look: Detections, observations: Sequence[Observation]) -> FrameSearched:
    """Return the event of a look; `observations` are its localized detections."""

    def list_objects(*, confident: bool) -> list[DetectedObject]:
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
        look.frame.id, look.frame.camera, look.detector, look.view, list_objects(confident=True),
        list_objects(confident=False), [detection.label for detection in look.unknown],
    )  # fmt: skip


@dataclass(frozen=True)
class LookUpdate:
    """Update of all items with one look.

    Attributes:
        config: Thresholds of the ledger, from the cell file.
        records: All items; `apply` adds new items.
        coverage: Miss probabilities of the grid points on the table; `apply` updates them.
        staleness: Changes of the table by the robot.
        look: Detections in the image of the look.
    """

    config: LedgerConfig
    records: Records
    coverage: Coverage
    staleness: Staleness
    look: Detections

    def apply(self, observations: Sequence[Observation]) -> list[Record]:
        """Update the items with the observations on the table, and return the changed items.

        Observations at positions that the robot has changed since the capture of the image are ignored.
        """
        change_count = self.look.frame.epoch
        current = [new for new in observations if self.staleness.is_unchanged(new.position, change_count)]
        known = [record for record in self.records if record.state in ON_TABLE]
        detected = self._update_detected(known, [new for new in current if new.confident])
        uncertain = self._update_uncertain(detected, [new for new in current if not new.confident])
        undetected = [record for record in known if record not in (*detected, *uncertain)]
        phantoms = self._update_undetected(
            [record for record in undetected if self.staleness.is_unchanged(record.position, change_count)]
        )
        # A rejected item needs no further looks, so that its position counts as searched.
        self.coverage.update(self.look, [item.position for item in uncertain if item.state is State.SEEN])
        moved = self._merge_moved_items(detected)
        duplicates = self._remove_duplicates(detected)
        return list(dict.fromkeys([*detected, *uncertain, *phantoms, *moved, *duplicates]))

    def _update_detected(self, known: Sequence[Record], observations: Sequence[Observation]) -> list[Record]:
        """Update known items with confident observations, add new items, and return both."""
        # An improbable item that may have been moved is not the object that lies at its position now.
        known = [
            old for old in known if self.staleness.is_settled(old) or old.belief.existence_probability >= 0.5
        ]
        matches = associate(observations, known, self.staleness, self.config.gate)
        unmatched = [record for record in known if record not in matches.values()]
        rates, viewpoint = self.look.error_rates, make_viewpoint_key(self.look)
        detected = []
        for observation in observations:
            # Prior odds: expected undetected objects at the position, per expected false detection.
            odds = self._find_expected_count(observation) / rates.false_detections
            record = matches.get(observation) or self._add_item(observation, odds)
            if record.reason.startswith(REASON_UNCERTAIN) and not record.attempt_count:
                record.set_state(State.SEEN, "")
            is_settled = self.staleness.is_settled(record)
            if not is_settled:
                record.discard_answers()
            label, is_ambiguous = observation.detection.label, self._may_show_any(observation, unmatched)
            record.belief.add_detection(label, rates, viewpoint, is_ambiguous=is_ambiguous)
            record.observe(observation, self.look.frame, rates.bias, is_settled=is_settled)
            detected.append(record)
        return detected

    def _update_uncertain(
        self, detected: Sequence[Record], observations: Sequence[Observation]
    ) -> list[Record]:
        """Update items with low-confidence observations, and return these items.

        A low-confidence observation shows the nearest item, or a new item if looks may have missed an object
        at the position. The observation is ignored if it may show one of the items in `detected`.
        """
        updated: list[Record] = []
        for observation in observations:
            if self._may_show_any(observation, detected):
                continue
            near = [
                record
                for record in self.records
                if record.state in ON_TABLE
                and record.belief.miss_probability > self.config.max_miss_probability
                and may_show(observation, record, self.config.gate)
            ]
            record = min(near, key=lambda record: record.distance_to(observation.position), default=None)
            if record is None:
                odds = self._find_expected_count(observation) * ITEM_AREA_FRACTION
                if odds <= self.config.max_miss_probability:
                    continue
                record = self._add_item(observation, odds)
                record.observe(observation, self.look.frame, 0.0, is_settled=True)
            if record not in updated:
                record.belief.uncertain_look_count += 1
                # The contradiction concerns the detected class, which can differ from the class of the item.
                if observation.contradiction and observation.detection.label == record.label:
                    record.contradiction_count += 1
                    record.last_contradiction = observation.contradiction
                updated.append(record)
        return updated

    def _update_undetected(self, records: Sequence[Record]) -> list[Record]:
        """Count a miss of each item whose position is visible in the look, and return the new phantoms."""
        positions = np.array([record.position for record in records]).reshape(-1, 3)
        phantoms = []
        for record in compress(records, self.look.is_searched(positions)):
            record.belief.add_miss(self.look.error_rates)
            if record.belief.existence_probability <= self.config.max_miss_probability:
                record.set_state(State.PHANTOM, REASON_NOT_FOUND)
                phantoms.append(record)
        return phantoms

    def _merge_moved_items(self, detected: list[Record]) -> list[Record]:
        """Merge each item in `detected` that is a known item after a move into the known item.

        The known item replaces the merged item in `detected`.

        Returns:
            Merged items that an earlier look had added; their state is PHANTOM now.
        """
        duplicates = []
        for index, new in enumerate(detected):
            if old := find_moved_item(new, self.records, self.staleness, self.config):
                old.merge(new)
                detected[index] = old
                if new.first_stamp == new.stamp:
                    self.records.remove(new)
                else:
                    new.set_state(State.PHANTOM, f"it is {old.item}")
                    duplicates.append(new)
        return duplicates

    def _remove_duplicates(self, detected: Sequence[Record]) -> list[Record]:
        """Set the less certain of two items at one position to PHANTOM, and return the phantoms."""
        duplicates = []
        for record in detected:
            if other := find_duplicate(record, self.records, self.config.gate):
                duplicate, kept = sorted((record, other), key=self._make_certainty_key)
                duplicate.set_state(State.PHANTOM, f"it is {kept.item}")
                duplicates.append(duplicate)
        return duplicates

    def _make_certainty_key(self, record: Record) -> tuple[bool, bool, int]:
        """Return a sort key; the key of a more certain item is larger."""
        return record.belief.is_proved, self.staleness.is_settled(record), record.belief.look_count

    def _add_item(self, observation: Observation, odds: float) -> Record:
        """Add a new item; `odds` are the prior odds that the item exists."""
        belief, frame = Belief(observation.detection.label, math.log(odds)), self.look.frame
        position = observation.position
        has_appeared = self.coverage.find_miss_probability(position) <= self.config.max_miss_probability
        return self.records.add(belief, position, frame.epoch, frame.stamp, appeared_during_run=has_appeared)

    def _find_expected_count(self, observation: Observation) -> float:
        """Return the expected number of objects at an observed position that earlier looks have missed."""
        return EXPECTED_OBJECTS * self.coverage.find_miss_probability(observation.position)

    def _may_show_any(self, observation: Observation, records: Sequence[Record]) -> bool:
        """Return True if an observation may show one of the items in `records`."""
        return any(may_show(observation, record, self.config.gate) for record in records)
