"""What the tool may be before, during and after skills, by what they declare."""

from __future__ import annotations

from collections.abc import Iterable

from executive.mission.flow.state import Flow, Grip, State, joined
from executive.skill import ANY, EMPTY, HOLDING, ToolState

Grips = frozenset[Grip] | None
"""Everything the tool may be; None where that cannot be known."""


def required(grips: Grips, before: ToolState, path: str) -> Grips:
    """Return what the tool may be once a skill has what it needs: one mistake is told once."""
    if before is ANY or grips is None:
        return grips
    return frozenset(grip for grip in grips if grip.tool is before) or frozenset({Grip(before, path)})


def left_after(grips: Grips, after: ToolState, path: str) -> Grips:
    """Return what the tool is after a skill's success; ANY: as before."""
    if after is ANY or (grips is not None and all(grip.tool is after for grip in grips)):
        return grips
    return frozenset({Grip(after, path)})


def left_after_failure(grips: Grips, left: ToolState | None, path: str) -> Grips:
    """Return what the tool is after a skill's failure; None: as before, ANY: one or the other."""
    if left is None or grips is None:
        return grips
    if left is ANY:
        return grips | {Grip(EMPTY, path), Grip(HOLDING, path)}
    return frozenset({Grip(left, path)})


def grips_at_end(flow: Flow, state: State, halts: bool) -> Grips:
    """Return what the tool may be once a branch of a parallel is over, halted or not."""
    ends = joined((flow.success, *flow.failures.values(), *((flow.halted, state) if halts else ())))
    return state.grips if ends is None else ends.grips


def together(before: Grips, ends: Iterable[Grips]) -> Grips:
    """Return what the tool may be after branches of which one at most has used it."""
    changed = [end for end in ends if _holds(end) != _holds(before)]
    if any(end is None for end in changed):
        return None
    return frozenset(grip for end in changed for grip in end or ()) if changed else before


def _holds(grips: Grips) -> frozenset[tuple[ToolState, str]] | None:
    """Return what the tool may hold since when; what was dealt with since then leaves it as it is."""
    return None if grips is None else frozenset((grip.tool, grip.since) for grip in grips)
