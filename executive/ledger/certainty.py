"""Rules by which an item is certain enough to be sorted, or too uncertain to be looked at any longer."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from executive.cell_config import LedgerConfig
from executive.ledger.item import LIKELY, UNSURE, Record, State

CREDIBLE, CONTRADICTED = 0.01, 0.001
"""Chance of as much disagreement about its class, above which an item is sorted, and under which given up."""
SHARPER = 2 / 3
"""Factor on the standard error of its position that is allowed for another attempt at an item."""
PRESENT = 0.1
"""Chance of having been overlooked by the looks that missed it, down to which it is taken to be there."""
ENOUGH = 40
"""Looks after which an item whose class they contradict each other about is given up."""
MAX_CONTRADICTIONS = 3
"""Looks that contradict its class after which an item is given up."""
MAX_REPEATS = 2
"""Repeated answers from one pose after which only other evidence than further looks can help an item."""
MAX_MISJUDGED_BEFORE_TOUCH = 0.2
"""Probability of a wrong class up to which an item is touched, if a touch decides its class."""
GLIMPSES = 20
"""Looks with a detector unsure of it, since one was sure, after which an item not known well is given up."""


@dataclass(frozen=True)
class Certainty:
    """Judges items.

    Attributes:
        config: Limits of the cell file.
        told_by_touch: Classes whose height distinguishes them from all others.
    """

    config: LedgerConfig
    told_by_touch: Collection[str]

    def is_sure(self, record: Record) -> bool:
        """Return True if there is enough evidence that an item exists, of which class it is, and where.

        After a failed grasp the looks must agree better on where. If looks from one pose cannot prove its
        class, but a touch can, the item is sure enough to be touched.
        """
        limit = self.config.misjudged
        if record.repeats >= MAX_REPEATS and record.label in self.told_by_touch:
            limit = MAX_MISJUDGED_BEFORE_TOUCH
        standard_error = math.hypot(record.spread, record.bias)
        return (
            record.probability >= LIKELY
            and record.contradictions <= record.looks
            and record.overlooked >= PRESENT
            and record.misjudged <= limit
            and record.consistency >= CREDIBLE
            and standard_error <= self.config.aim * (SHARPER if record.attempts else 1.0)
        )

    def review(self, record: Record, *, settled: bool) -> None:
        """Reject an item whose class looks cannot prove or disagree on, or of which they are unsure.

        Args:
            record: The item.
            settled: True if nothing has disturbed its place.
        """
        known = settled and self.is_sure(record)
        if known:
            record.glimpses = 0
        if record.state is not State.SEEN:
            return
        if record.looks >= ENOUGH and record.consistency < CONTRADICTED:
            votes = ", ".join(f"{count} {label}" for label, count in record.tally.most_common())
            record.state, record.why = State.REJECTED, f"its class is in doubt: {votes}"
        elif self._lacks_second_evidence(record):
            chance = f"leave a chance of {record.misjudged:.1%} that it is no {record.label}"
            why = f"{record.looks} looks from one pose {chance}, allowed {self.config.misjudged:.1%}"
            record.state, record.why = State.REJECTED, why
        elif not known and (record.glimpses >= GLIMPSES or _is_contradicted(record)):
            record.state = State.REJECTED
            record.why = f"{UNSURE}: {record.contradiction}" if record.contradiction else UNSURE
            record.existence = max(record.existence, 0.0)

    def _lacks_second_evidence(self, record: Record) -> bool:
        """Return True if all looks came from one viewpoint, and neither they nor a touch prove its class."""
        return (
            record.misjudged > self.config.misjudged
            and record.repeats >= MAX_REPEATS
            and len(record.answers) == 1
            and record.label not in self.told_by_touch
        )


def _is_contradicted(record: Record) -> bool:
    """Return True if enough looks contradict the class of an item, and more than do not."""
    return record.contradictions >= MAX_CONTRADICTIONS and record.contradictions > record.looks
