"""Checks of the numbers of control nodes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from executive.mission.case import Case
from executive.mission.findings import Finding, error
from executive.mission.model import Reference, RepeatNode, RetryNode, TimeoutNode, Value
from executive.mission.typed import WrongType, convert
from executive.mission.words import describe


def numbers(case: Case) -> Iterator[Finding]:
    """Find every number of a control node that is none, too small, or not known before the run."""
    for node in case.nodes():
        if isinstance(node, RetryNode):
            yield from _number("retry.attempts", node.attempts, int, "at least 1", lambda n: n >= 1)
        elif isinstance(node, RepeatNode) and node.times is not None:
            yield from _number("repeat.times", node.times, int, "at least 0", lambda n: n >= 0)
        elif isinstance(node, TimeoutNode):
            yield from _number("timeout.seconds", node.seconds, float, "more than 0 s", lambda s: s > 0)


def _number(name: str, value: Value, kind: type, bound: str, holds: Any) -> Iterator[Finding]:
    if isinstance(value, Reference):
        message = f"{name} is a constant, and ${value.name} is neither param nor argument here"
        yield error(value.mark, "unknown-param", message)
        return
    origin = f" (it is {value.origin})" if value.origin else ""
    try:
        if not holds(convert(value.value, kind)):
            message = f"{name} must be {bound}, not {describe(value.value)}{origin}"
            yield error(value.mark, "out-of-range", message)
    except WrongType as problem:
        yield error(value.mark, "wrong-type", f"{name} {problem}{origin}")
