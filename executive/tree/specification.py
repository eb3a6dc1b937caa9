"""Specifications of nodes: what a mission writes, with positions in the text.

Control nodes, which declare their keys, are in `executive.tree.node`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, JsonValue, SkipValidation, WithJsonSchema
from pydantic_core import core_schema

from executive.text.findings import NOWHERE, Span


@dataclass(frozen=True)
class Reason:
    """Reason of a failure with its source, written in a mission as `Grasp.missed`.

    Attributes:
        source: Name of a skill, keyword of a control node, or label of a node.
        reason: Reason as the source declares it, for instance `missed`.
        span: Position below `on` or `until`; equal reasons may have different positions.
    """

    source: str
    reason: str
    span: Span = field(default=NOWHERE, compare=False, kw_only=True)

    def __str__(self) -> str:
        return f"{self.source}.{self.reason}"

    @classmethod
    def __get_pydantic_json_schema__(cls, *_: object) -> dict[str, JsonValue]:
        """Return the reference to the definition in the schema of missions."""
        return {"definition": "reason"}


def format_reasons(reasons: Iterable[object]) -> str:
    """Return a text with all reasons, and with limits of counters: `Grasp.missed, look.unsure, placed: 4`."""
    return ", ".join(map(str, reasons))


@dataclass(frozen=True)
class Constant:
    """A constant value.

    Attributes:
        value: Plain value: None, boolean, number, string, list or mapping.
        span: Position of the value.
        origin: Reference that expansion replaced by the value: `$attempts in line 12`; "" for no reference.
        reference_span: Position of the replaced reference, or None.
        element_spans: Positions of the elements, if the value is a list.
    """

    value: JsonValue
    span: Span
    origin: str = ""
    reference_span: Span | None = None
    element_spans: tuple[Span, ...] = ()

    @property
    def origin_note(self) -> str:
        """The origin in brackets, for the end of a sentence about the value; "" for no reference."""
        return f" (value of {self.origin})" if self.origin else ""

    def __str__(self) -> str:
        return self.origin.partition(" ")[0] or json.dumps(self.value, ensure_ascii=False)

    def get_element_span(self, index: int) -> Span:
        """Return the position of an element, or the position of the list if the element has no position."""
        return self.element_spans[index] if index < len(self.element_spans) else self.span


@dataclass(frozen=True)
class Reference:
    """`$name` or `$name.field`: a param, an argument or a variable; after expansion always a variable.

    Attributes:
        field: Name of a field of the value; "" for the whole value.
    """

    name: str
    span: Span
    field: str = ""

    @property
    def local_name(self) -> str:
        """The name without the prefix that expansion adds to a local variable of a subtree."""
        return self.name.rpartition(".")[2]

    def __str__(self) -> str:
        return f"${self.local_name}.{self.field}" if self.field else f"${self.local_name}"


@dataclass(frozen=True)
class InvalidValue:
    """A value with an error that a finding reports."""

    span: Span


class SchemaDefinition:
    """Mixin of types that the schema of missions defines under a name, and that pydantic does not validate.

    Attributes:
        definition: Name of the definition in the schema of missions.
    """

    definition: ClassVar[str]

    @classmethod
    def __get_pydantic_core_schema__(cls, *_: object) -> core_schema.CoreSchema:
        """Return a schema that accepts every value."""
        return core_schema.any_schema()

    @classmethod
    def __get_pydantic_json_schema__(cls, *_: object) -> dict[str, JsonValue]:
        """Return the reference to the definition in the schema of missions."""
        return {"definition": cls.definition}


@dataclass(frozen=True)
class Expression(SchemaDefinition):
    """A formula that a run evaluates when its node starts, for instance `= $n + 1`.

    Attributes:
        operator: Name of the operation (`executive.tree.expression`): `+`, `>=`, `and`, `min`, `run`, ….
        operands: Operands of the operation.
        span: Position of the operation in the file.
    """

    definition = "expression"

    operator: str
    operands: tuple[Value, ...]
    span: Span

    def walk(self) -> Iterator[Value]:
        """Yield the expression and every operand in it, from left to right."""
        yield self
        for operand in self.operands:
            yield from operand.walk() if isinstance(operand, Expression) else (operand,)

    def mark_candidate(self, name: str) -> Expression:
        """Return the expression with `.name`, which is the name of no variable, in place of `name`."""

        def mark(operand: Value) -> Value:
            if isinstance(operand, Expression):
                return operand.mark_candidate(name)
            if isinstance(operand, Reference) and operand.name == name:
                return replace(operand, name=f".{name}")
            return operand

        return replace(self, operands=tuple(map(mark, self.operands)))

    def __str__(self) -> str:
        names = [_format_operand(operand) for operand in self.operands]
        match self.operator:
            case "value":
                return names[0]
            case "text":
                pairs = zip(self.operands, names, strict=True)
                return "".join(
                    str(one.value) if isinstance(one, Constant) else f"{{{name}}}" for one, name in pairs
                )
            case "run" | "bin":
                name = names[0].strip('"')
                return f"run.{name}" if self.operator == "run" else f"bin.{name}.count"
            case "negative" | "not":
                return f"{'-' if self.operator == 'negative' else 'not '}{names[0]}"
            case "min" | "max" | "abs" | "round":
                return f"{self.operator}({', '.join(names)})"
        return f" {self.operator} ".join(names)


Value = Constant | Reference | Expression | InvalidValue


def _format_operand(value: Value) -> str:
    """Return the text of an operand, with brackets around an operation of two operands."""
    has_symbol = (
        isinstance(value, Expression) and len(value.operands) > 1 and value.operator not in ("min", "max")
    )
    return f"({value})" if has_symbol else str(value)


class LocatedName(str):
    """A name in a mission file with its position, for example a param, a bin in a route, or a library."""

    span: Span

    def __new__(cls, name: str, span: Span = NOWHERE) -> LocatedName:
        """Return the name with its position."""
        located_name = super().__new__(cls, name)
        located_name.span = span
        return located_name


class VariableName(SchemaDefinition, str):
    """Name of a variable of the mission.

    Attributes:
        field: Name of a field of the value; "" for the whole value.
        span: Position of the name.
    """

    definition = "variable"

    field: str
    span: Span

    def __new__(cls, name: str, field: str = "", span: Span = NOWHERE) -> VariableName:
        """Return the name of a variable or of a field of its value."""
        variable = super().__new__(cls, name)
        variable.field = field
        variable.span = span
        return variable


SpecificationT = TypeVar("SpecificationT", bound="Specification")
"""Class of a specification."""


class Specification(BaseModel):
    """Base class of the specifications of nodes and of the sections below their keys.

    Two specifications are equal only if they are the same object. No attribute changes after construction.

    Attributes:
        span: Position in the file: of the name of the skill or subtree, of the keyword, or of the list or
            section if there is no keyword.
    """

    # Schemas are built on first use, because a check needs none of a whole node.
    model_config = ConfigDict(arbitrary_types_allowed=True, defer_build=True, extra="forbid")

    span: Span = NOWHERE

    __eq__ = object.__eq__
    __hash__ = object.__hash__

    def replace(self: SpecificationT, **values: object) -> SpecificationT:
        """Return a copy with other values of some attributes."""
        copy = self.model_copy(update=values)
        for name in _CACHED_ATTRIBUTES:
            copy.__dict__.pop(name, None)
        return copy


_CACHED_ATTRIBUTES = ("children", "_nodes")
"""Attributes of nodes that are computed from other attributes."""


class Node(Specification):
    """Base class of the specifications of nodes: what a mission writes, and what checks and diagnosis read.

    Attributes:
        label: Value of `as:`, or "".
        label_span: Position of the label in the file, or None.
        path: Path from the root of the expanded tree; "" before expansion. The path is unique, except that a
            subtree without label and its body have the same path if the body is a list.
        is_list: True for a sequence that is written as a list, without keyword.
    """

    label: str = ""
    label_span: Span | None = None
    path: str = ""
    is_list: bool = False

    @property
    def children(self) -> Sequence[Node]:
        """The children of the node, in the order of the keys that its class declares."""
        return ()

    @property
    def type_name(self) -> str:
        """Name of the skill or subtree, keyword of the control node, or "unknown"."""
        return "unknown"

    @property
    def path_name(self) -> str:
        """Name of the node in paths: its label, otherwise its skill, subtree or keyword."""
        return self.label or self.type_name

    @property
    def detail(self) -> str:
        """What drawings of the tree show next to the name, or ""."""
        return ""

    def walk(self) -> Sequence[Node]:
        """Return this node and every node below it, parents before children."""
        return self._nodes

    @cached_property
    def _nodes(self) -> Sequence[Node]:
        nodes = [self]
        for child in self.children:
            nodes.extend(child.walk())
        return nodes


class SkillNode(Node):
    """A node that runs a skill.

    Attributes:
        skill: Name of the skill.
        settings: Values of params and ports in the mission, by name.
        variables_by_port: Variables of ports without a setting; by default, a variable has the port's name.
    """

    skill: str
    settings: Mapping[LocatedName, Value]
    variables_by_port: Mapping[str, str] = {}

    @property
    def type_name(self) -> str:
        """Name of the skill."""
        return self.skill


class InvalidNode(Node):
    """Placeholder for a node with an error that a finding reports; `parts` are the valid nodes below it."""

    parts: tuple[Node, ...] = ()

    @property
    def children(self) -> Sequence[Node]:
        """The nodes in `parts`."""
        return self.parts


class SubtreeNode(Node):
    """A use of a subtree.

    Attributes:
        name: Name of the subtree.
        arguments: Values of the arguments, by name.
        returns: Variables of the caller, by the name of the returned variable in the subtree.
        written_variables: Variables of the caller that the subtree writes; () before expansion.
        body: Expanded subtree; None before expansion.
    """

    name: str
    arguments: Mapping[LocatedName, Value]
    returns: Mapping[LocatedName, Value] = {}
    written_variables: tuple[str, ...] = ()
    body: Node | None = None

    @property
    def type_name(self) -> str:
        """Name of the subtree."""
        return self.name

    @property
    def children(self) -> Sequence[Node]:
        """The body as the only child; no children before expansion."""
        return () if self.body is None else (self.body,)


Child = Annotated[SkipValidation[Node], WithJsonSchema({"definition": "node"})]
"""Type of a key with one node."""
