"""Checks of timeouts: could what stands under them ever be done in time?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from executive.cell.protocols import LeastTimes
from executive.mission.check.case import Case
from executive.mission.findings import Finding, error
from executive.mission.model import nodes
from executive.mission.model.nodes import Node, SkillNode
from executive.mission.model.typed import WrongType, convert
from executive.mission.model.values import Literal, Value
from executive.mission.model.wiring import literals
from executive.skill import HOLDING

_SLACK = 0.005
"""A clock of steps may end a wait up to half a step early [s]."""


def short_timeouts(case: Case) -> Iterator[Finding]:
    """Find every timeout that ends before its body possibly can."""
    for node in case.nodes():
        if not isinstance(node, nodes.TimeoutNode) or case.least is None:
            continue
        seconds = _number(node.seconds)
        shortest = least_time(case, node.do)
        if seconds is not None and 0 < seconds < shortest - _SLACK:
            note = node.seconds.origin_note if isinstance(node.seconds, Literal) else ""
            message = (
                f"timeout.seconds is {seconds:g} s, but its body takes {shortest:.2f} s at the very least"
            )
            message += note
            yield error(node.seconds.mark, "short-timeout", message, _made_of(case, node.do, shortest))


def _made_of(case: Case, body: Node, shortest: float) -> str:
    """Return the least times of the skills in a body, or "" where they do not simply add up."""
    skills = [inner for inner in body.walk() if isinstance(inner, SkillNode)]
    times = [(skill.skill, time) for skill in skills if (time := least_time(case, skill)) > 0]
    if abs(sum(time for _, time in times) - shortest) > 1e-9:
        return ""
    return f"At the least: {', '.join(f'{name} {time:.2f} s' for name, time in times)}."


def least_time(case: Case, node: Node | None) -> float:
    """Return the least time in which a node can succeed [s]; 0 where nothing is known."""
    match node:
        case nodes.SkillNode():
            return _skill(case, node)
        case nodes.SequenceNode() | nodes.UseNode():
            return sum(least_time(case, child) for child in node.children)
        case nodes.FallbackNode():
            return min((least_time(case, child) for child in node.children), default=0.0)
        case nodes.ParallelNode():
            return _parallel(case, node)
        case nodes.RetryNode() | nodes.TimeoutNode():
            return least_time(case, node.do)
        case nodes.RepeatNode(times=Literal() as times, until=()):
            return (_number(times) or 0.0) * least_time(case, node.do)
        case nodes.ForEachNode(source=Literal(value=list() as elements)):
            return len(elements) * least_time(case, node.do)
        case nodes.TryNode():
            ways = [node.do, *(catch.do for catch in node.catches)]
            return min(least_time(case, way) for way in ways) + least_time(case, node.finish)
    return 0.0


def _skill(case: Case, node: SkillNode) -> float:
    skill = case.skills.get(node.skill)
    if skill is None or case.least is None:
        return 0.0
    declared: Mapping[str, Any] = {**skill.params, **skill.ports}
    given = {name: param.default for name, param in skill.params.items() if not param.required}
    for name, value in literals(node):
        try:
            given[name] = convert(value.value, declared[name].type)
        except (KeyError, WrongType):
            # Another check says so.
            return 0.0
    entry = case.flow.entry.get(node.path)
    grips = entry.grips if entry else None
    carries = skill.tool_state[0] is HOLDING
    from_elsewhere = carries and (grips is None or any(grip.moved for grip in grips))
    # How long a carry takes is known from where objects lie, not from wherever the arm went with its load.
    return skill.shortest(_FromAnywhere(case.least) if from_elsewhere else case.least, given)


class _FromAnywhere:
    """Least times of a cell for an arm that may be anywhere with its load."""

    def __init__(self, least: LeastTimes) -> None:
        self._least = least

    @property
    def descent(self) -> float:
        """The guarded last part of an approach [s]."""
        return self._least.descent

    def carry(self, bin: str | None) -> float:
        """Nothing: it may be over the bin already."""
        del bin
        return 0.0

    def answer(self, detector: str) -> float:
        """From a frame to the answer of a detector [s]."""
        return self._least.answer(detector)


def _parallel(case: Case, node: nodes.ParallelNode) -> float:
    wait_for = node.wait_for.value if isinstance(node.wait_for, Literal) else "any"
    if wait_for == "lead":
        return least_time(case, node.branches[0])
    times = sorted(least_time(case, branch) for branch in node.branches)
    count = len(times) if wait_for == "all" else 1 if wait_for == "any" else wait_for
    return times[count - 1] if isinstance(count, int) and 0 < count <= len(times) else 0.0


def _number(value: Value) -> float | None:
    number = value.value if isinstance(value, Literal) else None
    return number if isinstance(number, int | float) and not isinstance(number, bool) else None
