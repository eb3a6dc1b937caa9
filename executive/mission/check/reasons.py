"""Checks of labels, and of `on`, `catch` and `until`: they name what can happen there, and one node."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.case import Case
from executive.mission.findings import Finding, alternatives, error
from executive.mission.flow.analysis import Analysis
from executive.mission.flow.state import ANYTHING, Raise
from executive.mission.model import grammar, nodes
from executive.mission.model.nodes import Node
from executive.mission.model.values import Match
from executive.mission.source import Mark

_OWN = {nodes.TimeoutNode: ("timeout", "timeout"), nodes.InvertNode: ("invert", "inverted")}
"""Control nodes that fail for a reason of their own: their word, and the reason."""

_SLOTS = ("do", "recover", "condition", "catch", "finally")
"""Names of the slots of a parent node; paths contain these words, too."""


def labels(case: Case) -> Iterator[Finding]:
    """Find every label that stands for two nodes, or is a word of the language."""
    first: dict[str, Mark] = {}
    for node in case.nodes():
        if not node.label:
            continue
        mark = node.label_mark or node.mark
        if node.label in grammar.CONTROL or node.label in _SLOTS:
            message = f'"{node.label}" is a word of the language and cannot be a label'
            yield error(mark, "bad-label", message)
        # The same place twice is one node of a subtree that is used twice.
        other = first.setdefault(node.label, mark)
        if other != mark:
            message = (
                f'the label "{node.label}" stands for two nodes; the first is in {other.place(mark.source)}'
            )
            yield error(mark, "duplicate-label", message)


def matches(case: Case) -> Iterator[Finding]:
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
            elif len(meant := _meant(case.flow, match, coming)) > 1:
                places = " and ".join(
                    f"{node.mark.place(match.mark.source)}:{node.mark.col}" for node in meant
                )
                message = f"{match} may come from more than one node here, in {places}"
                label = f"label.{match.reason}"
                hint = f"Label them, or the use that leads to them, with as: and name the one meant: {label}."
                yield error(match.mark, "ambiguous", message, hint)


def _expectations(node: Node) -> Iterator[tuple[Match, str, Node]]:
    """Yield every failure a node waits for, the key it stands under, and the body it should come from."""
    if isinstance(node, nodes.RetryNode):
        yield from ((match, "retry", node.do) for match in node.on)
    elif isinstance(node, nodes.RepeatNode):
        yield from ((match, "repeat", node.do) for match in node.until)
    elif isinstance(node, nodes.TryNode):
        yield from ((match, "try", node.do) for catch in node.catches for match in catch.on)


def _impossible(case: Case, flow: Analysis, match: Match, where: str, body: Node) -> Finding:
    inside = _reasons(flow, body)
    if match.source in inside:
        leaving = ", ".join(sorted({str(failure) for failure in flow.flows[body.path].failures}))
        message = f"{match} never leaves the body of this {where}"
        rule = "A retry fails as its body does, a fallback as its last choice."
        hint = f"What leaves it: {leaving or 'nothing'}. {rule}"
        return error(match.mark, "impossible-reason", message, hint)
    # Labels, and control nodes that fail for a reason of their own.
    words = {node.label for node in case.nodes() if node.label} | {word for word, _ in _OWN.values()}
    if match.source in (*case.skills, *words):
        message = f"{match.source} is not in the body of this {where}, so {match} cannot come from it"
        return error(match.mark, "impossible-reason", message, f"In the body: {', '.join(inside) or 'none'}.")
    hint = alternatives(match.source, inside, "In the body")
    return error(match.mark, "unknown-skill", f'there is no skill or label "{match.source}"', hint)


def _unknown(case: Case, flow: Analysis, match: Match, body: Node) -> Finding | None:
    """Return a finding where what a name means has no such reason, wherever it stands."""
    skill = case.skills.get(match.source)
    reasons = skill.reasons if skill else _reasons(flow, body).get(match.source)
    if reasons is None or match.reason in reasons or ANYTHING in reasons:
        return None
    hint = alternatives(match.reason, reasons, f"{match.source} may fail with")
    return error(match.mark, "unknown-reason", f'{match.source} never fails with "{match.reason}"', hint)


def _reasons(flow: Analysis, body: Node) -> dict[str, list[str]]:
    """Return the reasons of everything in `body` by skill, control word or label, caught inside or not."""
    reasons: dict[str, list[str]] = {}
    for node in body.walk():
        own: list[str] = []
        if isinstance(node, nodes.SkillNode):
            skill = flow.skill(node.skill)
            reasons.setdefault(node.skill, []).extend(skill.reasons if skill else ())
        elif type(node) in _OWN:
            word, reason = _OWN[type(node)]
            own = reasons.setdefault(word, [])
            own.append(reason)
        if node.label and node.path in flow.flows:
            passed = flow.flows[node.path].failures
            reasons.setdefault(node.label, []).extend(failure.reason for failure in passed)
    return {source: list(dict.fromkeys(found)) for source, found in reasons.items()}


def _meant(flow: Analysis, match: Match, coming: list[Raise]) -> list[Node]:
    """Return the nodes that a name means; a label means whatever fails under it, and so one thing."""
    if any(match.source in failure.labels for failure in coming):
        return []
    # The same place twice is one node of a subtree that is used twice.
    sure = [flow.nodes[failure.origin] for failure in coming if failure.must_match([match])]
    places = {node.mark: node for node in sure}
    return sorted(places.values(), key=lambda node: (node.mark.line, node.mark.col))
