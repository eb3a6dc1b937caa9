"""Decisions whether the evidence about an item suffices."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field

from executive.cell.config import LedgerConfig
from executive.cell.tools import ToolMeasurement
from executive.ledger.item import REASON_UNCERTAIN, ItemRecord, State

REASON_CONTRADICTED = "images contradict the declared place or colour of"
"""Start of the reason of the state REJECTED of an item without a bin that may be used."""
MIN_EXISTENCE_PROBABILITY = 0.9
"""Minimum probability of existence of an item that is picked, or matched to a moved item."""
MIN_EXISTENCE_FOR_TOUCH = 0.5
"""Minimum probability of existence of an item that the tool may touch to prove the existence."""
MIN_REPEATS_FOR_TOUCH = 10
"""Number of repeated classes after which more looks from a viewpoint hardly prove the existence."""
MIN_P_VALUE = 0.01
"""Minimum p-value of the class-consistency test (`Belief.confusion_p_value`) of an item that is sorted."""
MAX_P_VALUE_TO_REJECT = 0.001
"""Upper limit of the p-value of an item that is rejected because the looks disagree about its class."""
RETRY_STANDARD_ERROR_FACTOR = 2 / 3
"""Maximum standard error of an item's position after a failed grasp, as a fraction of `max_position_std`."""
MIN_MISS_PROBABILITY_OF_PICK = 0.1
"""Minimum miss probability (`Belief.miss_probability`) of an item that is picked."""
MIN_LOOKS_TO_REJECT = 40
"""Minimum number of looks at an item that is rejected because the looks disagree about its class."""
MIN_CONTRADICTIONS_TO_REJECT = 3
"""Minimum number of looks that contradict the class (`ItemRecord.contradiction_count`) of a rejected item."""
MIN_LOG_RATIO_OF_WEIGHT = math.log(0.01)
"""Minimum log likelihood ratio of a weight that agrees with a class, against objects of no declared class. At
the minimum, the class and an undeclared class (prior odds 0.01) are equally probable."""
MIN_REPEATS_FOR_SATURATION = 2
"""Number of repeated classes after which more looks from a viewpoint add hardly any evidence."""
MAX_CLASS_ERROR_FOR_MEASUREMENT = 0.2
"""Maximum class error of an item that the tool may touch to determine the class by a measurement."""
MIN_UNCERTAIN_LOOKS_TO_REJECT = 10
"""Minimum number of looks in a row with only doubtful detections of a rejected item."""


@dataclass(frozen=True)
class Certainty:
    """Decides which items are certain enough to be sorted, and which are rejected.

    Attributes:
        config: Thresholds of the ledger, from the cell file.
        distinct_labels: Classes that a measurement of the tool distinguishes from all others.
        confirmed_labels: Classes that a measurement of the tool has confirmed, and "" after others.
    """

    config: LedgerConfig
    distinct_labels: Collection[str]
    confirmed_labels: set[str] = field(default_factory=set)

    def is_certain(self, record: ItemRecord) -> bool:
        """Return True if an item's existence, class and position are certain enough to touch the item.

        After a failed grasp, the position must be known more precisely. A smaller probability of existence
        suffices if further looks from the same viewpoint cannot prove the existence, but a touch can.
        """
        belief = record.belief
        is_saturated = belief.repeat_count >= MIN_REPEATS_FOR_TOUCH
        min_existence = MIN_EXISTENCE_FOR_TOUCH if is_saturated else MIN_EXISTENCE_PROBABILITY
        error_factor = RETRY_STANDARD_ERROR_FACTOR if record.failed_pick_count else 1.0
        return (
            belief.existence_probability >= min_existence
            and record.contradiction_count < belief.look_count
            and belief.miss_probability >= MIN_MISS_PROBABILITY_OF_PICK
            and self.is_class_certain(record)
            and belief.confusion_p_value >= MIN_P_VALUE
            and math.hypot(record.standard_error, record.bias_std)
            <= error_factor * self.config.max_position_std
        )

    def is_class_certain(self, record: ItemRecord) -> bool:
        """Return True if an item's class is certain enough to touch the item.

        A larger class error is permitted if further looks from the same viewpoint cannot prove the class, but
        a measurement of the tool can.
        """
        is_saturated = record.belief.repeat_count >= MIN_REPEATS_FOR_SATURATION
        is_distinct = record.label in self.distinct_labels
        max_error = self.config.max_class_error
        if is_saturated and is_distinct:
            max_error = MAX_CLASS_ERROR_FOR_MEASUREMENT
        return record.belief.class_error <= max_error

    def is_class_certain_by_weight(self, record: ItemRecord) -> bool:
        """Return True if the class of an item is certain according to its last weighing."""
        belief = record.belief
        fits = belief.weight_log_ratios.get(belief.label, -math.inf) >= MIN_LOG_RATIO_OF_WEIGHT
        return fits and belief.class_error <= self.config.max_class_error

    def may_be_on_table(self, record: ItemRecord) -> bool:
        """Return True if an item in the state SEEN may still lie on the table."""
        may_exist = record.belief.existence_probability > self.config.max_miss_probability
        return record.state is State.SEEN and may_exist and not self.is_position_empty(record)

    def is_position_empty(self, record: ItemRecord) -> bool:
        """Return True if an item's position is almost certainly empty, because looks have missed the item."""
        return record.belief.miss_probability <= self.config.max_miss_probability

    def reject_if_uncertain(self, record: ItemRecord, *, is_unmoved: bool) -> None:
        """Reject an item in the state SEEN if more looks are unlikely to make the item certain.

        `is_unmoved` is True if the item cannot have moved since its last detection.
        """
        belief = record.belief
        is_certain = is_unmoved and self.is_certain(record)
        if is_certain:
            belief.low_confidence_count = 0
        if record.state is not State.SEEN:
            return
        if belief.look_count >= MIN_LOOKS_TO_REJECT and belief.confusion_p_value < MAX_P_VALUE_TO_REJECT:
            counts = ", ".join(f"{count} {label}" for label, count in belief.label_counts.most_common())
            record.set_state(State.REJECTED, f"looks disagree about its class: {counts}")
        elif self._needs_other_viewpoint(record):
            record.set_state(
                State.REJECTED,
                f"{belief.look_count} looks from one pose leave a probability of {belief.class_error:.1%} "
                f"that it is no {record.label}; at most {self.config.max_class_error:.1%} is allowed",
            )
        elif not is_certain and (
            belief.low_confidence_count >= MIN_UNCERTAIN_LOOKS_TO_REJECT
            or record.contradiction_count >= max(MIN_CONTRADICTIONS_TO_REJECT, belief.look_count + 1)
        ):
            details = f": {record.last_contradiction}" if record.last_contradiction else ""
            record.set_state(State.REJECTED, REASON_UNCERTAIN + details)
            # A rejected item counts as existing, so that the end of the run does not discard it as a phantom.
            belief.log_odds = max(belief.log_odds, 0.0)

    def add_measurement(self, record: ItemRecord, measurement: ToolMeasurement) -> bool:
        """Update an item with a measurement of the tool; return False if it contradicts the class.

        After a measurement that agrees with the class, others are no contradiction, because the item may have
        tipped over. The first measurement that may be wrong is no contradiction if the looks prove the class.
        """
        record.belief.is_confirmed = True
        record.had_contact = True
        record.empty_probe_count = 0
        if not measurement.contradiction:
            record.confirmed_label = record.label
            record.doubtful_measurement_count = 0
        self.confirmed_labels.add(record.confirmed_label)
        if record.confirmed_label == record.label:
            return True
        if measurement.may_be_wrong:
            record.doubtful_measurement_count += 1
            is_first = record.doubtful_measurement_count == 1
            if is_first and record.belief.class_error <= self.config.max_class_error:
                return True
        record.last_contradiction = measurement.contradiction
        return False

    def _needs_other_viewpoint(self, record: ItemRecord) -> bool:
        """Return True if only looks from a second viewpoint can prove the class of an item."""
        belief = record.belief
        return (
            belief.class_error > self.config.max_class_error
            and belief.repeat_count >= MIN_REPEATS_FOR_SATURATION
            and len(belief.last_label_by_viewpoint) == 1
            and record.label not in self.distinct_labels
        )
