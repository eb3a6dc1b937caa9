"""Checks of control nodes by their declarations, and by the rules that their classes add."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import cast

from executive.mission.check.case import Case
from executive.mission.check.min_times import min_time
from executive.mission.findings import Finding, error, warning
from executive.mission.model.instance import find_upper_bound, inspection_instance, node_of
from executive.mission.model.nodes import InnerNode, Node, Part, SectionNode, SkillNode, iterate_parts
from executive.mission.model.paths import name_of
from executive.mission.model.typed import WrongType, read_constant
from executive.mission.model.values import FailureName, Literal, Reference
from executive.mission.words import describe
from executive.skill import Skill
from executive.tree.failure import Reason
from executive.tree.flow import Flow
from executive.tree.inspection import NodeFinding
from executive.tree.keys import Child, Key, Kind


def check_constants(case: Case) -> Iterator[Finding]:
    """Find every constant of a control node that is none, out of bounds, or not known before the run."""
    for node in case.inner_nodes():
        yield from _constants(case, node, node.kind.keyword)


def _constants(case: Case, owner: InnerNode | SectionNode, name: str) -> Iterator[Finding]:
    for key, value in iterate_parts(owner):
        if isinstance(value, SectionNode):
            yield from _constants(case, value, key.name)
        elif isinstance(value, tuple):
            for item in value:
                if isinstance(item, SectionNode):
                    yield from _constants(case, item, key.name)
        elif key.kind is Kind.CONSTANT:
            yield from _constant(case, f"{name}.{key.name}", key, value, find_upper_bound(owner, key))
        elif key.kind is Kind.ELEMENTS and isinstance(value, Literal) and not isinstance(value.value, list):
            given = f"{describe(value.value)}{value.origin_note}"
            message = f"{name}.{key.name} takes a list or a variable, not {given}"
            is_word = isinstance(value.value, str) and not value.origin
            hint = f"Write a list: [{value.value}]." if is_word else ""
            yield error(value.mark, "wrong-type", message, hint)


def _constant(case: Case, name: str, key: Key, value: Part, max_value: int | None) -> Iterator[Finding]:
    if isinstance(value, Reference):
        message = f"{name} is a constant, and ${value.name} is neither param nor argument here"
        yield error(value.mark, "unknown-param", message, case.constant_hint(value))
    elif isinstance(value, Literal):
        try:
            read_constant(key, value.value, max_value)
        except WrongType as problem:
            is_param = problem.code == "wrong-type" and value.value in [*case.mission.params]
            hint = f"For the param write ${value.value}." if is_param else ""
            yield error(value.mark, problem.code, f"{name} {problem}{value.origin_note}", hint)


def check_class_rules(case: Case) -> Iterator[Finding]:
    """Find the mistakes that only the class of a control node knows."""
    halted = {node.path for node in _find_halted(case)}
    for node in case.inner_nodes():
        for finding in inspection_instance(node).check(CaseFacts(case, node, node.path in halted)):
            yield _finding(node, finding)


def _find_halted(case: Case) -> Iterator[Node]:
    """Yield every node that is halted when a concurrent node has ended."""
    for node in case.inner_nodes():
        for child in inspection_instance(node).children_halted_by_sibling:
            yield from node_of(child).walk()


def _finding(node: InnerNode, finding: NodeFinding) -> Finding:
    mark, note = node.mark, ""
    if isinstance(finding.place, FailureName):
        mark = finding.place.mark
    elif isinstance(value := node.values.get(str(finding.place)), Literal):
        mark, note = value.mark, value.origin_note
    report = warning if finding.is_warning else error
    return report(mark, finding.code, finding.message + note, finding.hint)


class CaseFacts:
    """Knowledge of the checker about a control node; implements `NodeFacts`."""

    def __init__(self, case: Case, node: InnerNode, is_halted_by_sibling: bool) -> None:
        self._case, self._node = case, node
        self.is_halted_by_sibling = is_halted_by_sibling

    def get_flow(self, child: Child) -> Flow | None:
        """Return how a child may end; None if it never runs."""
        return self._case.flow.flows.get(node_of(child).path)

    def get_name(self, child: Child) -> str:
        """Return the name of a child in paths."""
        return name_of(node_of(child))

    def describe_place(self, reason: Reason, reported: Reason) -> str:
        """Return the place of a failure name for a finding about the failure name `reported`."""
        return cast("FailureName", reason).mark.place(cast("FailureName", reported).mark.source)

    def is_literal(self, key: str) -> bool:
        """Return True if the node gives the value of a key literally, not through a param or an argument."""
        value = self._node.values.get(key)
        return isinstance(value, Literal) and not value.origin

    def get_min_time(self, child: Child) -> float:
        """Return a lower bound of the time in which a child can succeed [s]."""
        return min_time(self._case, node_of(child))

    def list_skill_times(self, child: Child) -> Sequence[tuple[str, float]]:
        """Return the names and minimum times [s] of the skills in and below a child."""
        skills = [node for node in node_of(child).walk() if isinstance(node, SkillNode)]
        return [(node.skill, min_time(self._case, node)) for node in skills]

    def list_skills(self) -> Sequence[type[Skill] | None]:
        """Return the skills below the node; None stands for a skill that is not installed."""
        return [
            self._case.skills.get(node.skill) for node in self._node.walk() if isinstance(node, SkillNode)
        ]
