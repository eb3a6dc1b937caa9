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
    """`$name`: a param, an argument or a variable; after expansion always a variable."""

    name: str
    span: Span


Value = Literal | Reference


@dataclass(frozen=True)
class LocatedName:
    """A name and its position: a bin in a route, the path of a library, the variable of a loop."""

    name: str
    span: Span


@dataclass(frozen=True)
class Setting:
    """`name: value` below a skill, `with` or `returns`: the value, and the position of `name`."""

    name_span: Span
    value: Value


@dataclass(frozen=True)
class FailureName(Reason):
    """`Skill.reason` or `label.reason` below `on` or `until`, with its position."""

    span: Span
