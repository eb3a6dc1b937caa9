"""Types of params and ports, conversion of constants, and connections of ports to variables."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, NamedTuple, NoReturn, Union, cast, get_args, get_origin, get_type_hints

from pydantic import TypeAdapter, ValidationError

from executive.behaviours import Skills, find_mission_type
from executive.cell.objects import KnownItem, RefersTo
from executive.skill import Direction, Param, Port, Skill
from executive.text.findings import Span, describe_validation_error, describe_value, suggest_word
from executive.tree.keys import AnyValue, Elements, Key, is_union
from executive.tree.node import ControlNode
from executive.tree.specification import (
    Constant,
    Expression,
    LocatedName,
    Node,
    Reference,
    SkillNode,
    VariableName,
)

_DESCRIPTIONS = {
    str: "a text",
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    type(None): "nothing",
}
"""Description of the values of a type, for messages."""


def is_assignable(source: object, target: object) -> bool:
    """Return True if every value of the type `source` is also a value of the type `target`."""
    if source is Any or target is Any or source == target or source is NoReturn:
        return True
    if is_union(source):
        return all(is_assignable(part, target) for part in get_args(source))
    if is_union(target):
        return any(is_assignable(source, part) for part in get_args(target))
    if source is int and target is float:
        return True
    if not issubclass(_get_class(source), _get_class(target)):
        return False
    arguments = zip(get_args(source), get_args(target), strict=False)
    return all(is_assignable(*pair) for pair in arguments if ... not in pair)


def find_element_type(declared_type: object) -> object:
    """Return the type of the elements of a list or tuple type, or None for other types."""
    if declared_type is Any:
        return Any
    if declared_type is str or not issubclass(_get_class(declared_type), Sequence):
        return None
    arguments = [argument for argument in get_args(declared_type) if argument is not ...]
    return Union[tuple(arguments)] if arguments else Any  # noqa: UP007 - the number of types varies


class Field(NamedTuple):
    """A field of the values of a type.

    Attributes:
        type: Type of the field.
        refers_to: Kind of the names that the field contains, or "".
        unit: Unit of a number, or "".
    """

    type: object
    refers_to: str = ""
    unit: str = ""


def find_fields(declared_type: object, refers_to: str) -> dict[str, Field]:
    """Return the fields of the values of a type by name, which `Scope.read_field` reads.

    An item has the fields of `KnownItem`. A value with a `position` also has `x`, `y` and `z`, one with a
    `stamp` also its `age`, and a list its `count`.
    """
    value_type = KnownItem if refers_to == "item" and declared_type is str else declared_type
    if not (isinstance(value_type, type) and is_dataclass(value_type)):
        is_list = value_type is not Any and find_element_type(value_type) is not None
        return {"count": Field(int)} if is_list else {}
    hints = get_type_hints(value_type)
    annotations = get_type_hints(value_type, include_extras=True)
    declared = {
        field.name: Field(hints[field.name], _find_kind(annotations[field.name]))
        for field in fields(value_type)
    }
    coordinates = dict.fromkeys("xyz", Field(float, "", "m")) if "position" in declared else {}
    stamps = {"stamp": Field(float, "", "s"), "age": Field(float, "", "s")} if "stamp" in declared else {}
    return {**declared, **coordinates, **stamps}


def _find_kind(annotation: object) -> str:
    markers = getattr(annotation, "__metadata__", ())
    return next((marker.kind for marker in markers if isinstance(marker, RefersTo)), "")


def describe_type(declared_type: object) -> str:
    """Return a description of the values of a type, for a sentence: `a list of Target`."""
    if declared_type in _DESCRIPTIONS:
        return _DESCRIPTIONS[declared_type]
    if is_union(declared_type):
        return " or ".join(describe_type(part) for part in get_args(declared_type))
    element_type = find_element_type(declared_type)
    if element_type is not None and declared_type is not object:
        if element_type is Any:
            return "a list"
        return f"a list of {describe_type(element_type).removeprefix('a ')}"
    return getattr(declared_type, "__name__", str(declared_type))


def _get_class(declared_type: object) -> type:
    """Return the class of a type without type arguments; `object` for a type that is no class."""
    origin = get_origin(declared_type) or declared_type
    return origin if isinstance(origin, type) else object


class ValueProblem(Exception):
    """A value does not fit its declaration; the message is the end of a sentence: `must be a list`.

    Attributes:
        code: Code of the finding.
    """

    def __init__(self, message: str, code: str = "wrong-type") -> None:
        super().__init__(message)
        self.code = code


def is_plain_type(declared_type: object) -> bool:
    """Return True if values of this type can be written in a mission file."""
    return find_mission_type(declared_type) == declared_type


def find_problem(value: object, declaration: Param | Port) -> ValueProblem | None:
    """Return the error if a param or an input does not accept a constant, else None."""
    try:
        convert_setting(value, declaration)
    except ValueProblem as problem:
        return problem
    return None


def convert_setting(value: object, declaration: Param | Port) -> object:
    """Return a constant converted to the type of a param or an input.

    Raises:
        ValueProblem: The value has another type, is out of bounds, or is none of the choices.
    """
    if isinstance(declaration, Port):
        if value is None and is_assignable(type(None), declaration.type):
            return None
        # Items are created during a run, so a file cannot contain an item.
        if not is_plain_type(declaration.type) or declaration.refers_to == "item":
            example = f"for example ${declaration.name}"
            raise ValueProblem(f"must be a variable, {example}, not {describe_value(value)}")
        return convert_value(value, declaration.type)
    converted = convert_value(value, declaration.type)
    minimum = declaration.ge
    maximum = declaration.le
    choices = declaration.choices
    unit = f" {declaration.unit}" if declaration.unit else ""
    number = converted if isinstance(converted, int | float) else None
    if number is not None and minimum is not None and number < minimum:
        raise ValueProblem(f"must be at least {minimum:g}{unit}, not {describe_value(value)}", "out-of-range")
    if number is not None and maximum is not None and number > maximum:
        raise ValueProblem(f"must be at most {maximum:g}{unit}, not {describe_value(value)}", "out-of-range")
    # For names of the cell, `choices` contains additional values, which `find_unknown_names` checks.
    if choices is not None and not declaration.refers_to and converted not in choices:
        allowed = " or ".join(f'"{choice}"' if isinstance(choice, str) else str(choice) for choice in choices)
        suggestion = suggest_word(value, map(str, choices))
        raise ValueProblem(f"must be {allowed}, not {describe_value(value)}{suggestion}", "wrong-value")
    return converted


def convert_value(value: object, declared_type: object) -> object:
    """Return a plain value converted to the declared type, for example a list to a tuple.

    Raises:
        ValueProblem: The value cannot be converted.
    """
    if not is_plain_type(declared_type):
        raise ValueProblem(f"must be a variable, not {describe_value(value)}")
    return convert_constant(_get_adapter(declared_type), value)


def convert_constant(validator: TypeAdapter[object], value: object) -> object:
    """Return a plain value converted by a validator.

    Raises:
        ValueProblem: The value cannot be converted, or is out of bounds.
    """
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueProblem(f"must be a finite number, not {value}")
    try:
        return validator.validate_json(json.dumps(value), strict=True)
    except ValidationError as error:
        # A union has one error per type. The most useful error is a violated bound, such as `less_than`.
        errors = sorted(error.errors(include_url=False), key=lambda details: "than" not in details["type"])
        code = "out-of-range" if "than" in errors[0]["type"] else "wrong-type"
        is_integer_allowed = {details["type"] for details in errors[1:]} == {"int_type"}
        note = " (a whole number is allowed, too)" if is_integer_allowed else ""
        raise ValueProblem(describe_validation_error(errors[0]) + note, code) from None


@functools.lru_cache(maxsize=256)
def _get_adapter(declared_type: object) -> TypeAdapter[object]:
    return TypeAdapter(cast("type[object]", declared_type))


@dataclass(frozen=True)
class Wire:
    """Connection of a node to a variable that the node reads or writes.

    Attributes:
        node: Skill or control node.
        port: Port of the skill, param whose value a variable gives, or key of the control node.
        variable: Name of the variable.
        span: Position of the variable, or of the skill if the mission does not name the variable.
        is_explicit: True if the mission names the variable; otherwise, the variable has the port's name.
        field: Field of the variable that an input reads; "" for the whole value.
        is_operand: True if an expression reads the variable, whose value is then not the value of the port.
    """

    node: Node
    port: Port | Param | Key
    variable: str
    span: Span
    is_explicit: bool
    field: str = ""
    is_operand: bool = False

    @property
    def reference(self) -> Reference:
        """The variable and the field that an input reads."""
        return Reference(self.variable, self.span, self.field)

    @property
    def is_required(self) -> bool:
        """True for an input of a skill that has no default."""
        return self.is_operand or (not isinstance(self.port, Key) and self.port.is_required)

    @property
    def rename_hint(self) -> str:
        """Advice to write another variable."""
        other = "other" if isinstance(self.port, Key) else "$other"
        return f"Let {self.node.type_name} write another variable: {self.port.name}: {other}."

    def __str__(self) -> str:
        name = self.node.type_name
        return name if isinstance(self.port, Key) else f"{name}.{self.port.name}"


def list_assignments(root: Node, skills: Skills) -> Sequence[Wire]:
    """Return the connections of the nodes of a tree that assign a value to a declared variable."""
    wires = [wire for node in root.walk() for wire in find_node_wires(node, skills, Direction.OUT)]
    return [wire for wire in wires if isinstance(wire.port, Key) and not wire.port.list_key]


def _find_operand_wires(node: Node, port: Param | Port | Key, value: object) -> list[Wire]:
    """Return the variables that an expression of a port or key reads, except the candidate."""
    return [
        Wire(node, port, operand.name, operand.span, True, operand.field, is_operand=True)
        for operand in (value.walk() if isinstance(value, Expression) else ())
        if isinstance(operand, Reference) and not operand.name.startswith(".")
    ]


def find_wires(node: SkillNode, skill: type[Skill], direction: Direction) -> Sequence[Wire]:
    """Return the connection of every port of a direction, except inputs with a constant.

    A param with a name as its value counts as an input if the mission gives a variable. An input in `one_of`
    of the skill is connected only if the mission sets it.
    """
    params = skill.params.values() if direction is Direction.IN else ()
    ports = [port for port in skill.ports.values() if port.direction is direction]
    declarations: list[Param | Port] = [*params, *ports]
    wires: list[Wire] = []
    for declaration in declarations:
        value = node.settings.get(LocatedName(declaration.name))
        if isinstance(value, Expression):
            wires += _find_operand_wires(node, declaration, value)
        elif isinstance(declaration, Param) and not declaration.accepts_variable:
            continue
        elif isinstance(value, Reference):
            wires.append(Wire(node, declaration, value.name, value.span, True, value.field))
        # `check_settings` reports a constant for an output.
        elif isinstance(declaration, Port) and (
            (direction is Direction.OUT and isinstance(value, Constant))
            or (value is None and declaration.name not in skill.one_of)
        ):
            variable = node.variables_by_port.get(declaration.name, declaration.name)
            wires.append(Wire(node, declaration, variable, node.span, is_explicit=False))
    return wires


def find_node_wires(node: Node, skills: Skills, direction: Direction) -> Sequence[Wire]:
    """Return the connections of a skill or control node; none for a skill that is not installed."""
    if isinstance(node, SkillNode):
        return find_wires(node, skills[node.skill], direction) if node.skill in skills else ()
    wires: list[Wire] = []
    for key, value in node.list_values() if isinstance(node, ControlNode) else ():
        if direction is Direction.OUT and isinstance(value, VariableName):
            wires.append(Wire(node, key, value, value.span, is_explicit=True))
        elif (
            direction is Direction.IN
            and key.value_type in (Elements, AnyValue)
            and isinstance(value, Reference)
        ):
            is_operand = key.value_type is AnyValue
            wires.append(Wire(node, key, value.name, value.span, True, value.field, is_operand))
        elif direction is Direction.IN:
            for item in value if isinstance(value, tuple) else (value,):
                wires += _find_operand_wires(node, key, item)
    return wires


def find_literals(node: SkillNode) -> Sequence[tuple[str, Constant]]:
    """Return the name and the constant of every param and port that has a constant."""
    settings = node.settings.items()
    return [(str(name), value) for name, value in settings if isinstance(value, Constant)]


def find_written_variables(root: Node, skills: Skills) -> set[str]:
    """Return the variables that the nodes of a tree may write."""
    return {wire.variable for node in root.walk() for wire in find_node_wires(node, skills, Direction.OUT)}
