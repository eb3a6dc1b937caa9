"""Source texts and places in them: file, line, column and length."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property


@dataclass(frozen=True, eq=False)
class Source:
    """A text and its name in messages.

    Attributes:
        path: Name in front of every position, for instance `missions/sort.yaml` or `--set`.
        text: The whole text.
    """

    path: str
    text: str

    def line(self, number: int) -> str:
        """Return line `number`, counted from 1, or "" beyond the end."""
        return self._lines[number - 1] if 1 <= number <= len(self._lines) else ""

    @cached_property
    def _lines(self) -> list[str]:
        return self.text.splitlines()

    def mark(self, line: int = 0, col: int = 0, length: int = 0) -> Mark:
        """Return the place at `line` and `col`, counted from 1; line 0 is the text as a whole."""
        return Mark(self, line, col, length)


@dataclass(frozen=True)
class Mark:
    """A place in a source.

    Attributes:
        source: The text.
        line: Counted from 1; 0 means the text as a whole.
        col: Counted from 1, in characters.
        length: Number of characters that the caret line underlines.
    """

    source: Source
    line: int
    col: int
    length: int

    def place(self, source: Source) -> str:
        """Return the line, with the path of the file if it is not `source`."""
        return f"line {self.line}" if self.source is source else f"{self.source.path}:{self.line}"
