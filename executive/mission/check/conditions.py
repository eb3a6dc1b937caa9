"""Check of the nodes that must be conditions."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.context import CheckContext
from executive.mission.findings import Finding, make_error
from executive.mission.model.nodes import InnerNode, Node, SkillNode, SubtreeNode, list_nodes
from executive.skill import list_condition_violations


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
