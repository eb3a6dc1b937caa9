"""Checks of control nodes: constants, conditions, labels, failure names, and findings of the nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from pydantic import TypeAdapter

from executive.mission import grammar
from executive.mission.analysis import CheckContext, FlowAnalysis
from executive.mission.ports import ValueProblem, convert_constant
from executive.skill import Skill, list_condition_violations
from executive.text.findings import (
    Finding,
    Span,
    describe_value,
    make_error,
    make_warning,
    suggest_choice,
    suggest_word,
)
from executive.tree.flow import UNKNOWN_NAME, Flow, FlowState, PossibleFailure
from executive.tree.keys import PREDEFINED_LISTS, KeySection, KeyValue, list_nodes
from executive.tree.node import ControlNode, NodeFinding
from executive.tree.specification import Constant, Node, Reason, Reference, SkillNode, SubtreeNode


def check_constants(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every constant of a control node that is invalid or a reference to a variable."""
    for node in context.control_nodes:
        yield from _check_keys(context, node, node.keyword)


def _check_keys(context: CheckContext, owner: ControlNode | KeySection, name: str) -> Iterator[Finding]:
    for key, value in owner.list_values():
        for item in value if isinstance(value, tuple) else (value,):
            if isinstance(item, KeySection):
                yield from _check_keys(context, item, key.name)
        if key.is_constant:
            validator = key.make_validator(owner.find_max(key, vars(owner)))
            yield from check_constant(context, f"{name}.{key.name}", validator, value)
        elif (
            key.is_plain
            and isinstance(value, Constant)
            and not isinstance(value.value, list)
            and value.value not in PREDEFINED_LISTS
        ):
            suggestion = suggest_word(value.value, PREDEFINED_LISTS)
            description = f"{describe_value(value.value)}{suggestion}{value.origin_note}"
            names = ", ".join(PREDEFINED_LISTS)
            message = f"{name}.{key.name} must be a list, a variable, or one of {names}, not {description}"
            is_text_in_mission = isinstance(value.value, str) and not value.origin
            hint = f"Write a list: [{value.value}]." if is_text_in_mission else ""
            yield make_error(value.span, "wrong-type", message, hint)


def check_constant(
    context: CheckContext, name: str, validator: TypeAdapter[object], value: KeyValue
) -> Iterator[Finding]:
    """Yield an error if `value` is a variable or no valid constant; `name` is the subject of the message."""
    if isinstance(value, Reference):
        message = f"{name} must be a constant, but ${value.name} is neither a param nor an argument"
        yield make_error(value.span, "unknown-param", message, context.make_unknown_param_hint(value))
    elif isinstance(value, Constant):
        try:
            convert_constant(validator, value.value)
        except ValueProblem as problem:
            is_param_name = isinstance(value.value, str) and value.value in context.mission.params
            is_missing_dollar = is_param_name and problem.code == "wrong-type"
            hint = f"For the param, write ${value.value}." if is_missing_dollar else ""
            yield make_error(value.span, problem.code, f"{name} {problem}{value.origin_note}", hint)


def run_node_checks(context: CheckContext) -> Iterator[Finding]:
    """For every control node, yield an error per child that must be a condition, but is none.

    For a control node without such errors, yield the findings of its method `check`.
    """
    halted_paths = _find_paths_below(context, lambda node: node.children_halted_by_sibling)
    concurrent_paths = _find_paths_below(context, lambda node: node.concurrent_children)
    for node in context.control_nodes:
        if non_conditions := list(find_non_conditions(context, node)):
            yield from non_conditions
            continue
        analysis = CheckerAnalysis(context, node.path in halted_paths, node.path in concurrent_paths)
        for node_finding in node.check(analysis):
            yield _convert_node_finding(node, node_finding)


def _find_paths_below(
    context: CheckContext, select_children: Callable[[ControlNode], Sequence[Node]]
) -> set[str]:
    """Return the paths of all nodes in and below the selected children of all control nodes."""
    roots = [child for node in context.control_nodes for child in select_children(node)]
    return {node.path for root in roots for node in root.walk()}


def _convert_node_finding(node: ControlNode, node_finding: NodeFinding) -> Finding:
    """Return the finding at the position of the key, reason or child that it names, or else of `node`."""
    span = node.span
    message = node_finding.message
    if isinstance(node_finding.place, Reason | Node):
        span = node_finding.place.span
    elif isinstance(value := node.settings.get(str(node_finding.place)), Constant):
        span = value.span
        message = message + value.origin_note
    make_finding = make_warning if node_finding.is_warning else make_error
    return make_finding(span, node_finding.code, message, node_finding.hint)


@dataclass
class CheckerAnalysis:
    """Implementation of `NodeAnalysis` for one control node."""

    context: CheckContext
    is_halted_by_sibling: bool
    is_concurrent: bool

    def get_flow(self, child: Node) -> Flow | None:
        """Return the possible outcomes of a child; None if the child never runs."""
        return self.context.flow_analysis.flows.get(child.path)

    def compute_flow(self, child: Node, entry: FlowState, *, is_first_tick: bool = False) -> Flow:
        """Return the possible outcomes of a child that starts in `entry`; optionally, of its first tick."""
        return FlowAnalysis(child, self.context.skills, entry, is_first_tick=is_first_tick).root_flow

    def list_skills(self, node: Node) -> Mapping[str, type[Skill] | None]:
        """Return the class of each skill in and below a node, by name; None if not installed."""
        names = [node.skill for node in node.walk() if isinstance(node, SkillNode)]
        return {name: self.context.skills.get(name) for name in names}


def find_non_conditions(context: CheckContext, parent: ControlNode) -> Iterator[Finding]:
    """Yield an error for each child that is not a condition although its key allows only conditions."""
    for key, value in parent.list_values():
        for node in list_nodes(value) if key.requires_conditions else ():
            if problem := _find_problem(context, node):
                message = f"{problem}, but {parent.type_name}.{key.name} needs a condition"
                yield make_error(node.span, "no-condition", message, _make_hint(context))


def _find_problem(context: CheckContext, node: Node) -> str:
    """Return the beginning of a message about a node that is no condition; "" for a condition."""
    match node:
        case SubtreeNode(body=Node() as body):
            problem = _find_problem(context, body)
            return problem and f'in the subtree "{node.name}", {problem}'
        case SkillNode() if node.skill in context.skills:
            skill = context.skills[node.skill]
            effects = [*list_condition_violations(skill), "is not declared as a condition (is_condition)"]
            return "" if skill.is_condition else f"{node.skill} {effects[0]}"
        case ControlNode() if not node.is_condition:
            return "a list runs as a sequence" if node.is_list else f"{node.type_name} is no condition"
    return ""


def _make_hint(context: CheckContext) -> str:
    """Return a hint with all conditions and the control nodes that combine conditions."""
    conditions = [name for name, skill in context.skills.items() if skill.is_condition]
    combining = [word for word, node_class in context.node_classes.items() if node_class.is_condition]
    return f"Conditions: {', '.join(conditions)}; they are combined by {', '.join(combining)}."


def check_labels(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every label that two nodes have, or that is a keyword or key of a control node."""
    first_spans: dict[str, Span] = {}
    # Paths contain keywords and keys, so a label must differ from all of them.
    reserved_words = {grammar.USE_KEYWORD, *context.node_classes}
    for node_class in context.node_classes.values():
        reserved_words |= {key.name for key in node_class.keys.values() if key.has_nodes}
    for node in context.nodes:
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


def _find_names_with_bodies(node: Node) -> Iterator[tuple[Reason, str, Node]]:
    """Yield every failure name of a node, the keyword of the node, and the child that may fail."""
    if not isinstance(node, ControlNode):
        return
    for name in _find_failure_names(node):
        for body in node.list_children("do"):
            yield name, node.keyword, body


def _find_failure_names(owner: ControlNode | KeySection) -> Iterator[Reason]:
    """Yield the names of failures in the keys of a node and of its sections."""
    for _, value in owner.list_values():
        for item in value if isinstance(value, tuple) else (value,):
            if isinstance(item, Reason):
                yield item
            elif isinstance(item, KeySection):
                yield from _find_failure_names(item)


def _make_impossible_error(context: CheckContext, name: Reason, keyword: str, body: Node) -> Finding:
    """Return the error if no failure of `body` has the name; `keyword` is the keyword of the parent."""
    reasons = _find_reasons(context.flow_analysis, body)
    if name.source in reasons:
        failures = context.flow_analysis.flows[body.path].failures
        names = ", ".join(sorted({str(failure) for failure in failures})) or "none"
        message = f"{name} never leaves the body of this {keyword}"
        hint = f"Failures that leave it: {names}. A loop fails like its body, a fallback like its last child."
        return make_error(name.span, "impossible-reason", message, hint)
    labels = {node.label for node in context.nodes if node.label}
    keywords = {word for word, node_class in context.node_classes.items() if node_class.reasons}
    if name.source in (*context.skills, *labels, *keywords):
        message = f"{name.source} is not in the body of this {keyword}, so the body cannot fail with {name}"
        hint = f"The body contains: {', '.join(reasons) or 'none'}."
        return make_error(name.span, "impossible-reason", message, hint)
    hint = suggest_choice(name.source, reasons, "The body contains")
    return make_error(name.span, "unknown-skill", f'there is no skill or label "{name.source}"', hint)


def _find_unknown_reason(context: CheckContext, name: Reason, body: Node) -> Finding | None:
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
        elif isinstance(node, ControlNode) and node.reasons:
            reasons.setdefault(node.keyword, []).extend(node.reasons)
        if node.label and node.path in flow.flows:
            failures = flow.flows[node.path].failures
            reasons.setdefault(node.label, []).extend(failure.reason for failure in failures)
    return {source: list(dict.fromkeys(duplicates)) for source, duplicates in reasons.items()}


def _find_named_nodes(flow: FlowAnalysis, name: Reason, matching: list[PossibleFailure]) -> list[Node]:
    """Return the nodes whose failures `name` denotes; none for a label, because labels are unambiguous."""
    if any(name.source in failure.labels for failure in matching):
        return []
    denoted = [flow.nodes[failure.path] for failure in matching if failure.matches([name])]
    nodes_by_span = {node.span: node for node in denoted}
    return sorted(nodes_by_span.values(), key=lambda node: (node.span.line, node.span.col))
