"""Rules by which an item is certain enough to be sorted, or so uncertain that it is rejected."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from executive.cell.config import LedgerConfig
from executive.ledger.item import LIKELY, UNSURE, Record, State

MIN_P_VALUE, REJECTION_P_VALUE = 0.01, 0.001
"""Limits of the p-value of a binomial test of the number of looks with another class: the smallest to sort an
item, and the limit below which to reject it."""
RETRY_STANDARD_ERROR_FACTOR = 2 / 3
"""Factor on the allowed standard error of an item's position after a failed grasp."""
MIN_MISS_PROBABILITY = 0.1
"""An item counts as present if the probability that later looks missed it is at least this."""
MIN_LOOKS_TO_REJECT = 40
"""Number of looks from which an item is rejected if they disagree about its class."""
MIN_CONTRADICTIONS_TO_REJECT = 3
"""Number of contradicting looks from which an item may be rejected."""
MAX_REPEATS = 2
"""Number of repeated answers from one pose after which further looks from there add hardly any evidence."""
MAX_CLASS_ERROR_FOR_TOUCH = 0.2
"""Probability of a wrong class up to which an item is touched, if a touch decides its class."""
MAX_UNSURE_LOOKS = 10
"""Number of unsure looks since the last sure one after which an uncertain item is rejected."""


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

        After a failed grasp, the position must be known more precisely. If looks from one pose cannot prove
        the class, but a touch can, the item is certain enough to be touched.
        """
        limit = self.config.misjudged
        if record.repeats >= MAX_REPEATS and record.label in self.distinct_by_touch:
            limit = MAX_CLASS_ERROR_FOR_TOUCH
        standard_error = math.hypot(record.spread, record.bias)
        return (
            record.probability >= LIKELY
            and record.contradictions <= record.looks
            and record.overlooked >= MIN_MISS_PROBABILITY
            and record.misjudged <= limit
            and record.p_value >= MIN_P_VALUE
            and standard_error <= self.config.aim * (RETRY_STANDARD_ERROR_FACTOR if record.attempts else 1.0)
        )

    def reject_if_uncertain(self, record: Record, *, settled: bool) -> None:
        """Reject an item if looks cannot prove its class, disagree about it, or remain unsure of the item.

        Args:
            record: The item.
            settled: True if nothing has disturbed its place since it was seen.
        """
        known = settled and self.is_sure(record)
        if known:
            record.glimpses = 0
        if record.state is not State.SEEN:
            return
        if record.looks >= MIN_LOOKS_TO_REJECT and record.p_value < REJECTION_P_VALUE:
            votes = ", ".join(f"{count} {label}" for label, count in record.tally.most_common())
            record.state, record.why = State.REJECTED, f"its class is in doubt: {votes}"
        elif self._cannot_prove_class(record):
            chance = f"leave a chance of {record.misjudged:.1%} that it is no {record.label}"
            why = (
                f"{record.looks} looks from one pose {chance}; at most {self.config.misjudged:.1%} is allowed"
            )
            record.state, record.why = State.REJECTED, why
        elif not known and (record.glimpses >= MAX_UNSURE_LOOKS or _is_contradicted(record)):
            record.state = State.REJECTED
            record.why = f"{UNSURE}: {record.contradiction}" if record.contradiction else UNSURE
            record.existence = max(record.existence, 0.0)

    def count_low_touch(self, record: Record) -> bool:
        """Count a touch that is too low for the class; return True if it may have missed the top.

        That may happen once, and only to an item whose class the looks prove without a touch.
        """
        record.low_touches += 1
        return record.low_touches == 1 and record.misjudged <= self.config.misjudged

    def _cannot_prove_class(self, record: Record) -> bool:
        """Return True if all looks came from one viewpoint, and neither they nor a touch prove its class."""
        return (
            record.misjudged > self.config.misjudged
            and record.repeats >= MAX_REPEATS
            and len(record.answers) == 1
            and record.label not in self.distinct_by_touch
        )


def _is_contradicted(record: Record) -> bool:
    """Return True if enough looks contradict the class of an item, and more contradict than support it."""
    return record.contradictions >= MIN_CONTRADICTIONS_TO_REJECT and record.contradictions > record.looks
