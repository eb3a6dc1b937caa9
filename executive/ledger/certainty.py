"""Rules for items that are certain enough to be sorted, and for items that are rejected as uncertain.

A look is an image with its detections.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from executive.cell.config import LedgerConfig
from executive.ledger.association import MIN_EXISTENCE_PROBABILITY
from executive.ledger.item import REASON_UNCERTAIN, Record, State

MIN_P_VALUE = 0.01
"""Minimum p-value of the class-consistency test (`Belief.p_value`) of an item that is sorted."""
REJECTION_P_VALUE = 0.001
"""p-value of the class-consistency test below which an item is rejected after `MIN_LOOKS_TO_REJECT` looks."""
RETRY_STANDARD_ERROR_FACTOR = 2 / 3
"""Factor on the maximum standard error of an item's position after a failed grasp."""
MIN_MISS_PROBABILITY = 0.1
"""Minimum probability, for a pick, that all looks since the last detection missed the item by chance."""
MIN_LOOKS_TO_REJECT = 40
"""Minimum number of looks before an item is rejected because they disagree about its class."""
MIN_CONTRADICTIONS_TO_REJECT = 3
"""Minimum number of looks with evidence against the class of an item before the item is rejected."""
MIN_REPEATS_FOR_SATURATION = 2
"""Number of repeated answers from a viewpoint after which more looks from it add hardly any evidence."""
MAX_CLASS_ERROR_FOR_TOUCH = 0.2
"""Maximum class error of an item that may be touched to determine its class by its height."""
MAX_UNCERTAIN_LOOKS = 10
"""Number of looks with a low-confidence detection, since the last confident one, to reject an item."""


@dataclass(frozen=True)
class Certainty:
    """Decides which items are certain enough to be sorted, and which are rejected.

    Attributes:
        config: Thresholds of the ledger, from the cell file.
        labels_with_unique_height: Classes whose height distinguishes them from all others.
    """

    config: LedgerConfig
    labels_with_unique_height: Collection[str]

    def is_certain(self, record: Record) -> bool:
        """Return True if an item's existence, class and position are certain enough to touch the item.

        After a failed grasp, the position must be known more precisely. If more looks from the same viewpoint
        cannot prove the class, but the height of a touch can, a larger class error is permitted.
        """
        belief, max_class_error = record.belief, self.config.max_class_error
        is_saturated = belief.repeat_count >= MIN_REPEATS_FOR_SATURATION
        if is_saturated and record.label in self.labels_with_unique_height:
            max_class_error = MAX_CLASS_ERROR_FOR_TOUCH
        max_error = self.config.max_position_std * (
            RETRY_STANDARD_ERROR_FACTOR if record.attempt_count else 1.0
        )
        return (
            belief.existence_probability >= MIN_EXISTENCE_PROBABILITY
            and record.contradiction_count <= belief.look_count
            and belief.miss_probability >= MIN_MISS_PROBABILITY
            and belief.class_error <= max_class_error
            and belief.p_value >= MIN_P_VALUE
            and math.hypot(record.standard_error, record.bias_std) <= max_error
        )

    def may_be_on_table(self, record: Record) -> bool:
        """Return True if an item in the state SEEN may still lie on the table."""
        may_exist = record.belief.existence_probability > self.config.max_miss_probability
        return record.state is State.SEEN and may_exist and not self.is_position_empty(record)

    def is_position_empty(self, record: Record) -> bool:
        """Return True if looks have missed an item so often that its position is almost certainly empty."""
        return record.belief.miss_probability <= self.config.max_miss_probability

    def reject_if_uncertain(self, record: Record, *, is_settled: bool) -> None:
        """Reject an item in the state SEEN if more looks are unlikely to make the item certain.

        Args:
            record: The item.
            is_settled: True if the item cannot have moved since its last detection.
        """
        belief = record.belief
        is_certain = is_settled and self.is_certain(record)
        if is_certain:
            belief.uncertain_look_count = 0
        if record.state is not State.SEEN:
            return
        if belief.look_count >= MIN_LOOKS_TO_REJECT and belief.p_value < REJECTION_P_VALUE:
            counts = ", ".join(f"{count} {label}" for label, count in belief.label_counts.most_common())
            record.set_state(State.REJECTED, f"looks disagree about its class: {counts}")
        elif self._cannot_prove_class(record):
            error = f"leave a probability of {belief.class_error:.1%} that it is no {record.label}"
            limit = f"at most {self.config.max_class_error:.1%} is allowed"
            record.set_state(State.REJECTED, f"{belief.look_count} looks from one pose {error}; {limit}")
        elif not is_certain and (
            belief.uncertain_look_count >= MAX_UNCERTAIN_LOOKS
            or record.contradiction_count >= max(MIN_CONTRADICTIONS_TO_REJECT, belief.look_count + 1)
        ):
            details = f": {record.last_contradiction}" if record.last_contradiction else ""
            record.set_state(State.REJECTED, REASON_UNCERTAIN + details)
            belief.log_odds = max(belief.log_odds, 0.0)

    def register_low_touch(self, record: Record) -> bool:
        """Count a touch below the height of the class; return True if the touch may have missed the top.

        Only the first low touch may have missed the top, and only if looks alone prove the class.
        """
        record.low_touch_count += 1
        return record.low_touch_count == 1 and record.belief.class_error <= self.config.max_class_error

    def _cannot_prove_class(self, record: Record) -> bool:
        """Return True if neither more looks from the only viewpoint so far nor a touch prove the class."""
        belief = record.belief
        return (
            belief.class_error > self.config.max_class_error
            and belief.repeat_count >= MIN_REPEATS_FOR_SATURATION
            and len(belief.last_label_by_viewpoint) == 1
            and record.label not in self.labels_with_unique_height
        )
