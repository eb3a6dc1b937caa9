"""Connections of the ports of a skill: constants, variables that are read, and variables that are written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from executive.mission.model.nodes import InnerNode, Node, SkillNode, iterate_parts
from executive.mission.model.values import Literal, Named, Reference
from executive.mission.source import Mark
from executive.skill import Direction, Port, Skill
from executive.tree.keys import Key, Kind


@dataclass(frozen=True)
class Wire:
    """A port and the variable it is connected to.

    Attributes:
        skill: Name of the skill.
        port: Its port.
        variable: Name of the variable.
        mark: Place of the variable in the mission, or of the skill if the variable has the name of the port.
        explicit: True if the mission names the variable.
    """

    skill: str
    port: Port
    variable: str
    mark: Mark
    explicit: bool

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
            yield Wire(node.skill, port, node.names.get(port.name, port.name), node.mark, explicit=False)
        elif isinstance(setting.value, Reference):
            yield Wire(node.skill, port, setting.value.name, setting.value.mark, explicit=True)


def find_literals(node: SkillNode) -> Iterator[tuple[str, Literal]]:
    """Yield every setting with a constant, with its name."""
    for name, setting in node.settings.items():
        if isinstance(setting.value, Literal):
            yield name, setting.value


def find_written_variables(node: Node) -> Iterator[tuple[Key, Named]]:
    """Yield each output key of a control node, with the variable to which the node writes."""
    if isinstance(node, InnerNode):
        for key, value in iterate_parts(node):
            if isinstance(value, Named):
                yield key, value


def find_read_variables(node: Node) -> Iterator[Reference]:
    """Yield the variables that a control node reads."""
    if isinstance(node, InnerNode):
        for key, value in iterate_parts(node):
            if key.kind is Kind.ELEMENTS and isinstance(value, Reference):
                yield value


def find_all_written_variables(root: Node, skills: Mapping[str, type[Skill]]) -> set[str]:
    """Return the variables that the nodes of a tree may write."""
    written = set()
    for node in root.walk():
        written |= {variable.name for _, variable in find_written_variables(node)}
        if isinstance(node, SkillNode) and node.skill in skills:
            written |= {wire.variable for wire in find_wires(node, skills[node.skill], Direction.OUT)}
    return written
