"""Checks of the flow: nodes that can never run, and the state of the tool."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.case import Case
from executive.mission.findings import Finding, error, warning
from executive.mission.flow.analysis import Analysis
from executive.mission.model.instance import inspection_instance, node_of
from executive.mission.model.nodes import InnerNode, Node, SkillNode
from executive.mission.model.paths import name_of
from executive.mission.source import Mark
from executive.skill import EMPTY, HOLDING
from executive.tree.flow import PossibleToolState
from executive.tree.node import ControlNode


def find_unreachable(case: Case) -> Iterator[Finding]:
    """Find the first node of every part of the tree that can never run."""
    yield from _unreachable(case.tree, case.flow)


def _unreachable(node: Node, flow: Analysis) -> Iterator[Finding]:
    model = inspection_instance(node) if isinstance(node, InnerNode) else None
    for child in node.children:
        if child.path in flow.entry:
            yield from _unreachable(child, flow)
        elif model and (why := _explain_unreachable(model, child)):
            is_list = isinstance(child, InnerNode) and child.is_list and not child.label
            called = "this list" if is_list else name_of(child)
            yield warning(child.mark, "unreachable", f"{called} can never run: {why}")
            return


def _explain_unreachable(model: ControlNode, child: Node) -> str:
    stand_in = next(one for key in model.keys for one in model.list_children(key) if node_of(one) is child)
    return model.explain_unreachable(stand_in)


def check_tool_states(case: Case) -> Iterator[Finding]:
    """Find every skill that needs an empty tool where it may hold something, or the other way round."""
    flow = case.flow
    for path, entry in flow.entry.items():
        node = flow.nodes[path]
        if not isinstance(node, SkillNode) or node.skill not in case.skills:
            continue
        before, use = case.skills[node.skill].tool_state[0], case.library_uses.get(path)
        mark = use.mark if use else node.mark
        who = f'{node.skill} in the subtree "{use.name}"' if use else node.skill
        if before is EMPTY and (possible := entry.find_tool_state(HOLDING)):
            message = f"{who} needs an empty tool, but something may still be held here"
            hint = f"{_since(flow, possible, mark)} Put it down on every way from there to here."
            yield error(mark, "tool-state", message, hint)
        if before is HOLDING and (possible := entry.find_tool_state(EMPTY)):
            message = f"{who} needs something in the tool, but it may be empty here"
            yield error(mark, "tool-state", message, _since(flow, possible, mark))


def check_tool_at_end(case: Case) -> Iterator[Finding]:
    """Find out whether the mission may succeed with something in the tool."""
    flow = case.flow
    if flow.result.success and (possible := flow.result.success.find_tool_state(HOLDING)):
        message = "the mission may end well with something still in the tool"
        yield warning(case.tree.mark, "tool-state", message, _since(flow, possible, case.tree.mark))


def _since(flow: Analysis, possible: PossibleToolState, mark: Mark) -> str:
    """Return since when the tool may be so, and which failure led on from there."""
    node = flow.nodes.get(possible.cause)
    after = f", when {possible.handled_failure} is handled" if possible.handled_failure else ""
    if node is None:
        return f"Nothing has been grasped before{after}."
    name = node.skill if isinstance(node, SkillNode) else "the node"
    verb = "may hold something" if possible.tool is HOLDING else "may be empty"
    return f"It {verb} since {name} in {node.mark.place(mark.source)}{after}."
