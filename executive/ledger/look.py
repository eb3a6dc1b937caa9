"""Update of all items with a look (an image with its detections), and the event of a look."""

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
from executive.geometry import Array
from executive.ledger.association import associate, find_duplicate, find_moved_item, may_show
from executive.ledger.belief import ITEM_AREA_FRACTION, Belief, make_viewpoint_key
from executive.ledger.coverage import Coverage
from executive.ledger.item import ON_TABLE, REASON_NOT_FOUND, REASON_UNCERTAIN, Record, State
from executive.ledger.records import Records
from executive.ledger.staleness import Staleness

EXPECTED_OBJECTS = 3.0
"""Expected number of objects on the table before the first look, to an order of magnitude."""


def make_look_event(look: Detections, observations: Sequence[Observation]) -> FrameSearched:
    """Return the event of a look; `observations` are its localized detections."""

    def list_objects(*, is_confident: bool) -> list[DetectedObject]:
        return [
            DetectedObject(
                observation.detection.label, round(observation.detection.confidence, 4),
                round_values(observation.detection.box, 2), round_values(observation.position, 4),
                observation.contradiction,
            )
            for observation in observations if observation.is_confident == is_confident
        ]  # fmt: skip

    return FrameSearched(
        look.frame.id, look.frame.camera, look.detector, look.view, list_objects(is_confident=True),
        list_objects(is_confident=False), [detection.label for detection in look.unknown],
    )  # fmt: skip


@dataclass(frozen=True)
class LookUpdate:
    """Update of all items with one look, step by step.

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

        Observations at positions where the robot has moved objects since the capture are ignored.
        """
        current = [observation for observation in observations if self._is_current(observation.position)]
        known = [record for record in self.records if record.state in ON_TABLE]
        detected = self._update_detected(known, [entry for entry in current if entry.is_confident])
        uncertain = self._update_uncertain(detected, [entry for entry in current if not entry.is_confident])
        undetected = [record for record in known if record not in (*detected, *uncertain)]
        phantoms = self._update_undetected(undetected)
        # No further look has to find a rejected item, so that its position counts as searched.
        self.coverage.update(self.look, [item.position for item in uncertain if item.state is State.SEEN])
        moved = self._merge_moved_items(detected)
        duplicates = self._remove_duplicates(detected)
        return list(dict.fromkeys([*detected, *uncertain, *phantoms, *moved, *duplicates]))

    def _is_current(self, position: Array) -> bool:
        """Return True if no object at `position` `(3,)` [m] may have been moved since the capture."""
        return self.staleness.is_unchanged(position, self.look.frame.change_count)

    def _update_detected(self, known: Sequence[Record], observations: Sequence[Observation]) -> list[Record]:
        """Update known items with confident observations, add new items, and return both."""
        # If an improbable item may have been moved, an object at its position is a new item.
        probable = [record for record in known if record.belief.existence_probability >= 0.5]
        candidates = [record for record in known if record in probable or self.staleness.is_settled(record)]
        matches = associate(observations, candidates, self.staleness, self.config.gate)
        unmatched = [record for record in candidates if record not in matches.values()]
        rates, viewpoint = self.look.error_rates, make_viewpoint_key(self.look)
        detected = []
        for observation in observations:
            # Prior odds: expected number of missed objects divided by expected number of false detections.
            odds = self._compute_expected_count(observation) / rates.false_detections
            record = matches.get(observation) or self._add_item(observation, odds)
            if record.reason.startswith(REASON_UNCERTAIN) and not record.attempt_count:
                record.set_state(State.SEEN, "")
            is_settled = self.staleness.is_settled(record)
            if not is_settled:
                record.forget_viewpoints()
            label, is_ambiguous = observation.detection.label, self._may_show_any(observation, unmatched)
            record.belief.add_detection(label, rates, viewpoint, is_ambiguous=is_ambiguous)
            record.observe(observation, self.look.frame, rates.bias, is_settled=is_settled)
            detected.append(record)
        return detected

    def _update_uncertain(
        self, detected: Sequence[Record], observations: Sequence[Observation]
    ) -> list[Record]:
        """Update items with low-confidence observations, and return these items.

        Each observation is assigned to the nearest item. Without such an item, the observation becomes a new
        item, unless looks have found its position empty. Observations near items in `detected` are ignored.
        """
        updated: list[Record] = []
        for observation in observations:
            if self._may_show_any(observation, detected):
                continue
            on_table = [record for record in self.records if record.state in ON_TABLE]
            near = [record for record in on_table if may_show(observation, record, self.config.gate)]
            max_miss = self.config.max_miss_probability
            candidates = [record for record in near if record.belief.miss_probability > max_miss]
            record = min(candidates, key=lambda item: item.distance_to(observation.position), default=None)
            if record is None:
                odds = self._compute_expected_count(observation) * ITEM_AREA_FRACTION
                if odds <= max_miss:
                    continue
                record = self._add_item(observation, odds)
                record.observe(observation, self.look.frame, 0.0, is_settled=True)
            if record not in updated:
                record.belief.uncertain_look_count += 1
                # A contradiction of the detected class is no evidence about an item of another class.
                if observation.contradiction and observation.detection.label == record.label:
                    record.contradiction_count += 1
                    record.last_contradiction = observation.contradiction
                updated.append(record)
        return updated

    def _update_undetected(self, records: Sequence[Record]) -> list[Record]:
        """Add a miss to each item whose position the look shows, and return the new phantoms."""
        current = [record for record in records if self._is_current(record.position)]
        positions = np.array([record.position for record in current]).reshape(-1, 3)
        phantoms = []
        for record in compress(current, self.look.is_searched(positions)):
            record.belief.add_miss(self.look.error_rates)
            if record.belief.existence_probability <= self.config.max_miss_probability:
                record.set_state(State.PHANTOM, REASON_NOT_FOUND)
                phantoms.append(record)
        return phantoms

    def _merge_moved_items(self, detected: list[Record]) -> list[Record]:
        """Merge detected items with known items that may have been moved; return the new phantoms.

        The known item replaces the detected item in `detected`. The detected item becomes a phantom, or is
        removed if this look added the item.
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
                duplicate, original = sorted((record, other), key=self._make_certainty_key)
                duplicate.set_state(State.PHANTOM, f"it is {original.item}")
                duplicates.append(duplicate)
        return duplicates

    def _make_certainty_key(self, record: Record) -> tuple[bool, bool, int]:
        """Return a key that sorts items from uncertain to certain."""
        return record.belief.is_proved, self.staleness.is_settled(record), record.belief.look_count

    def _add_item(self, observation: Observation, odds: float) -> Record:
        """Add a new item; `odds` are the prior odds that the item exists."""
        belief, frame = Belief(observation.detection.label, math.log(odds)), self.look.frame
        position = observation.position
        has_appeared = self.coverage.find_miss_probability(position) <= self.config.max_miss_probability
        return self.records.add(belief, position, frame.change_count, frame.stamp, has_appeared=has_appeared)

    def _compute_expected_count(self, observation: Observation) -> float:
        """Return the expected number of objects at an observed position that earlier looks have missed."""
        return EXPECTED_OBJECTS * self.coverage.find_miss_probability(observation.position)

    def _may_show_any(self, observation: Observation, records: Sequence[Record]) -> bool:
        """Return True if an observation may show one of the items in `records`."""
        return any(may_show(observation, record, self.config.gate) for record in records)
