"""Checks of concurrent branches: they must not use the same part of the cell or write the same variable."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, permutations

from executive.mission.check.context import CheckContext
from executive.mission.findings import Finding, make_error
from executive.mission.model.instance import get_mission_node, make_inspection_instance
from executive.mission.model.node_paths import get_type_name
from executive.mission.model.nodes import InnerNode, Node, SkillNode, UseNode
from executive.mission.model.wiring import find_control_node_inputs, find_control_node_outputs
from executive.mission.source import Span
from executive.skill import Direction


def find_shared_resources(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every two concurrent branches that use the same part of the cell."""
    for branches in _list_concurrent_branches(context):
        users_by_branch = [_find_first_users(context, branch) for branch in branches]
        for users, other_users in combinations(users_by_branch, 2):
            # Two skills that share both arm and tool are reported once.
            shared = [part for part in other_users if part in users]
            conflicts = {(users[part].span, other_users[part].span): part for part in shared}
            for part in conflicts.values():
                user, other_user = users[part], other_users[part]
                use = context.library_uses_by_path.get(other_user.path)
                span = use.span if use else other_user.span
                name = f'{other_user.skill} in the subtree "{use.name}"' if use else other_user.skill
                message = (
                    f"{name} uses the {part}, and {user.skill} in {user.span.describe_place(span.source)} "
                    "may use it at the same time in another branch of this parallel"
                )
                hint = "Write a sequence, or put both into one branch."
                yield make_error(span, "shared-resource", message, hint)


def find_shared_variables(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every two concurrent branches that write the same variable."""
    for branches in _list_concurrent_branches(context):
        writers_by_branch = [_find_first_writers(context, branch) for branch in branches]
        for writers, other_writers in combinations(writers_by_branch, 2):
            for variable, (other_writer, span, hint) in other_writers.items():
                if variable in writers:
                    writer, writer_span, _ = writers[variable]
                    message = (
                        f"{other_writer} writes ${variable}, and so does {writer} in "
                        f"{writer_span.describe_place(span.source)}, in another branch of the same parallel"
                    )
                    yield make_error(span, "shared-variable", message, hint)


def find_read_races(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every input whose variable a concurrent branch may write."""
    for branches in _list_concurrent_branches(context):
        inputs = [list(_find_inputs(context, branch)) for branch in branches]
        writers = [_find_first_writers(context, branch) for branch in branches]
        for index, other in permutations(range(len(branches)), 2):
            # Branches start in order: the first skill of a branch reads before a later branch writes.
            safe_reader = _find_first_leaf(branches[index]) if index < other else None
            # find_shared_variables reports a variable that both branches write.
            written_by_other = writers[other].keys() - writers[index].keys()
            for reader, input_name, variable, span in inputs[index]:
                if reader is not safe_reader and variable in written_by_other:
                    writer, writer_span, hint = writers[other][variable]
                    message = (
                        f"{input_name} reads ${variable}, while {writer} in "
                        f"{writer_span.describe_place(span.source)} may write it, "
                        "in another branch of the same parallel"
                    )
                    yield make_error(span, "shared-variable", message, hint)


def _list_concurrent_branches(context: CheckContext) -> Iterator[list[Node]]:
    """Yield for each control node with concurrent children the list of these children."""
    for node in context.iterate_control_nodes():
        if branches := make_inspection_instance(node).concurrent_children:
            yield [get_mission_node(branch) for branch in branches]


def _find_first_leaf(node: Node) -> Node:
    """Return the skill, or other node without children, that a node executes first."""
    if isinstance(node, UseNode):
        return _find_first_leaf(node.body) if node.body else node
    first = make_inspection_instance(node).first_child if isinstance(node, InnerNode) else None
    return _find_first_leaf(get_mission_node(first)) if first else node


def _find_inputs(context: CheckContext, branch: Node) -> Iterator[tuple[Node, str, str, Span]]:
    """Yield node, name, variable and position of every input below `branch` that may be read.

    The check of unwritten variables reports a required input whose variable is not written before.
    """
    for node in branch.walk():
        state = context.flow_analysis.entry_states.get(node.path)
        if state is None:
            continue
        for reference in find_control_node_inputs(node):
            yield node, get_type_name(node), reference.name, reference.span
        for wire in context.find_wires(node, Direction.IN):
            if (
                state.written_variables is None
                or wire.variable in state.written_variables
                or not wire.port.is_required
            ):
                yield node, str(wire), wire.variable, wire.span


def _find_first_users(context: CheckContext, branch: Node) -> dict[str, SkillNode]:
    """Return the first user of every part of the cell below `branch`, by the name of the part."""
    users: dict[str, SkillNode] = {}
    on_wrist = context.cell is not None and any(c.mount == "wrist" for c in context.cell.cameras.values())
    for node in branch.walk():
        if not isinstance(node, SkillNode) or node.skill not in context.skills:
            continue
        for resource in context.skills[node.skill].uses:
            # The pose of a camera on the wrist depends on the arm, so its users use the arm, too.
            for part in ("arm", resource) if resource == "camera" and on_wrist else (resource,):
                users.setdefault(part, node)
    return users


def _find_first_writers(context: CheckContext, branch: Node) -> dict[str, tuple[str, Span, str]]:
    """Return by variable its first writer below `branch`: name, position, and a hint to rename the output."""
    writers: dict[str, tuple[str, Span, str]] = {}
    for node in branch.walk():
        for key, variable in find_control_node_outputs(node):
            hint = f"Let {get_type_name(node)} write another variable: {key.name}: other."
            writers.setdefault(variable.name, (get_type_name(node), variable.span, hint))
        for wire in context.find_wires(node, Direction.OUT):
            hint = f"Let {wire.skill} write another variable: {wire.port.name}: $other."
            writers.setdefault(wire.variable, (wire.skill, wire.span, hint))
    return writers
