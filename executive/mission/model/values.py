"""Values, references to variables, and names in a mission file, each with its position."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import JsonValue

from executive.mission.source import Mark
from executive.tree.failure import Reason


@dataclass(frozen=True)
class Literal:
    """A constant value.

    Attributes:
        value: Plain value: None, boolean, number, string, list or mapping.
        mark: Position of the value.
        origin: For the value of a param or an argument: its reference, `$attempts in line 12`; otherwise "".
        reference_mark: For the value of a param or an argument: position of the reference; otherwise None.
        element_marks: Positions of the elements, if the value is a list.
    """

    value: JsonValue
    mark: Mark
    origin: str = ""
    reference_mark: Mark | None = None
    element_marks: tuple[Mark, ...] = ()

    @property
    def origin_note(self) -> str:
        """The origin in brackets, for the end of a sentence about the value, or ""."""
        return f" (value of {self.origin})" if self.origin else ""

    def get_element_mark(self, index: int) -> Mark:
        """Return the position of an element of the list, or of the list if it is unknown."""
        return self.element_marks[index] if index < len(self.element_marks) else self.mark


@dataclass(frozen=True)
class Reference:
    """`$name`: a param, an argument or a variable before expansion, and a variable after expansion."""

    name: str
    mark: Mark


Value = Literal | Reference


@dataclass(frozen=True)
class LocatedName:
    """A name and its position: a bin in a route, the path of a library, the variable of a loop."""

    name: str
    mark: Mark


@dataclass(frozen=True)
class Setting:
    """`name: value` below a skill, `with` or `returns`: the value, and the position of the name."""

    name_mark: Mark
    value: Value


@dataclass(frozen=True)
class FailureName(Reason):
    """`Skill.reason` or `label.reason` below `on` or `until`, with its position."""

    mark: Mark
