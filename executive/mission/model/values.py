"""The smallest pieces of a mission: values, references and words, each with its place."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import JsonValue

from executive.mission.source import Mark
from executive.tree.failure import Reason


@dataclass(frozen=True)
class Literal:
    """A value written in the file.

    Attributes:
        value: Plain value: nothing, truth value, number, text, list or mapping.
        mark: Where it stands.
        origin: How the reader sees it where that is not the value itself, for instance `$attempts`.
        used: Where `$attempts` stands, if it stands for this value; else None.
        elements: Where the elements stand, if it is a list written in the file.
    """

    value: JsonValue
    mark: Mark
    origin: str = ""
    reference_mark: Mark | None = None
    elements: tuple[Mark, ...] = ()

    @property
    def origin_note(self) -> str:
        """The origin in brackets, to follow a sentence about the value, or ""."""
        return f" (it is {self.origin})" if self.origin else ""

    def element_mark(self, index: int) -> Mark:
        """Return where an element of the list stands, or the list where that is not known."""
        return self.elements[index] if index < len(self.elements) else self.mark


@dataclass(frozen=True)
class Reference:
    """`$name`: a param of the mission, an argument of the subtree, or a variable of the run."""

    name: str
    mark: Mark


Value = Literal | Reference


@dataclass(frozen=True)
class Named:
    """A word at its place: a bin in a route, a library's file, a loop's variable."""

    name: str
    mark: Mark


@dataclass(frozen=True)
class Setting:
    """`key: value` inside a skill: a param, an input or an output."""

    key: Mark
    value: Value


@dataclass(frozen=True)
class FailureName(Reason):
    """`Skill.reason` or `label.reason` in an `on`, `catch` or `until`, with its place."""

    mark: Mark
