"""Specification of the nodes of a mission: positions in the text, values, and names of failures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from pydantic import JsonValue


@dataclass(frozen=True, eq=False)
class Source:
    """A text and its name in messages.

    Attributes:
        path: Name that precedes each position in messages: path of a file, or `--set`.
        text: The whole text.
    """

    path: str
    text: str

    def get_line(self, number: int) -> str:
        """Return line `number`, counted from 1, or "" beyond the end."""
        return self._lines[number - 1] if 1 <= number <= len(self._lines) else ""

    @cached_property
    def _lines(self) -> list[str]:
        return self.text.splitlines()

    def make_span(self, line: int = 0, col: int = 0, length: int = 0) -> Span:
        """Return a span in this text; line 0 denotes the whole text."""
        return Span(self, line, col, length)


@dataclass(frozen=True)
class Span:
    """Position of a part of a source text.

    Attributes:
        source: The text.
        line: First line, counted from 1; 0 denotes the whole text.
        col: Column of the first character, counted from 1.
        length: Number of characters; at most the first line is underlined.
    """

    source: Source
    line: int
    col: int
    length: int

    def describe_place(self, source: Source) -> str:
        """Return `line 12` if the position is in `source`, otherwise `path:12`."""
        return f"line {self.line}" if self.source is source else f"{self.source.path}:{self.line}"


@dataclass(frozen=True)
class Reason:
    """Reason of a failure with its source, written in a mission as `Grasp.missed`.

    Attributes:
        source: Name of a skill, keyword of a control node, or label of a node.
        reason: Reason as the source declares it, for instance `missed`.
    """

    source: str
    reason: str

    def __str__(self) -> str:
        return f"{self.source}.{self.reason}"


def format_reasons(reasons: Iterable[object]) -> str:
    """Return a text with all reasons, and with limits of counters: `Grasp.missed, look.unsure, placed: 4`."""
    return ", ".join(map(str, reasons))


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
