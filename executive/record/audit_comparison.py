"""Comparison of the ledger with the true positions of the objects after a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from executive.cell.workcell import AUDIT_KEYS

MISTAKE_DESCRIPTIONS = {
    "wrong_bin": "in a wrong bin",
    "fell_in_wrong_bin": "fallen into a wrong bin",
    "unseen": "never seen",
}
"""Text for each audit count that must be 0, by key of the audit."""


@dataclass(frozen=True)
class ItemCounts:
    """Number of items by final state.

    The sum of placed, rejected, skipped and lost items is `seen`. A phantom is an item without an object:
    all its detections were false.
    """

    seen: int = 0
    placed: int = 0
    rejected: int = 0
    skipped: int = 0
    lost: int = 0
    phantom: int = 0


@dataclass(frozen=True)
class Audit:
    """Number of objects by true place, in a cell with ground truth.

    Attributes:
        agrees: True if the true places confirm the counts of the ledger.
        right, wrong_bin: Number of objects in a permitted bin, and in another bin.
        left, elsewhere: Number of objects on the table, and below the table or fallen into wrong bins.
        fell_in_wrong_bin, unseen: Number of objects that fell into a wrong bin; number of undetected objects.
    """

    agrees: bool = True
    right: int = 0
    wrong_bin: int = 0
    left: int = 0
    elsewhere: int = 0
    fell_in_wrong_bin: int = 0
    unseen: int = 0

    @staticmethod
    def from_counts(items: Mapping[str, int], audit: Mapping[str, int], is_table_empty: bool) -> Audit:
        """Return the true counts `audit`, compared with the counts `items` of the ledger."""
        is_confirmed = is_confirmed_by_audit(items, audit, is_table_empty)
        return Audit(is_confirmed, **{place: int(audit[place]) for place in AUDIT_KEYS})


def is_confirmed_by_audit(items: Mapping[str, int], audit: Mapping[str, int], is_table_empty: bool) -> bool:
    """Return True if the true counts `audit` confirm the counts `items` of the ledger.

    If the run reported an empty table (`is_table_empty`), no object may be unseen.
    """
    unsorted_count = items["rejected"] + items["skipped"]
    return bool(
        audit["wrong_bin"] == audit["fell_in_wrong_bin"] == 0
        and items["placed"] == audit["right"]
        and items["lost"] == audit["elsewhere"]
        and unsorted_count <= audit["left"] <= unsorted_count + audit["unseen"]
        and not (is_table_empty and audit["unseen"])
    )


def describe_disagreement(audit: Audit | None, items: ItemCounts) -> str:
    """Return a message with the counts of audit and ledger if they disagree, else ""."""
    if audit is None or audit.agrees:
        return ""
    counts = {text: getattr(audit, place) for place, text in MISTAKE_DESCRIPTIONS.items()}
    mistakes = ", ".join(f"{count} {text}" for text, count in counts.items() if count)
    comparison = (
        f"the audit found {audit.right} in their bins, {audit.left} on the table and "
        f"{audit.elsewhere} elsewhere; the executive reports {items.placed} placed, "
        f"{items.rejected} rejected, {items.skipped} skipped and {items.lost} lost"
    )
    return "THE AUDIT DISAGREES: " + "; ".join(filter(None, (mistakes, comparison)))
