"""Checks of labels, and of the failure names below keys such as `on` and `until`."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.context import CheckContext
from executive.mission.findings import Finding, make_error, suggest_choice
from executive.mission.flow_analysis import FlowAnalysis
from executive.mission.model import grammar
from executive.mission.model.nodes import InnerNode, Node, NodeSection, SkillNode, list_nodes
from executive.mission.model.values import LocatedReason
from executive.mission.source import Span
from executive.tree.flow import UNKNOWN_NAME, PossibleFailure
from executive.tree.keys import Key, KeyKind


def check_labels(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every label that two nodes have, or that is a keyword or key of a control node."""
    first_spans: dict[str, Span] = {}
    # Paths contain keywords and keys, so a label must differ from all of them.
    reserved_words = {grammar.USE_KEYWORD, *context.node_classes}
    for node_class in context.node_classes.values():
        keys, kinds = node_class.keys.values(), (KeyKind.NODE, KeyKind.NODES, KeyKind.SECTIONS)
        reserved_words |= {key.name for key in keys if key.kind in kinds}
    for node in context.iterate_nodes():
        if not node.label:
            continue
        span = node.label_span or node.span
        if node.label in reserved_words:
            message = f'"{node.label}" is a word of the mission language and cannot be a label'
            yield make_error(span, "bad-label", message)
        # Nodes with the same position are one node of a subtree that is used more than once.
        other_span = first_spans.setdefault(node.label, span)
        if other_span != span:
            place = other_span.describe_place(span.source)
            message = f'two nodes have the label "{node.label}"; the other node is in {place}'
            yield make_error(span, "duplicate-label", message)


def check_failure_names(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every failure name that is unknown, ambiguous, or impossible in the body."""
    analysis = context.flow_analysis
    for node in analysis.nodes.values():
        for name, keyword, body in _find_names_with_bodies(node):
            flow = analysis.flows.get(body.path)
            if flow is None:
                continue
            matching = [failure for failure in flow.failures if failure.may_match([name])]
            if unknown_reason := _find_unknown_reason(context, name, body):
                yield unknown_reason
            elif not matching:
                yield _make_impossible_error(context, name, keyword, body)
            elif len(sources := _find_named_nodes(analysis, name, matching)) > 1:
                places = " and ".join(
                    f"{source.span.describe_place(name.span.source)}:{source.span.col}" for source in sources
                )
                message = f"{name} is ambiguous: more than one node in the body can fail so, in {places}"
                hint = f"Give each node, or its use, a label with as:, and write label.{name.reason}."
                yield make_error(name.span, "ambiguous", message, hint)


def _find_names_with_bodies(node: Node) -> Iterator[tuple[LocatedReason, str, Node]]:
    """Yield every failure name of a node, the keyword of the node, and the child that may fail."""
    if not isinstance(node, InnerNode):
        return
    for key, name in _find_failure_names(node):
        for body in list_nodes(node.values.get(key.failing_nodes_key, ())):
            yield name, node.declaring_class.keyword, body


def _find_failure_names(owner: InnerNode | NodeSection) -> Iterator[tuple[Key, LocatedReason]]:
    """Yield the names of failures in the keys of a node and of its sections."""
    for key, value in owner.iterate_keys():
        for item in value if isinstance(value, tuple) else (value,):
            if isinstance(item, LocatedReason):
                yield key, item
            elif isinstance(item, NodeSection):
                yield from _find_failure_names(item)


def _make_impossible_error(context: CheckContext, name: LocatedReason, keyword: str, body: Node) -> Finding:
    """Return the error if no failure of `body` has the name; `keyword` is the keyword of the parent."""
    reasons = _find_reasons(context.flow_analysis, body)
    if name.source in reasons:
        failures = context.flow_analysis.flows[body.path].failures
        names = ", ".join(sorted({str(failure) for failure in failures})) or "none"
        message = f"{name} never leaves the body of this {keyword}"
        hint = f"Failures that leave it: {names}. A loop fails like its body, a fallback like its last child."
        return make_error(name.span, "impossible-reason", message, hint)
    labels = {node.label for node in context.iterate_nodes() if node.label}
    keywords = {word for word, node_class in context.node_classes.items() if node_class.reasons}
    if name.source in (*context.skills, *labels, *keywords):
        message = f"{name.source} is not in the body of this {keyword}, so the body cannot fail with {name}"
        hint = f"The body contains: {', '.join(reasons) or 'none'}."
        return make_error(name.span, "impossible-reason", message, hint)
    hint = suggest_choice(name.source, reasons, "The body contains")
    return make_error(name.span, "unknown-skill", f'there is no skill or label "{name.source}"', hint)


def _find_unknown_reason(context: CheckContext, name: LocatedReason, body: Node) -> Finding | None:
    """Return an error if the skill or label exists, but never fails with the reason; otherwise None."""
    skill = context.skills.get(name.source)
    reasons = skill.reasons if skill else _find_reasons(context.flow_analysis, body).get(name.source)
    if reasons is None or name.reason in reasons or UNKNOWN_NAME in reasons:
        return None
    hint = suggest_choice(name.reason, reasons, f"{name.source} may fail with")
    return make_error(name.span, "unknown-reason", f'{name.source} never fails with "{name.reason}"', hint)


def _find_reasons(flow: FlowAnalysis, body: Node) -> dict[str, list[str]]:
    """Return all reasons in `body`, also of handled failures, by the failing skill, keyword or label."""
    reasons: dict[str, list[str]] = {}
    for node in body.walk():
        if isinstance(node, SkillNode):
            skill = flow.find_skill_or_most_similar(node.skill)
            reasons.setdefault(node.skill, []).extend(skill.reasons if skill else ())
        elif isinstance(node, InnerNode) and node.declaring_class.reasons:
            reasons.setdefault(node.declaring_class.keyword, []).extend(node.declaring_class.reasons)
        if node.label and node.path in flow.flows:
            failures = flow.flows[node.path].failures
            reasons.setdefault(node.label, []).extend(failure.reason for failure in failures)
    return {source: list(dict.fromkeys(duplicates)) for source, duplicates in reasons.items()}


def _find_named_nodes(flow: FlowAnalysis, name: LocatedReason, matching: list[PossibleFailure]) -> list[Node]:
    """Return the nodes whose failures `name` denotes; none for a label, because labels are unambiguous."""
    if any(name.source in failure.labels for failure in matching):
        return []
    denoted = [flow.nodes[failure.origin] for failure in matching if failure.must_match([name])]
    nodes_by_span = {node.span: node for node in denoted}
    return sorted(nodes_by_span.values(), key=lambda node: (node.span.line, node.span.col))
