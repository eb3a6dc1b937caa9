"""Connections of the inputs and outputs of nodes to constants and variables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from executive.mission.model.nodes import InnerNode, Node, SkillNode
from executive.mission.model.values import Literal, LocatedName, Reference
from executive.mission.source import Span
from executive.skill import Direction, Param, Port, Skill
from executive.tree.keys import Key, KeyKind


@dataclass(frozen=True)
class Wire:
    """Connection of a port to a variable.

    Attributes:
        skill: Name of the skill.
        port: Port of the skill, or param whose value a variable gives.
        variable: Name of the variable.
        span: Position of the variable, or of the skill if the mission does not name the variable.
        is_explicit: True if the mission names the variable; otherwise, the variable has the port's name.
        field: Field of the variable that an input reads; "" for the whole value.
    """

    skill: str
    port: Port | Param
    variable: str
    span: Span
    is_explicit: bool
    field: str = ""

    @property
    def reference(self) -> Reference:
        """The variable and the field that an input reads."""
        return Reference(self.variable, self.span, self.field)

    def __str__(self) -> str:
        return f"{self.skill}.{self.port.name}"


def find_wires(node: SkillNode, skill: type[Skill], direction: Direction) -> Iterator[Wire]:
    """Yield the connection of every port of a direction, except inputs with a constant.

    A param with a name as its value counts as an input if the mission gives a variable. An input in `one_of`
    of the skill is connected only if the mission sets it.
    """
    params = skill.params.values() if direction is Direction.IN else ()
    ports = [port for port in skill.ports.values() if port.direction is direction]
    declarations: list[Param | Port] = [*(param for param in params if param.accepts_variable), *ports]
    for declaration in declarations:
        setting = node.settings.get(declaration.name)
        value = setting.value if setting else None
        if isinstance(value, Reference):
            yield Wire(node.skill, declaration, value.name, value.span, is_explicit=True, field=value.field)
        # `check_settings` reports a constant for an output.
        elif isinstance(declaration, Port) and (
            (direction is Direction.OUT and isinstance(value, Literal))
            or (value is None and declaration.name not in skill.one_of)
        ):
            variable = node.variables_by_port.get(declaration.name, declaration.name)
            yield Wire(node.skill, declaration, variable, node.span, is_explicit=False)


def find_literals(node: SkillNode) -> Iterator[tuple[str, Literal]]:
    """Yield the name and the constant of every param and port that has a constant."""
    for name, setting in node.settings.items():
        if isinstance(setting.value, Literal):
            yield name, setting.value


def find_control_node_outputs(node: Node) -> Iterator[tuple[Key, LocatedName]]:
    """Yield each key of a control node that names an output variable, and the variable."""
    if isinstance(node, InnerNode):
        for key, value in node.iterate_keys():
            if isinstance(value, LocatedName):
                yield key, value


def find_control_node_inputs(node: Node) -> Iterator[Reference]:
    """Yield the variables that a control node reads as lists of elements."""
    if isinstance(node, InnerNode):
        for key, value in node.iterate_keys():
            if key.kind is KeyKind.ELEMENTS and isinstance(value, Reference):
                yield value


def find_written_variables(root: Node, skills: Mapping[str, type[Skill]]) -> set[str]:
    """Return the variables that the nodes of a tree may write."""
    variables = set()
    for node in root.walk():
        variables |= {variable.name for _, variable in find_control_node_outputs(node)}
        if isinstance(node, SkillNode) and node.skill in skills:
            variables |= {wire.variable for wire in find_wires(node, skills[node.skill], Direction.OUT)}
    return variables
