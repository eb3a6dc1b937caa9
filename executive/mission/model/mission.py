"""Content of mission and library files as typed values, before expansion and checks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from executive.mission.model.nodes import Node
from executive.mission.model.values import InvalidValue, Literal, LocatedName, Value
from executive.mission.source import Span
from executive.skill import Param


@dataclass(frozen=True)
class Argument:
    """An argument of a subtree, and the position of its name; without default, the argument is mandatory."""

    span: Span
    default: Value | None


@dataclass(frozen=True)
class Subtree:
    """A named tree under `trees`.

    Attributes:
        span: Position of the name.
        doc: Purpose of the subtree, or "".
        arguments: Arguments by name.
        returns: Positions of the variables that are not local, by name; None: no variable is local.
        body: Root node of the subtree.
        library: Name of the library that defines the subtree; "" if the mission file defines it.
    """

    name: str
    span: Span
    doc: str
    arguments: Mapping[str, Argument]
    returns: Mapping[str, Span] | None
    body: Node
    library: str = ""


@dataclass(frozen=True)
class MissionParam:
    """A constant of the mission.

    Attributes:
        span: Position of the name.
        value: Value in this run: the value of `--set`, otherwise the default; or an invalid value.
        declaration: Type, bounds and choices; the type is `Any` if it is unknown.
    """

    span: Span
    value: Literal | InvalidValue
    declaration: Param


@dataclass(frozen=True)
class Route:
    """Class of objects, the span of the class in the text, and the bins that may receive the objects."""

    label: str
    label_span: Span
    bins: tuple[LocatedName, ...]


@dataclass(frozen=True)
class Quota:
    """Maximum number of objects of a class in a bin; of all classes if `label` is None."""

    bin: LocatedName
    label: LocatedName | None
    limit: Value

    def __str__(self) -> str:
        return f"the quota of {self.bin.name}" + (f" for {self.label.name}" if self.label else "")


@dataclass(frozen=True)
class Mission:
    """Content of a mission file.

    Attributes:
        name, description: Values of the keys `mission` and `description`.
        cell: Path of the cell file, relative to the folder of the mission.
        libraries: Paths of the library files, relative to the folder of the mission.
        params: Constants by name, with the values of `--set`.
        quotas: Maximum numbers of objects in the bins.
        tree: Root node of the tree; None if the key is missing.
        subtrees: Subtrees of the mission and of its libraries, by name.
        is_complete: False if a library could not be read, so that `subtrees` may lack subtrees.
    """

    name: str
    description: str
    cell: LocatedName
    libraries: tuple[LocatedName, ...] = ()
    params: Mapping[str, MissionParam] = field(default_factory=dict)
    routes: tuple[Route, ...] = ()
    quotas: tuple[Quota, ...] = ()
    tree: Node | None = None
    subtrees: Mapping[str, Subtree] = field(default_factory=dict)
    is_complete: bool = True
