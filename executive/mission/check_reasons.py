"""Checks of `on`, `catch` and `until`: could what they name ever happen there?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from executive.mission.case import Case
from executive.mission.findings import Finding, alternatives, error
from executive.mission.model import (
    InvertNode,
    Match,
    Node,
    RepeatNode,
    RetryNode,
    SkillNode,
    TimeoutNode,
    TryNode,
    UseNode,
)
from executive.skill import Skill

_OWN = {TimeoutNode: ("timeout", "timeout"), InvertNode: ("invert", "inverted")}
"""Control nodes that fail for a reason of their own: their word, and the reason."""


def matches(case: Case) -> Iterator[Finding]:
    """Find every failure that is waited for and cannot come."""
    for node in case.nodes():
        for match, where, body in _expectations(node):
            yield from _impossible(match, where, body, case.skills)


def _expectations(node: Node) -> Iterator[tuple[Match, str, Node]]:
    """Yield every failure a node waits for, the key it stands under, and the body it should come from."""
    if isinstance(node, RetryNode):
        yield from ((match, "retry", node.do) for match in node.on)
    elif isinstance(node, RepeatNode):
        yield from ((match, "repeat", node.do) for match in node.until)
    elif isinstance(node, TryNode):
        yield from ((match, "try", node.do) for catch in node.catches for match in catch.on)


def _impossible(match: Match, where: str, body: Node, skills: Mapping[str, type[Skill]]) -> Iterator[Finding]:
    raised = _raised(body, skills)
    if raised is None:
        return
    if match.source in raised:
        reasons = raised[match.source]
        if match.reason not in reasons:
            hint = alternatives(match.reason, reasons, f"{match.source} may fail with")
            message = f'{match.source} never fails with "{match.reason}"'
            yield error(match.mark, "unknown-reason", message, hint)
    elif match.source in skills:
        message = f"{match.source} is not in the body of this {where}, so {match} cannot come from it"
        yield error(match.mark, "impossible-reason", message, f"In the body: {', '.join(raised) or 'none'}.")
    else:
        hint = alternatives(match.source, raised, "In the body")
        message = f'there is no skill or label "{match.source}"'
        yield error(match.mark, "unknown-skill", message, hint)


def _raised(body: Node, skills: Mapping[str, type[Skill]]) -> dict[str, list[str]] | None:
    """Return the reasons that may come out of `body` by skill or label; None if a part of it is unknown.

    What a `catch` inside would keep back is counted too: the answer errs on the side of silence.
    """
    raised: dict[str, list[str]] = {}
    for node in body.walk():
        if isinstance(node, UseNode) and node.body is None:
            return None
        if isinstance(node, SkillNode):
            if node.skill not in skills:
                return None
            raised.setdefault(node.skill, list(skills[node.skill].reasons))
        elif type(node) in _OWN:
            word, reason = _OWN[type(node)]
            raised.setdefault(word, [reason])
        if node.label:
            inside = [reason for reasons in _below(node, skills) for reason in reasons]
            raised[node.label] = [*raised.get(node.label, []), *inside]
    return {source: list(dict.fromkeys(reasons)) for source, reasons in raised.items()}


def _below(node: Node, skills: Mapping[str, type[Skill]]) -> Iterator[tuple[str, ...]]:
    for inner in node.walk():
        if isinstance(inner, SkillNode) and inner.skill in skills:
            yield tuple(skills[inner.skill].reasons)
        elif type(inner) in _OWN:
            yield (_OWN[type(inner)][1],)
