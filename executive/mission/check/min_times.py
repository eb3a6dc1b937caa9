"""Lower bounds of the times in which nodes can succeed."""

from __future__ import annotations

from collections.abc import Mapping

from executive.cell.protocols import MinTimes
from executive.mission.check.case import Case
from executive.mission.model.instance import has_valid_constants, inspection_instance, node_of
from executive.mission.model.nodes import InnerNode, Node, SkillNode, UseNode
from executive.mission.model.typed import WrongType, convert
from executive.mission.model.wiring import find_literals
from executive.skill import HOLDING, Param, Port


def min_time(case: Case, node: Node) -> float:
    """Return a lower bound of the time in which a node can succeed [s]; 0 if nothing is known."""
    match node:
        case SkillNode():
            return _skill(case, node)
        case UseNode(body=Node() as body):
            return min_time(case, body)
        case InnerNode() if has_valid_constants(node):
            return inspection_instance(node).min_time(lambda child: min_time(case, node_of(child)))
    return 0.0


def _skill(case: Case, node: SkillNode) -> float:
    skill = case.skills.get(node.skill)
    if skill is None or case.min_times is None:
        return 0.0
    declared: Mapping[str, Param | Port] = {**skill.params, **skill.ports}
    given = {name: param.default for name, param in skill.params.items() if not param.is_required}
    for name, value in find_literals(node):
        try:
            given[name] = convert(value.value, declared[name].type)
        except (KeyError, WrongType):
            # Another check says so.
            return 0.0
    entry = case.flow.entry.get(node.path)
    tools = entry.tools if entry else None
    carries = skill.tool_state[0] is HOLDING
    from_elsewhere = carries and (tools is None or any(tool.is_arm_moved for tool in tools))
    # How long a carry takes is known from where objects lie, not from wherever the arm went with its load.
    return skill.min_time(_FromAnywhere(case.min_times) if from_elsewhere else case.min_times, given)


class _FromAnywhere:
    """Least times of a cell for an arm that may be anywhere with its load."""

    def __init__(self, least: MinTimes) -> None:
        self._least = least

    @property
    def descent_time(self) -> float:
        """The guarded last part of an approach [s]."""
        return self._least.descent_time

    def get_transport_time(self, bin: str | None) -> float:
        """Nothing: it may be over the bin already."""
        del bin
        return 0.0

    def get_answer_time(self, detector: str) -> float:
        """From a frame to the answer of a detector [s]."""
        return self._least.get_answer_time(detector)
