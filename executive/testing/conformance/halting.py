"""What is left when a skill is taken away, at any moment."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from executive.testing.conformance.case import Case
from executive.testing.conformance.endings import tool_fault
from executive.testing.conformance.rehearsal import Rehearsal


def halts_at_once(case: Case) -> Iterator[str]:
    """Taken away at any tick, it ends there and then, and raises nothing."""

    def fault(rehearsal: Rehearsal) -> Iterator[str]:
        if rehearsal.ending.status == "FAULT":
            yield (
                f"{rehearsal.where} it was halted at tick {rehearsal.ticks}: {rehearsal.ending.message}. "
                "What finally does must be done at once and cannot fail."
            )

    yield from _first_of_each(case, fault)


def halts_at_rest(case: Case) -> Iterator[str]:
    """Taken away at any tick, it has told the arm to come to rest."""

    def fault(rehearsal: Rehearsal) -> Iterator[str]:
        if rehearsal.moved and not rehearsal.at_rest:
            yield (
                f"{rehearsal.where} it was halted at tick {rehearsal.ticks}, and the arm moves on. "
                "Call cell.arm.stop() in finally, or use follow of executive.moving."
            )

    yield from _first_of_each(case, fault)


def halts_with_tool_as_declared(case: Case) -> Iterator[str]:
    """Taken away at any tick, it leaves in the tool what was there before, or what tool_left says."""
    yield from _first_of_each(case, lambda rehearsal: tool_fault(case, rehearsal))


def _first_of_each(case: Case, fault: Callable[[Rehearsal], Iterator[str]]) -> Iterator[str]:
    """Yield what is wrong the first time it is wrong in each situation, and how often it is."""
    found: dict[str, list[str]] = {}
    halts: dict[str, int] = {}
    for rehearsal in case.halted:
        halts[rehearsal.where] = halts.get(rehearsal.where, 0) + 1
        found.setdefault(rehearsal.where, []).extend(fault(rehearsal))
    for where, texts in found.items():
        if texts:
            yield f"{texts[0]} (So after {len(texts)} of {halts[where]} halts.)"
