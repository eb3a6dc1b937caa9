"""Checks of nodes that can never run, and of the state of the tool before each skill."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.context import CheckContext
from executive.mission.findings import Finding, make_error, make_warning
from executive.mission.flow_analysis import FlowAnalysis
from executive.mission.model.instance import make_inspection_instance
from executive.mission.model.nodes import InnerNode, Node, SkillNode
from executive.mission.source import Span
from executive.skill import EMPTY, HOLDING
from executive.tree.flow import PossibleToolState


def find_unreachable(context: CheckContext) -> Iterator[Finding]:
    """For each node, yield a warning for the first child that can never run."""
    yield from _find_unreachable_below(context.tree, context.flow_analysis)


def _find_unreachable_below(node: Node, flow: FlowAnalysis) -> Iterator[Finding]:
    instance = make_inspection_instance(node) if isinstance(node, InnerNode) else None
    for child in node.children:
        if child.path in flow.entry_states:
            yield from _find_unreachable_below(child, flow)
        elif instance and instance.unreachable_reason:
            is_list = child.is_list and not child.label
            name = "this list" if is_list else child.path_name
            message = f"{name} can never run: {instance.unreachable_reason}"
            yield make_warning(child.span, "unreachable", message)
            return


def check_tool_states(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every skill that may start with the opposite of the required tool state."""
    flow = context.flow_analysis
    for node, skill in context.find_installed_skills(flow.nodes[path] for path in flow.entry_states):
        required_state, entry_state = skill.tool_state[0], flow.entry_states[node.path]
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
    flow, span = context.flow_analysis, context.tree.span
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
