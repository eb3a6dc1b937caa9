"""Rules by which an item is certain enough to be sorted, or so uncertain that it is rejected."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from executive.cell.config import LedgerConfig
from executive.ledger.association import MIN_EXISTENCE_PROBABILITY
from executive.ledger.item import REASON_UNCERTAIN, Record, State

MIN_P_VALUE, REJECTION_P_VALUE = 0.01, 0.001
"""Minimum p-value of the test whether the looks agree on the class of an item, to sort and to keep it."""
RETRY_STANDARD_ERROR_FACTOR = 2 / 3
"""Factor on the allowed standard error of an item's position after a failed grasp."""
MIN_MISS_PROBABILITY = 0.1
"""An item is picked only if the probability is larger that all looks since its last detection missed it."""
MIN_LOOKS_TO_REJECT = 40
"""Number of looks from which an item is rejected if they disagree about its class."""
MIN_CONTRADICTIONS_TO_REJECT = 3
"""Number of contradicting looks from which an item may be rejected."""
MAX_REPEATS = 2
"""Number of repeats from a viewpoint after which more looks from it add hardly any evidence."""
MAX_CLASS_ERROR_FOR_TOUCH = 0.2
"""Maximum probability of a wrong class for a touch, if the height of the touch determines the class."""
MAX_UNCERTAIN_LOOKS = 10
"""Number of looks without a confident detection of an item, from which the item is rejected."""


@dataclass(frozen=True)
class Certainty:
    """Decides which items are certain enough to be sorted, and which are rejected.

    Attributes:
        config: Limits of the cell file.
        distinct_by_touch: Classes whose height distinguishes them from all others.
    """

    config: LedgerConfig
    distinct_by_touch: Collection[str]

    def is_sure(self, record: Record) -> bool:
        """Return True if an item's existence, class and position are certain enough.

        After a failed grasp, the position must be known more precisely. If looks from one viewpoint cannot
        prove the class, but a touch can, the item is certain enough to be touched.
        """
        belief, limit = record.belief, self.config.misjudged
        if belief.repeats >= MAX_REPEATS and record.label in self.distinct_by_touch:
            limit = MAX_CLASS_ERROR_FOR_TOUCH
        max_error = self.config.aim * (RETRY_STANDARD_ERROR_FACTOR if record.attempts else 1.0)
        return (
            belief.probability >= MIN_EXISTENCE_PROBABILITY
            and record.contradictions <= belief.looks
            and belief.miss_probability >= MIN_MISS_PROBABILITY
            and belief.class_error <= limit
            and belief.p_value >= MIN_P_VALUE
            and math.hypot(record.std, record.bias) <= max_error
        )

    def is_possible(self, record: Record) -> bool:
        """Return True if an open item may lie on the table."""
        may_exist = record.belief.probability > self.config.overlooked
        return record.state is State.SEEN and may_exist and not self.is_gone(record)

    def is_gone(self, record: Record) -> bool:
        """Return True if looks have found the position of an item empty."""
        return record.belief.miss_probability <= self.config.overlooked

    def reject_if_uncertain(self, record: Record, *, is_settled: bool) -> None:
        """Reject an item if looks cannot prove its class, disagree about it, or remain unsure of the item.

        Args:
            record: The item.
            is_settled: True if nothing may have moved the item since its last detection.
        """
        belief = record.belief
        is_known = is_settled and self.is_sure(record)
        if is_known:
            belief.uncertain_looks = 0
        if record.state is not State.SEEN:
            return
        if belief.looks >= MIN_LOOKS_TO_REJECT and belief.p_value < REJECTION_P_VALUE:
            counts = ", ".join(f"{count} {label}" for label, count in belief.label_counts.most_common())
            record.set_state(State.REJECTED, f"its class is in doubt: {counts}")
        elif self._cannot_prove_class(record):
            chance = f"leave a chance of {belief.class_error:.1%} that it is no {record.label}"
            limit = f"at most {self.config.misjudged:.1%} is allowed"
            record.set_state(State.REJECTED, f"{belief.looks} looks from one pose {chance}; {limit}")
        elif not is_known and (
            belief.uncertain_looks >= MAX_UNCERTAIN_LOOKS
            or record.contradictions >= max(MIN_CONTRADICTIONS_TO_REJECT, belief.looks + 1)
        ):
            details = f": {record.contradiction}" if record.contradiction else ""
            record.set_state(State.REJECTED, REASON_UNCERTAIN + details)
            belief.log_odds = max(belief.log_odds, 0.0)

    def count_low_touch(self, record: Record) -> bool:
        """Count a touch that is too low for the class; return True if the touch may have missed the top.

        Only the first low touch may have missed the top, and only if looks alone prove the class.
        """
        record.low_touches += 1
        return record.low_touches == 1 and record.belief.class_error <= self.config.misjudged

    def _cannot_prove_class(self, record: Record) -> bool:
        """Return True if all looks came from one viewpoint, and neither looks nor a touch prove the class."""
        belief = record.belief
        return (
            belief.class_error > self.config.misjudged
            and belief.repeats >= MAX_REPEATS
            and len(belief.answers) == 1
            and record.label not in self.distinct_by_touch
        )
