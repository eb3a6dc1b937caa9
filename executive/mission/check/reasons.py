"""Checks of labels, and of `on`, `catch` and `until`: they name what can happen there, and one node."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.case import Case
from executive.mission.findings import Finding, alternatives, error
from executive.mission.flow.analysis import Analysis
from executive.mission.model import grammar
from executive.mission.model.nodes import InnerNode, Node, SectionNode, SkillNode, iterate_parts, nodes_of
from executive.mission.model.values import FailureName
from executive.mission.source import Mark
from executive.tree.flow import UNKNOWN_NAME, PossibleFailure
from executive.tree.keys import Key, Kind


def check_labels(case: Case) -> Iterator[Finding]:
    """Find every label that stands for two nodes, or is a word of the language."""
    first: dict[str, Mark] = {}
    # Paths contain the words and the slots of all control nodes.
    taken = {grammar.USE, *case.control}
    for kind in case.control.values():
        taken |= {
            key.name for key in kind.keys.values() if key.kind in (Kind.NODE, Kind.NODES, Kind.SECTIONS)
        }
    for node in case.nodes():
        if not node.label:
            continue
        mark = node.label_mark or node.mark
        if node.label in taken:
            message = f'"{node.label}" is a word of the language and cannot be a label'
            yield error(mark, "bad-label", message)
        # The same place twice is one node of a subtree that is used twice.
        other = first.setdefault(node.label, mark)
        if other != mark:
            message = (
                f'the label "{node.label}" stands for two nodes; the first is in {other.place(mark.source)}'
            )
            yield error(mark, "duplicate-label", message)


def check_failure_names(case: Case) -> Iterator[Finding]:
    """Find every failure that is waited for and cannot come, or that more than one node could mean."""
    for node in case.flow.nodes.values():
        for match, where, body in _expectations(node):
            flow = case.flow.flows.get(body.path)
            if flow is None:
                continue
            coming = [failure for failure in flow.failures if failure.may_match([match])]
            if unknown := _unknown(case, case.flow, match, body):
                yield unknown
            elif not coming:
                yield _impossible(case, case.flow, match, where, body)
            elif len(meant := _find_meant_nodes(case.flow, match, coming)) > 1:
                places = " and ".join(
                    f"{node.mark.place(match.mark.source)}:{node.mark.col}" for node in meant
                )
                message = f"{match} may come from more than one node here, in {places}"
                label = f"label.{match.reason}"
                hint = f"Label them, or the use that leads to them, with as: and name the one meant: {label}."
                yield error(match.mark, "ambiguous", message, hint)


def _expectations(node: Node) -> Iterator[tuple[FailureName, str, Node]]:
    """Yield every failure a node waits for, its word, and the body it should come from."""
    if not isinstance(node, InnerNode):
        return
    for key, match in _matches(node):
        for body in nodes_of(node.values[key.raising_key]) if key.raising_key in node.values else ():
            yield match, node.kind.keyword, body


def _matches(owner: InnerNode | SectionNode) -> Iterator[tuple[Key, FailureName]]:
    """Yield the names of failures in the keys of a node and of its sections."""
    for key, value in iterate_parts(owner):
        for item in value if isinstance(value, tuple) else (value,):
            if isinstance(item, FailureName):
                yield key, item
            elif isinstance(item, SectionNode):
                yield from _matches(item)


def _impossible(case: Case, flow: Analysis, match: FailureName, where: str, body: Node) -> Finding:
    inside = _reasons(flow, body)
    if match.source in inside:
        leaving = ", ".join(sorted({str(failure) for failure in flow.flows[body.path].failures}))
        message = f"{match} never leaves the body of this {where}"
        rule = "A loop fails as its body does, a choice as its last alternative."
        hint = f"What leaves it: {leaving or 'nothing'}. {rule}"
        return error(match.mark, "impossible-reason", message, hint)
    # Labels, and control nodes that fail for a reason of their own.
    words = {node.label for node in case.nodes() if node.label}
    words |= {word for word, kind in case.control.items() if kind.reasons}
    if match.source in (*case.skills, *words):
        message = f"{match.source} is not in the body of this {where}, so {match} cannot come from it"
        return error(match.mark, "impossible-reason", message, f"In the body: {', '.join(inside) or 'none'}.")
    hint = alternatives(match.source, inside, "In the body")
    return error(match.mark, "unknown-skill", f'there is no skill or label "{match.source}"', hint)


def _unknown(case: Case, flow: Analysis, match: FailureName, body: Node) -> Finding | None:
    """Return a finding if the skill or label exists, but never fails with the reason."""
    skill = case.skills.get(match.source)
    reasons = skill.reasons if skill else _reasons(flow, body).get(match.source)
    if reasons is None or match.reason in reasons or UNKNOWN_NAME in reasons:
        return None
    hint = alternatives(match.reason, reasons, f"{match.source} may fail with")
    return error(match.mark, "unknown-reason", f'{match.source} never fails with "{match.reason}"', hint)


def _reasons(flow: Analysis, body: Node) -> dict[str, list[str]]:
    """Return the reasons of everything in `body` by skill, control word or label, caught inside or not."""
    reasons: dict[str, list[str]] = {}
    for node in body.walk():
        if isinstance(node, SkillNode):
            skill = flow.skill(node.skill)
            reasons.setdefault(node.skill, []).extend(skill.reasons if skill else ())
        elif isinstance(node, InnerNode) and node.kind.reasons:
            reasons.setdefault(node.kind.keyword, []).extend(node.kind.reasons)
        if node.label and node.path in flow.flows:
            passed = flow.flows[node.path].failures
            reasons.setdefault(node.label, []).extend(failure.reason for failure in passed)
    return {source: list(dict.fromkeys(found)) for source, found in reasons.items()}


def _find_meant_nodes(flow: Analysis, match: FailureName, coming: list[PossibleFailure]) -> list[Node]:
    """Return the nodes that a name means; a label means whatever fails under it, and so one thing."""
    if any(match.source in failure.labels for failure in coming):
        return []
    # The same place twice is one node of a subtree that is used twice.
    sure = [flow.nodes[failure.origin] for failure in coming if failure.must_match([match])]
    places = {node.mark: node for node in sure}
    return sorted(places.values(), key=lambda node: (node.mark.line, node.mark.col))
