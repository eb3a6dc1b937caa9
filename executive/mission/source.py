"""Source texts, and positions in them: file, line, column and length."""

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

    def make_mark(self, line: int = 0, col: int = 0, length: int = 0) -> Mark:
        """Return the position at `line` and `col`, counted from 1; line 0 denotes the whole text."""
        return Mark(self, line, col, length)


@dataclass(frozen=True)
class Mark:
    """Position in a source text, and the number of characters there that a finding underlines.

    Attributes:
        source: The text.
        line: Line, counted from 1; 0 denotes the whole text.
        col: Column, counted from 1, in characters.
        length: Number of underlined characters.
    """

    source: Source
    line: int
    col: int
    length: int

    def describe_place(self, source: Source) -> str:
        """Return `line 12` if the position is in `source`, otherwise `path:12`."""
        return f"line {self.line}" if self.source is source else f"{self.source.path}:{self.line}"
