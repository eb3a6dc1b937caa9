"""Lower bounds of the times in which nodes can succeed."""

from __future__ import annotations

from collections.abc import Mapping

from executive.cell.protocols import MinTimes
from executive.mission.check.context import CheckContext
from executive.mission.model.conversion import WrongType, convert_value
from executive.mission.model.instance import get_mission_node, has_valid_constants, make_inspection_instance
from executive.mission.model.nodes import InnerNode, Node, SkillNode, UseNode
from executive.mission.model.wiring import find_literals
from executive.skill import HOLDING, Param, Port


def compute_min_time(context: CheckContext, node: Node) -> float:
    """Return a lower bound of the time in which a node can succeed [s]; 0 if the bound is unknown."""
    match node:
        case SkillNode():
            return _compute_min_time_of_skill(context, node)
        case UseNode(body=Node() as body):
            return compute_min_time(context, body)
        case InnerNode() if has_valid_constants(node):
            instance = make_inspection_instance(node)
            return instance.min_time(lambda child: compute_min_time(context, get_mission_node(child)))
    return 0.0


def _compute_min_time_of_skill(context: CheckContext, node: SkillNode) -> float:
    skill = context.skills.get(node.skill)
    if skill is None or context.min_times is None:
        return 0.0
    declared: Mapping[str, Param | Port] = {**skill.params, **skill.ports}
    values = {name: param.default for name, param in skill.params.items() if not param.is_required}
    for name, literal in find_literals(node):
        try:
            values[name] = convert_value(literal.value, declared[name].type)
        except (KeyError, WrongType):
            # The check of settings reports this error.
            return 0.0
    state = context.flow_analysis.entry_states.get(node.path)
    tools = state.tool_states if state else None
    needs_object = skill.tool_state[0] is HOLDING
    starts_anywhere = needs_object and (tools is None or any(tool.has_arm_moved for tool in tools))
    # The time of a transport has a bound only if it starts where an object was grasped.
    min_times = _TimesFromAnywhere(context.min_times) if starts_anywhere else context.min_times
    return skill.min_time(min_times, values)


class _TimesFromAnywhere:
    """Minimum times of a cell if the arm may have any pose at the start of a transport."""

    def __init__(self, min_times: MinTimes) -> None:
        self._min_times = min_times

    @property
    def descent_time(self) -> float:
        """Time of the guarded last part of an approach [s]."""
        return self._min_times.descent_time

    def get_transport_time(self, bin: str | None) -> float:
        """Return 0, because the object may be above the bin already."""
        del bin
        return 0.0

    def get_answer_time(self, detector: str) -> float:
        """Return the time from a frame to the answer of a detector [s]."""
        return self._min_times.get_answer_time(detector)
