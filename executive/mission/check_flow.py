"""Checks of nodes that never run, of the state of the tool, and of concurrent branches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, permutations

from executive.mission.analysis import CheckContext, FlowAnalysis
from executive.mission.ports import Wire
from executive.skill import EMPTY, HOLDING, Direction
from executive.text.findings import Finding, Span, make_error, make_warning
from executive.tree.flow import PossibleToolState
from executive.tree.node import ControlNode
from executive.tree.specification import Node, SkillNode, SubtreeNode


def find_unreachable(context: CheckContext) -> Iterator[Finding]:
    """For each node that can run, yield a warning for the first child that can never run."""
    entry_states = context.flow_analysis.entry_states
    for node in context.control_nodes:
        unreachable = [child for child in node.children if child.path not in entry_states]
        if node.path in entry_states and unreachable and (reason := node.explain_unreachable()):
            child = unreachable[0]
            name = "this list" if child.is_list and not child.label else child.path_name
            yield make_warning(child.span, "unreachable", f"{name} can never run: {reason}")


def check_tool_states(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every skill that may start with the opposite of the required tool state."""
    flow = context.flow_analysis
    for node, skill in context.find_installed_skills(flow.nodes[path] for path in flow.entry_states):
        required_state = skill.tool_state[0]
        entry_state = flow.entry_states[node.path]
        name, span = context.locate_skill(node)
        if required_state is EMPTY and (tool := entry_state.find_tool_state(HOLDING)):
            message = f"{name} needs an empty tool, but the tool may hold an object here"
            explanation = _explain_tool_state(flow, tool, span)
            hint = f"{explanation} Put it down on every path from there to this node."
            yield make_error(span, "tool-state", message, hint)
        if required_state is HOLDING and (tool := entry_state.find_tool_state(EMPTY)):
            message = f"{name} needs an object in the tool, but the tool may be empty here"
            yield make_error(span, "tool-state", message, _explain_tool_state(flow, tool, span))


def check_tool_at_end(context: CheckContext) -> Iterator[Finding]:
    """Yield a warning if the mission may succeed with an object in the tool."""
    flow = context.flow_analysis
    span = context.tree.span
    if flow.root_flow.success and (tool := flow.root_flow.success.find_tool_state(HOLDING)):
        message = "the mission may succeed with an object in the tool"
        yield make_warning(span, "tool-state", message, _explain_tool_state(flow, tool, span))


def _explain_tool_state(flow: FlowAnalysis, tool: PossibleToolState, span: Span) -> str:
    """Return a sentence about the node that may have caused a state of the tool, for a message at `span`."""
    cause = flow.nodes.get(tool.cause)
    after = f", when {tool.handled_failure} is handled" if tool.handled_failure else ""
    if cause is None:
        return f"No object has been grasped before{after}."
    name = cause.skill if isinstance(cause, SkillNode) else "the node"
    state = "may hold an object" if tool.state is HOLDING else "may be empty"
    return f"The tool {state} since {name} in {cause.span.describe_place(span.source)}{after}."


def find_shared_resources(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every two concurrent branches that use the same part of the cell."""
    for branches in _list_concurrent_branches(context):
        users_by_branch = [_find_resource_users(context, branch) for branch in branches]
        for users, later_users in combinations(users_by_branch, 2):
            # One error reports all parts of the cell that the same two skills share.
            shared_resources = [resource for resource in later_users if resource in users]
            conflicts = {(users[name].span, later_users[name].span): name for name in shared_resources}
            for resource in conflicts.values():
                user = users[resource]
                later_user = later_users[resource]
                name, span = context.locate_skill(later_user)
                message = (
                    f"{name} uses the {resource}, and {user.skill} in "
                    f"{user.span.describe_place(span.source)} "
                    "may use it at the same time in another branch of this parallel"
                )
                hint = "Write a sequence, or put both into one branch."
                yield make_error(span, "shared-resource", message, hint)


def find_shared_variables(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every two concurrent branches that write the same variable."""
    for branches in _list_concurrent_branches(context):
        writes_by_branch = [_find_first_writes(context, branch) for branch in branches]
        for writes, later_writes in combinations(writes_by_branch, 2):
            for variable, later_wire in later_writes.items():
                if wire := writes.get(variable):
                    place = wire.span.describe_place(later_wire.span.source)
                    message = (
                        f"{later_wire.node.type_name} writes ${variable}, and so does {wire.node.type_name} "
                        f"in {place}, in another branch of the same parallel"
                    )
                    yield make_error(later_wire.span, "shared-variable", message, later_wire.rename_hint)


def find_read_races(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every input whose variable a concurrent branch may write."""
    for branches in _list_concurrent_branches(context):
        reads = [list(_find_reads(context, branch)) for branch in branches]
        writes = [_find_first_writes(context, branch) for branch in branches]
        for reading_index, writing_index in permutations(range(len(branches)), 2):
            # Branches start in order: the first skill of a branch reads before a later branch writes.
            is_read_first = reading_index < writing_index
            safe_node = _find_first_leaf(branches[reading_index]) if is_read_first else None
            # `find_shared_variables` reports a variable that both branches write.
            racing_variables = writes[writing_index].keys() - writes[reading_index].keys()
            for read in reads[reading_index]:
                if read.node is not safe_node and read.variable in racing_variables:
                    write = writes[writing_index][read.variable]
                    place = write.span.describe_place(read.span.source)
                    message = (
                        f"{read} reads ${read.variable}, while {write.node.type_name} in {place} "
                        "may write it, in another branch of the same parallel"
                    )
                    yield make_error(read.span, "shared-variable", message, write.rename_hint)


def _list_concurrent_branches(context: CheckContext) -> Iterator[Sequence[Node]]:
    """Yield the concurrent children of each control node that has concurrent children."""
    for node in context.control_nodes:
        if node.concurrent_children:
            yield node.concurrent_children


def _find_first_leaf(node: Node) -> Node:
    """Return the first node without children, usually a skill, that the execution of a node reaches."""
    if isinstance(node, SubtreeNode):
        return _find_first_leaf(node.body) if node.body else node
    first_child = node.first_child if isinstance(node, ControlNode) else None
    return _find_first_leaf(first_child) if first_child else node


def _find_reads(context: CheckContext, branch: Node) -> Iterator[Wire]:
    """Yield the reads below `branch`, except those that `find_unwritten_inputs` reports."""
    for read in context.list_wires(branch, Direction.IN):
        state = context.flow_analysis.entry_states.get(read.node.path)
        if state and not (read.is_required and state.may_be_unwritten(read.variable)):
            yield read


def _find_resource_users(context: CheckContext, branch: Node) -> dict[str, SkillNode]:
    """Return the first user of each part of the cell below `branch`, by the name of the part."""
    users: dict[str, SkillNode] = {}
    cameras = context.cell.cameras.values() if context.cell else ()
    is_camera_on_wrist = any(camera.mount == "wrist" for camera in cameras)
    for node, skill in context.find_installed_skills(branch.walk()):
        for resource in skill.uses:
            if resource == "camera" and is_camera_on_wrist:
                # The arm must not move while a camera on the wrist takes an image.
                users.setdefault("arm", node)
            users.setdefault(resource, node)
    return users


def _find_first_writes(context: CheckContext, branch: Node) -> dict[str, Wire]:
    """Return the first write of each variable below `branch`, by variable."""
    writes: dict[str, Wire] = {}
    for wire in context.list_wires(branch, Direction.OUT):
        writes.setdefault(wire.variable, wire)
    return writes
