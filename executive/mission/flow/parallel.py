"""How a parallel may end, from how its branches may."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from executive.mission.flow.state import Flow, State, grips_at_end, joined, together


def at_once(flows: Sequence[Flow], state: State, wait_for: Any, halt: bool) -> Flow:
    """Return how branches may end that all begin in `state`.

    Args:
        flows: How each branch may end.
        state: What is true where they begin.
        wait_for: How many must succeed, `all` or `any`, or `lead` where the first decides alone; whatever
            else it is counts as all.
        halt: Whether a failure halts the others.
    """
    taken = [grips_at_end(flow, state, halts=True) for flow in flows]
    halted = joined(flow.halted for flow in flows)
    halted = halted and halted.gripping(together(state.grips, taken))
    failures = {}
    if wait_for == "lead":
        lead, beside = flows[0], taken[1:]
        for failure, after in lead.failures.items():
            failures[failure] = after.gripping(together(state.grips, [after.grips, *beside]))
        end = lead.success
        return Flow(end and end.gripping(together(state.grips, [end.grips, *beside])), failures, halted)
    needed = _needed(wait_for, len(flows))
    ends = [grips_at_end(flow, state, halt or needed < len(flows)) for flow in flows]
    if sum(bool(flow.failures) for flow in flows) > len(flows) - needed:
        for index, flow in enumerate(flows):
            others = [*ends[:index], *ends[index + 1 :]]
            for failure, after in flow.failures.items():
                failures[failure] = after.gripping(together(state.grips, [after.grips, *others]))
    return Flow(_success(flows, state, needed), failures, halted)


def _success(flows: Sequence[Flow], state: State, needed: int) -> State | None:
    """Return what is true once enough branches have succeeded; None where so many cannot."""
    succeeding = [flow.success for flow in flows if flow.success is not None]
    success = joined(succeeding)
    if success is None or len(succeeding) < needed:
        return None
    if needed < len(flows):
        ends = [grips_at_end(flow, state, halts=True) for flow in flows]
        return success.gripping(together(state.grips, ends))
    everything = success.writing(name for end in succeeding for name in end.written or ())
    return everything.gripping(together(state.grips, [end.grips for end in succeeding]))


def _needed(wait_for: Any, total: int) -> int:
    if wait_for == "any":
        return 1
    return min(max(wait_for, 1), total) if isinstance(wait_for, int) else total
