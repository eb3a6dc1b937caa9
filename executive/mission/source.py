"""Source texts, and spans: the characters of a source text that a finding underlines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property


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
