"""Values, references to variables, and names in a mission file, each with its position."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import JsonValue

from executive.mission.source import Span
from executive.tree.failure import Reason


@dataclass(frozen=True)
class Literal:
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


Value = Literal | Reference | InvalidValue


@dataclass(frozen=True)
class LocatedName:
    """A name and its position: a bin in a route, the path of a library, the variable of a loop."""

    name: str
    span: Span


@dataclass(frozen=True)
class Setting:
    """Value of an entry `name: value` of a skill, `with` or `returns`, and the position of `name`."""

    name_span: Span
    value: Value


@dataclass(frozen=True)
class LocatedReason(Reason):
    """`Skill.reason` or `label.reason` below `on` or `until`, with its position."""

    span: Span
