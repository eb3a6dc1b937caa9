"""Update of all items with one look: association of its observations with items, and its event.

`associate` matches observations to nearby items. `find_moved_item` matches a new item to a known item that
may have been moved. `find_duplicate` finds a second item at the position of an item.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np

from executive.cell.config import LedgerConfig
from executive.cell.frame import Detections, Observation
from executive.cell.json_values import round_values
from executive.events import DetectedObject, FrameSearched
from executive.geometry import Array
from executive.ledger.belief import ITEM_AREA_FRACTION, Belief, make_viewpoint_key
from executive.ledger.certainty import MIN_EXISTENCE_PROBABILITY, Certainty
from executive.ledger.coverage import Coverage
from executive.ledger.item import (
    ON_TABLE,
    REASON_NOT_FOUND,
    REASON_UNCERTAIN,
    SAME_POSITION_TOLERANCE,
    ItemRecord,
    ItemRecords,
    State,
)

MAX_STANDARD_DEVIATIONS = 3.5
"""Number of standard deviations within which two measurements of a position agree with probability 0.999."""
AMBIGUITY_FACTOR = 1.5
"""Maximum distance between an item and an observation that may show it, in units of the gating distance."""
MIN_COMMON_FRAMES = 2
"""Minimum number of frames that show two near items separately, which proves that they are two objects."""
MAX_PUSH_DISTANCE = 0.12
"""Maximum distance by which a person may push an item that still counts as the same item [m]."""
MAX_MISS_PROBABILITY_OF_MOVED_ITEM = 0.05
"""Maximum probability, for a moved item, that all images since its last detection missed it by chance."""


def associate(
    observations: Iterable[Observation], records: Sequence[ItemRecord], coverage: Coverage, gate: float
) -> dict[Observation, ItemRecord]:
    """Return the item of each observation that shows a known item.

    Pairs are matched in this order: first pairs with an item that cannot have moved since its last detection,
    then pairs of equal classes (the class is evidence, not identity), then pairs with a small distance.

    Args:
        observations: Confident observations on the table.
        records: Items on the table.
        coverage: Changes of the table by the robot.
        gate: Lower bound of the gating distance (`compute_association_distance`) [m].
    """
    pairs = []
    for observation in observations:
        for record in records:
            distance = record.distance_to(observation.position)
            if distance <= compute_association_distance(record, observation, gate):
                is_other_class = record.detected_label != observation.detection.label
                rank = (not coverage.is_unmoved(record), is_other_class, distance)
                pairs.append((rank, observation, record))
    matches: dict[Observation, ItemRecord] = {}
    for _, observation, record in sorted(pairs, key=lambda pair: pair[0]):
        if observation not in matches and record not in matches.values():
            matches[observation] = record
    return matches


def compute_association_distance(record: ItemRecord, observation: Observation, gate: float) -> float:
    """Return the gating distance [m]: the maximum distance between an item and an observation assigned to it.

    The gating distance grows with the standard errors of both positions, from `gate` [m] to `2 * gate`.
    """
    error = math.hypot(record.standard_error, observation.std)
    return min(max(gate, MAX_STANDARD_DEVIATIONS * error), 2 * gate)


def may_show_item(observation: Observation, record: ItemRecord, gate: float) -> bool:
    """Return True if an observation lies within `AMBIGUITY_FACTOR` gating distances of an item.

    The observation may then show the item. `gate` is the lower bound of the gating distance [m].
    """
    max_distance = AMBIGUITY_FACTOR * compute_association_distance(record, observation, gate)
    return record.distance_to(observation.position) <= max_distance


def find_moved_item(
    new_item: ItemRecord, records: Iterable[ItemRecord], coverage: Coverage, certainty: Certainty
) -> ItemRecord | None:
    """Return the item that may have been dropped or moved to the position of a new item, or None.

    An item that the tool dropped must be somewhere, and comes first; then the nearest item. For other items,
    the class of the new item must be certain, because another object may have been moved to the position.
    """
    if (
        new_item.state is not State.SEEN
        or new_item.failed_pick_count
        or new_item.belief.existence_probability < MIN_EXISTENCE_PROBABILITY
    ):
        return None
    candidates = [item for item in records if _may_be_same_object(item, new_item, coverage, certainty)]

    def make_sort_key(item: ItemRecord) -> tuple[bool, float]:
        return item.state is not State.DROPPED, _compute_horizontal_distance(item, new_item)

    return min(candidates, key=make_sort_key, default=None)


def find_duplicate(record: ItemRecord, records: Iterable[ItemRecord], gate: float) -> ItemRecord | None:
    """Return another item within `gate` [m] of an item if both are in the state SEEN, or None.

    Two items are two objects if `MIN_COMMON_FRAMES` frames have shown both, or if the last frame shows both,
    unless their positions agree within `SAME_POSITION_TOLERANCE`: two boxes may show one object.
    """
    for other in records:
        distance = other.distance_to(record.position)
        is_open = record.state is other.state is State.SEEN
        if other is record or not is_open or distance >= gate:
            continue
        is_shown_separately = other.frame_id == record.frame_id and distance > SAME_POSITION_TOLERANCE
        if is_shown_separately:
            record.common_frame_counts[other.item] += 1
            other.common_frame_counts[record.item] += 1
        elif record.common_frame_counts[other.item] < 2 * MIN_COMMON_FRAMES:
            return other
    return None


def _may_be_same_object(
    old_item: ItemRecord, new_item: ItemRecord, coverage: Coverage, certainty: Certainty
) -> bool:
    """Return True if a new item may be the same object as an old item that recent images no longer show.

    The robot may push an object anywhere, a person by at most `MAX_PUSH_DISTANCE`. An item that became a
    phantom after an attempt to pick it may be an object that the attempt pushed away. An item that left its
    place may be anywhere; the new item then is at a position that a look found empty.
    """
    if old_item is new_item or old_item.detected_label != new_item.detected_label:
        return False
    if old_item.state is State.DROPPED and not old_item.was_taken_away:
        return new_item.first_change_count > old_item.change_count
    if not certainty.is_class_certain(new_item):
        return False
    if old_item.state is State.DROPPED:
        return new_item.was_place_searched and new_item.first_stamp > old_item.stamp
    may_be_moved_by_person = (
        _compute_horizontal_distance(old_item, new_item) <= MAX_PUSH_DISTANCE
        and new_item.first_stamp > old_item.stamp
        and certainty.is_position_empty(old_item)
    )
    is_pushed_phantom = (
        old_item.state is State.PHANTOM
        and old_item.reason == REASON_NOT_FOUND
        and old_item.failed_pick_count > 0
    )
    is_missing = (
        (old_item.state in ON_TABLE or is_pushed_phantom)
        and old_item.belief.miss_probability <= MAX_MISS_PROBABILITY_OF_MOVED_ITEM
        and old_item.belief.log_odds_at_last_detection >= 0.0
    )
    if not is_missing or may_be_moved_by_person:
        return is_missing
    change_number = coverage.find_change_number(old_item.position, old_item.change_count)
    return change_number is not None and new_item.first_change_count >= change_number


def _compute_horizontal_distance(record: ItemRecord, other_record: ItemRecord) -> float:
    return float(np.linalg.norm((record.position - other_record.position)[:2]))


EXPECTED_OBJECT_COUNT = 3.0
"""Order of magnitude of the expected number of objects on the table before the first look."""


def make_look_event(look: Detections, observations: Sequence[Observation]) -> FrameSearched:
    """Return the event of a look; `observations` are the localized detections."""
    return FrameSearched(
        look.frame.id, look.frame.camera, look.detector, look.view,
        confident=[_make_detected_object(entry) for entry in observations if entry.is_confident],
        doubtful=[_make_detected_object(entry) for entry in observations if not entry.is_confident],
        unknown_labels=[detection.label for detection in look.unknown],
    )  # fmt: skip


def _make_detected_object(observation: Observation) -> DetectedObject:
    detection = observation.detection
    return DetectedObject(
        detection.label, round(detection.confidence, 4), round_values(detection.box, 2),
        round_values(observation.position, 4), observation.contradiction,
    )  # fmt: skip


@dataclass(frozen=True)
class LookUpdate:
    """Update of all items with one look; `apply` executes the update.

    Attributes:
        certainty: Decisions about items, with the thresholds of the ledger.
        records: All items; `apply` adds new items.
        coverage: Changes of the table, and miss probabilities of its grid points; `apply` updates these.
        look: Detections in the image of the look.
    """

    certainty: Certainty
    records: ItemRecords
    coverage: Coverage
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
        return self.coverage.is_unchanged(position, self.look.frame.change_count)

    def _update_detected_items(
        self, known_items: Sequence[ItemRecord], observations: Sequence[Observation]
    ) -> list[ItemRecord]:
        """Update known items with confident observations, add new items, and return the detected items."""
        # An object detected at the position of an improbable item that may have been moved is a new item.
        rates = self.look.error_rates
        viewpoint = make_viewpoint_key(self.look)
        is_unmoved = self.coverage.is_unmoved
        candidates = [item for item in known_items if item.belief.is_probable or is_unmoved(item)]
        matches = associate(observations, candidates, self.coverage, self.config.gate)
        unmatched_items = [record for record in candidates if record not in matches.values()]
        moved_items = [item for item in unmatched_items if not is_unmoved(item)]
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
            if not is_unmoved(record):
                record.clear_viewpoints()
            label = observation.detection.label
            is_ambiguous = self._may_show_any_item(observation, unmatched_items)
            record.belief.add_detection(label, rates, viewpoint, is_ambiguous=is_ambiguous)
            record.store(observation, self.look.frame, rates.bias, is_unmoved=is_unmoved(record))
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
        contradicted_items: list[ItemRecord] = []
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
                updated_items.append(record)
            # A contradiction of the detected class is no evidence about an item of another class.
            is_same_class = observation.detection.label == record.detected_label
            if observation.contradiction and is_same_class and record not in contradicted_items:
                record.contradiction_count += 1
                record.last_contradiction = observation.contradiction
                contradicted_items.append(record)
        return updated_items

    def _update_missed_items(self, records: Sequence[ItemRecord]) -> list[ItemRecord]:
        """Add a miss to each item whose position the look shows, and return the new phantoms."""
        records = [record for record in records if self._is_unmoved_since_capture(record.position)]
        positions = np.array([record.position for record in records]).reshape(-1, 3)
        phantoms = []
        for record in compress(records, self.look.compute_searched_mask(positions)):
            record.belief.add_miss(self.look.error_rates)
            is_improbable = record.belief.existence_probability <= self.config.max_miss_probability
            if is_improbable and record.belief.removal_probability < 0.5:
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
            if known_item := find_moved_item(new_item, self.records.all, self.coverage, self.certainty):
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
            if other_record := find_duplicate(record, self.records.all, self.config.gate):
                duplicate, original = sorted((record, other_record), key=self._make_certainty_key)
                duplicate.set_state(State.PHANTOM, f"it is {original.item}")
                duplicates.append(duplicate)
        return duplicates

    def _make_certainty_key(self, record: ItemRecord) -> tuple[bool, bool, int]:
        return record.belief.is_confirmed, self.coverage.is_unmoved(record), record.belief.look_count

    def _add_item(self, observation: Observation, prior_odds: float) -> ItemRecord:
        """Add a new item; `prior_odds` are the prior odds that the item exists."""
        belief = Belief(observation.detection.label, math.log(prior_odds))
        position = observation.position
        miss_probability = self.coverage.find_miss_probability(position)
        record = self.records.add(belief, position, self.look.frame)
        record.was_place_empty = miss_probability <= self.config.max_miss_probability
        record.was_place_searched = self.coverage.was_searched(position)
        record.has_appeared = miss_probability < 1.0
        return record

    def _compute_expected_count(self, observation: Observation) -> float:
        """Return the expected number of objects at an observed position that earlier looks have missed."""
        return EXPECTED_OBJECT_COUNT * self.coverage.find_miss_probability(observation.position)

    def _may_show_any_item(self, observation: Observation, records: Sequence[ItemRecord]) -> bool:
        return any(may_show_item(observation, record, self.config.gate) for record in records)
