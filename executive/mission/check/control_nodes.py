"""Checks of control nodes: types of constants, conditions, and the method `check` of each node class."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import cast

from executive.mission.check.context import CheckContext
from executive.mission.descriptions import describe_value
from executive.mission.findings import Finding, make_error, make_warning, suggest_word
from executive.mission.flow_analysis import FlowAnalysis
from executive.mission.model.conversion import ValueProblem, convert_constant
from executive.mission.model.instance import find_upper_bound, get_mission_node, make_inspection_instance
from executive.mission.model.nodes import (
    InnerNode,
    KeyValue,
    Node,
    NodeSection,
    SkillNode,
    SubtreeNode,
    list_nodes,
)
from executive.mission.model.values import Literal, LocatedReason, Reference
from executive.skill import Skill, list_condition_violations
from executive.tree.failure import Reason
from executive.tree.flow import Flow, FlowState
from executive.tree.inspection import NodeFinding
from executive.tree.keys import PREDEFINED_LISTS, Child, Key, KeyKind
from executive.tree.node import ControlNode


def check_constants(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every constant of a control node that is invalid or a reference to a variable."""
    for node in context.iterate_control_nodes():
        yield from _check_keys(context, node, node.declaring_class.keyword)


def _check_keys(context: CheckContext, owner: InnerNode | NodeSection, name: str) -> Iterator[Finding]:
    for key, value in owner.iterate_keys():
        for item in value if isinstance(value, tuple) else (value,):
            if isinstance(item, NodeSection):
                yield from _check_keys(context, item, key.name)
        if key.kind is KeyKind.CONSTANT:
            max_value = find_upper_bound(owner, key)
            yield from check_constant(context, f"{name}.{key.name}", key, value, max_value)
        elif (
            key.kind is KeyKind.ELEMENTS
            and isinstance(value, Literal)
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
    context: CheckContext, name: str, key: Key, value: KeyValue, max_value: int | None = None
) -> Iterator[Finding]:
    """Yield an error if `value` is a variable or no valid constant; `name` is the subject of the message."""
    if isinstance(value, Reference):
        message = f"{name} must be a constant, but ${value.name} is neither a param nor an argument"
        yield make_error(value.span, "unknown-param", message, context.make_unknown_param_hint(value))
    elif isinstance(value, Literal):
        try:
            convert_constant(key, value.value, max_value)
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
    for node in context.iterate_control_nodes():
        if non_conditions := list(find_non_conditions(context, node)):
            yield from non_conditions
            continue
        analysis = CheckerAnalysis(context, node, node.path in halted_paths, node.path in concurrent_paths)
        for node_finding in make_inspection_instance(node).check(analysis):
            yield _convert_node_finding(node, node_finding)


def _find_paths_below(
    context: CheckContext, select_children: Callable[[ControlNode], Sequence[Child]]
) -> set[str]:
    """Return the paths of all nodes in and below the selected children of all control nodes."""
    instances = map(make_inspection_instance, context.iterate_control_nodes())
    roots = [get_mission_node(child) for instance in instances for child in select_children(instance)]
    return {node.path for root in roots for node in root.walk()}


def _convert_node_finding(node: InnerNode, node_finding: NodeFinding) -> Finding:
    """Return the finding at the position of the key, reason or child that it names, or else of `node`."""
    span, message = node.span, node_finding.message
    if isinstance(node_finding.place, LocatedReason):
        span = node_finding.place.span
    elif isinstance(node_finding.place, Child):
        span = get_mission_node(node_finding.place).span
    elif isinstance(value := node.values.get(str(node_finding.place)), Literal):
        span, message = value.span, message + value.origin_note
    make_finding = make_warning if node_finding.is_warning else make_error
    return make_finding(span, node_finding.code, message, node_finding.hint)


class CheckerAnalysis:
    """Implementation of `NodeAnalysis` for one control node."""

    def __init__(
        self, context: CheckContext, node: InnerNode, is_halted_by_sibling: bool, is_concurrent: bool
    ) -> None:
        self._context, self._node = context, node
        self.is_halted_by_sibling, self.is_concurrent = is_halted_by_sibling, is_concurrent

    def get_flow(self, child: Child) -> Flow | None:
        """Return the possible outcomes of a child; None if the child never runs."""
        return self._context.flow_analysis.flows.get(get_mission_node(child).path)

    def compute_flow(self, child: Child, entry: FlowState, *, is_first_tick: bool = False) -> Flow:
        """Return the possible outcomes of a child that starts in `entry`; optionally, of its first tick."""
        node = get_mission_node(child)
        return FlowAnalysis(node, self._context.skills, entry, is_first_tick=is_first_tick).root_flow

    def get_name(self, child: Child) -> str:
        """Return the last part of the path of a child."""
        return get_mission_node(child).path_name

    def describe_place(self, reason: Reason, relative_to: Reason) -> str:
        """Return the line of `reason` as a text, with the file if `relative_to` is in another file."""
        source = cast("LocatedReason", relative_to).span.source
        return cast("LocatedReason", reason).span.describe_place(source)

    def is_written_as_constant(self, key: str) -> bool:
        """Return True if the mission has a constant at a key of the node, not a param or an argument."""
        value = self._node.values.get(key)
        return isinstance(value, Literal) and not value.origin

    def list_skills(self, child: Child | None = None) -> Mapping[str, type[Skill] | None]:
        """Return the class of each skill in the subtree of a child or of the node; None if not installed."""
        root = self._node if child is None else get_mission_node(child)
        names = [node.skill for node in root.walk() if isinstance(node, SkillNode)]
        return {name: self._context.skills.get(name) for name in names}


def find_non_conditions(context: CheckContext, parent: InnerNode) -> Iterator[Finding]:
    """Yield an error for each child that is not a condition although its key allows only conditions."""
    for key, value in parent.iterate_keys():
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
        case InnerNode() if not node.declaring_class.is_condition:
            return "a list runs as a sequence" if node.is_list else f"{node.type_name} is no condition"
    return ""


def _make_hint(context: CheckContext) -> str:
    """Return a hint with all conditions and the control nodes that combine conditions."""
    conditions = [name for name, skill in context.skills.items() if skill.is_condition]
    combining = [word for word, node_class in context.node_classes.items() if node_class.is_condition]
    return f"Conditions: {', '.join(conditions)}; they are combined by {', '.join(combining)}."
