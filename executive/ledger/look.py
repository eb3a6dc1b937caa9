"""Update of all items with one look (an image with its detections), and the event of the look."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np

from executive.cell.config import LedgerConfig
from executive.cell.frame import Detections, Observation
from executive.cell.json_values import round_values
from executive.events import DetectedObject, FrameSearched
from executive.geometry import Array
from executive.ledger.association import associate, find_duplicate, find_moved_item, may_show_item
from executive.ledger.belief import ITEM_AREA_FRACTION, Belief, make_viewpoint_key
from executive.ledger.certainty import Certainty
from executive.ledger.coverage import Coverage, Staleness
from executive.ledger.item import ON_TABLE, REASON_NOT_FOUND, REASON_UNCERTAIN, ItemRecord, ItemRecords, State

EXPECTED_OBJECT_COUNT = 3.0
"""Order of magnitude of the expected number of objects on the table before the first look."""


def make_look_event(look: Detections, observations: Sequence[Observation]) -> FrameSearched:
    """Return the event of a look; `observations` are the localized detections."""
    confident_objects = [_make_detected_object(entry) for entry in observations if entry.is_confident]
    doubtful_objects = [_make_detected_object(entry) for entry in observations if not entry.is_confident]
    frame, unknown_labels = look.frame, [detection.label for detection in look.unknown]
    return FrameSearched(
        frame.id, frame.camera, look.detector, look.view, confident_objects, doubtful_objects, unknown_labels
    )


def _make_detected_object(observation: Observation) -> DetectedObject:
    """Return the recorded values of an observation, rounded."""
    detection, position = observation.detection, round_values(observation.position, 4)
    confidence, box = round(detection.confidence, 4), round_values(detection.box, 2)
    return DetectedObject(detection.label, confidence, box, position, observation.contradiction)


@dataclass(frozen=True)
class LookUpdate:
    """Update of all items with one look; `apply` executes the update.

    Attributes:
        certainty: Decisions about items, with the thresholds of the ledger.
        records: All items; `apply` adds new items.
        coverage: Miss probabilities of the grid points on the table; `apply` updates them.
        staleness: Actions of the robot that may have moved objects on the table.
        look: Detections in the image of the look.
    """

    certainty: Certainty
    records: ItemRecords
    coverage: Coverage
    staleness: Staleness
    look: Detections

    @property
    def config(self) -> LedgerConfig:
        """Thresholds of the ledger, from the cell file."""
        return self.certainty.config

    def apply(self, observations: Sequence[Observation]) -> list[ItemRecord]:
        """Update the items with the observations on the table, and return the changed items.

        Observations at positions where the robot may have moved objects since the capture are ignored.
        """
        observations = [entry for entry in observations if self._is_unmoved_since_capture(entry.position)]
        confident_observations = [entry for entry in observations if entry.is_confident]
        doubtful_observations = [entry for entry in observations if not entry.is_confident]
        known_items = self.records.filter_by_state(*ON_TABLE)
        detected_items = self._update_detected_items(known_items, confident_observations)
        uncertain_items = self._update_uncertain_items(detected_items, doubtful_observations)
        missed_items = [item for item in known_items if item not in (*detected_items, *uncertain_items)]
        phantoms = self._update_missed_items(missed_items)
        # The positions of rejected items count as searched: no further look at these items is necessary.
        uncertain_positions = [item.position for item in uncertain_items if item.state is State.SEEN]
        self.coverage.update(self.look, uncertain_positions)
        phantoms += self._merge_moved_items(detected_items) + self._remove_duplicates(detected_items)
        return list(dict.fromkeys([*detected_items, *uncertain_items, *phantoms]))

    def _is_unmoved_since_capture(self, position: Array) -> bool:
        """Return True if no object at `position` `(3,)` [m] may have been moved since the capture."""
        return self.staleness.is_unchanged(position, self.look.frame.change_count)

    def _update_detected_items(
        self, known_items: Sequence[ItemRecord], observations: Sequence[Observation]
    ) -> list[ItemRecord]:
        """Update known items with confident observations, add new items, and return the detected items."""
        # An object detected at the position of an improbable item that may have been moved is a new item.
        rates, viewpoint, staleness = self.look.error_rates, make_viewpoint_key(self.look), self.staleness
        candidates = [item for item in known_items if item.belief.is_probable or staleness.is_unmoved(item)]
        matches = associate(observations, candidates, staleness, self.config.gate)
        unmatched_items = [record for record in candidates if record not in matches.values()]
        moved_items = [item for item in unmatched_items if not staleness.is_unmoved(item)]
        moved_items += self.records.filter_by_state(State.DROPPED)
        detected_items = []
        for observation in observations:
            # Prior odds: expected number of missed objects divided by expected number of false detections. An
            # item that the robot has moved must be somewhere.
            expected_count = self._compute_expected_count(observation)
            expected_count += sum(item.detected_label == observation.detection.label for item in moved_items)
            prior_odds = expected_count / rates.false_detections
            record = matches.get(observation) or self._add_item(observation, prior_odds)
            if record.reason.startswith(REASON_UNCERTAIN) and not record.failed_pick_count:
                record.set_state(State.SEEN, "")
            is_unmoved = staleness.is_unmoved(record)
            if not is_unmoved:
                record.clear_viewpoints()
            label = observation.detection.label
            is_ambiguous = self._may_show_any_item(observation, unmatched_items)
            record.belief.add_detection(label, rates, viewpoint, is_ambiguous=is_ambiguous)
            record.store(observation, self.look.frame, rates.bias, is_unmoved=is_unmoved)
            detected_items.append(record)
        return detected_items

    def _update_uncertain_items(
        self, detected_items: Sequence[ItemRecord], observations: Sequence[Observation]
    ) -> list[ItemRecord]:
        """Update items with doubtful observations (low confidence or contradiction); return these items.

        Observations near detected items are ignored. Other observations are assigned to the nearest item. If
        no item is near, the observation becomes a new item, unless earlier looks found the position empty.
        """
        updated_items: list[ItemRecord] = []
        for observation in observations:
            if self._may_show_any_item(observation, detected_items):
                continue
            on_table = self.records.filter_by_state(*ON_TABLE)
            near_items = [item for item in on_table if may_show_item(observation, item, self.config.gate)]
            max_miss_probability = self.config.max_miss_probability
            candidates = [item for item in near_items if item.belief.miss_probability > max_miss_probability]
            record = min(candidates, key=lambda item: item.distance_to(observation.position), default=None)
            if record is None:
                prior_odds = self._compute_expected_count(observation) * ITEM_AREA_FRACTION
                if prior_odds <= max_miss_probability:
                    continue
                record = self._add_item(observation, prior_odds)
                record.store(observation, self.look.frame, 0.0, is_unmoved=True)
            if record not in updated_items:
                record.belief.low_confidence_count += 1
                # A contradiction of the detected class is no evidence about an item of another class.
                if observation.contradiction and observation.detection.label == record.detected_label:
                    record.contradiction_count += 1
                    record.last_contradiction = observation.contradiction
                updated_items.append(record)
        return updated_items

    def _update_missed_items(self, records: Sequence[ItemRecord]) -> list[ItemRecord]:
        """Add a miss to each item whose position the look shows, and return the new phantoms."""
        records = [record for record in records if self._is_unmoved_since_capture(record.position)]
        positions = np.array([record.position for record in records]).reshape(-1, 3)
        phantoms = []
        for record in compress(records, self.look.compute_searched_mask(positions)):
            record.belief.add_miss(self.look.error_rates)
            if record.belief.existence_probability <= self.config.max_miss_probability:
                record.set_state(State.PHANTOM, REASON_NOT_FOUND)
                phantoms.append(record)
        return phantoms

    def _merge_moved_items(self, detected_items: list[ItemRecord]) -> list[ItemRecord]:
        """Merge detected items with known items that may have been moved; return the new phantoms.

        The known item replaces the detected item in `detected_items`. The detected item becomes a phantom, or
        is removed if this look added the item.
        """
        phantoms = []
        for index, new_item in enumerate(detected_items):
            if known_item := find_moved_item(new_item, self.records, self.staleness, self.certainty):
                known_item.merge(new_item, self.config.max_class_error)
                detected_items[index] = known_item
                if new_item.first_stamp == new_item.stamp:
                    self.records.remove(new_item)
                else:
                    new_item.set_state(State.PHANTOM, f"it is {known_item.item}")
                    phantoms.append(new_item)
        return phantoms

    def _remove_duplicates(self, detected_items: Sequence[ItemRecord]) -> list[ItemRecord]:
        """Set the less certain of two items at one position to PHANTOM, and return the phantoms."""
        duplicates = []
        for record in detected_items:
            if other_record := find_duplicate(record, self.records, self.config.gate):
                duplicate, original = sorted((record, other_record), key=self._make_certainty_key)
                duplicate.set_state(State.PHANTOM, f"it is {original.item}")
                duplicates.append(duplicate)
        return duplicates

    def _make_certainty_key(self, record: ItemRecord) -> tuple[bool, bool, int]:
        """Return a key that sorts items from uncertain to certain."""
        return record.belief.is_confirmed, self.staleness.is_unmoved(record), record.belief.look_count

    def _add_item(self, observation: Observation, prior_odds: float) -> ItemRecord:
        """Add a new item; `prior_odds` are the prior odds that the item exists."""
        belief, frame = Belief(observation.detection.label, math.log(prior_odds)), self.look.frame
        position = observation.position
        was_place_empty = self.coverage.find_miss_probability(position) <= self.config.max_miss_probability
        record = self.records.add(
            belief, position, frame.change_count, frame.stamp, was_place_empty=was_place_empty
        )
        record.was_place_searched = self.coverage.was_searched(position)
        return record

    def _compute_expected_count(self, observation: Observation) -> float:
        """Return the expected number of objects at an observed position that earlier looks have missed."""
        return EXPECTED_OBJECT_COUNT * self.coverage.find_miss_probability(observation.position)

    def _may_show_any_item(self, observation: Observation, records: Sequence[ItemRecord]) -> bool:
        """Return True if an observation may show one of the items in `records`."""
        return any(may_show_item(observation, record, self.config.gate) for record in records)
