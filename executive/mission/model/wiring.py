"""Connections of the ports of skills and control nodes: constants, and variables that are read or written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from executive.mission.model.nodes import InnerNode, Node, SkillNode, iterate_keys
from executive.mission.model.values import Literal, LocatedName, Reference
from executive.mission.source import Mark
from executive.skill import Direction, Port, Skill
from executive.tree.keys import Key, KeyKind


@dataclass(frozen=True)
class Wire:
    """A port and the variable it is connected to.

    Attributes:
        skill: Name of the skill.
        port: Its port.
        variable: Name of the variable.
        mark: Position of the variable in the mission; position of the skill if the mission names no variable.
        is_explicit: True if the mission names the variable; otherwise the name of the port is its name.
    """

    skill: str
    port: Port
    variable: str
    mark: Mark
    is_explicit: bool

    def __str__(self) -> str:
        return f"{self.skill}.{self.port.name}"


def find_wires(node: SkillNode, skill: type[Skill], direction: Direction) -> Iterator[Wire]:
    """Yield the connection of every port of this direction; inputs with a constant are skipped."""
    for port in skill.ports.values():
        if port.direction is not direction:
            continue
        setting = node.settings.get(port.name)
        if setting is None or (direction is Direction.OUT and isinstance(setting.value, Literal)):
            # A constant for an output is an error, which the check of settings reports.
            variable = node.variables_by_port.get(port.name, port.name)
            yield Wire(node.skill, port, variable, node.mark, is_explicit=False)
        elif isinstance(setting.value, Reference):
            yield Wire(node.skill, port, setting.value.name, setting.value.mark, is_explicit=True)


def find_literals(node: SkillNode) -> Iterator[tuple[str, Literal]]:
    """Yield every param or port that has a constant, with its name."""
    for name, setting in node.settings.items():
        if isinstance(setting.value, Literal):
            yield name, setting.value


def find_control_node_outputs(node: Node) -> Iterator[tuple[Key, LocatedName]]:
    """Yield each key of a control node that names an output variable, with the variable."""
    if isinstance(node, InnerNode):
        for key, value in iterate_keys(node):
            if isinstance(value, LocatedName):
                yield key, value


def find_control_node_inputs(node: Node) -> Iterator[Reference]:
    """Yield the variables that a control node reads as lists of elements."""
    if isinstance(node, InnerNode):
        for key, value in iterate_keys(node):
            if key.kind is KeyKind.ELEMENTS and isinstance(value, Reference):
                yield value


def find_written_variables(root: Node, skills: Mapping[str, type[Skill]]) -> set[str]:
    """Return the variables that the nodes of a tree may write."""
    written = set()
    for node in root.walk():
        written |= {variable.name for _, variable in find_control_node_outputs(node)}
        if isinstance(node, SkillNode) and node.skill in skills:
            written |= {wire.variable for wire in find_wires(node, skills[node.skill], Direction.OUT)}
    return written
