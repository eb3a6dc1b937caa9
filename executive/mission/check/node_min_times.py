"""Lower bounds of the times in which nodes can succeed."""

from __future__ import annotations

from collections.abc import Mapping

from executive.mission.check.context import CheckContext
from executive.mission.model.conversion import ValueProblem, convert_value
from executive.mission.model.instance import get_mission_node, has_valid_constants, make_inspection_instance
from executive.mission.model.nodes import InnerNode, Node, SkillNode, SubtreeNode
from executive.mission.model.wiring import find_literals
from executive.skill import HOLDING, Param, Port


def compute_min_time(context: CheckContext, node: Node) -> float:
    """Return a lower bound of the time in which a node can succeed [s]; 0 if the bound is unknown."""
    match node:
        case SkillNode():
            return _compute_min_time_of_skill(context, node)
        case SubtreeNode(body=Node() as body):
            return compute_min_time(context, body)
        case InnerNode() if has_valid_constants(node):
            instance = make_inspection_instance(node)
            return instance.min_time(lambda child: compute_min_time(context, get_mission_node(child)))
    return 0.0


def _compute_min_time_of_skill(context: CheckContext, node: SkillNode) -> float:
    skill = context.skills.get(node.skill)
    if skill is None or context.min_times is None:
        return 0.0
    declarations: Mapping[str, Param | Port] = {**skill.params, **skill.ports}
    constants, params = dict(find_literals(node)), skill.params.values()
    needed_params = [param for param in params if param.is_required or param.name in node.settings]
    if any(param.name not in constants for param in needed_params):
        return 0.0  # a param has no valid value, or a variable gives the value
    values = {param.name: param.default for param in params if not param.is_required}
    try:
        values |= {
            name: convert_value(value.value, declarations[name].type) for name, value in constants.items()
        }
    except (KeyError, ValueProblem):
        return 0.0  # `check_settings` reports unknown names and wrong types
    state = context.flow_analysis.entry_states.get(node.path)
    tool_states = state.tool_states if state else None
    may_have_moved = tool_states is None or any(tool_state.has_arm_moved for tool_state in tool_states)
    if skill.tool_state[0] is HOLDING and may_have_moved:
        # A transport may start above its bin. The minimum time of a transport to an unknown bin is 0.
        values |= {name: "" for name, setting in declarations.items() if setting.refers_to == "bin"}
    return skill.min_time(context.min_times, values)
