"""A mission as typed values: what its file says, before anything is looked up or checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pydantic import JsonValue

from executive.mission.model.nodes import Node
from executive.mission.model.values import Literal, Named, Value
from executive.mission.source import Mark


@dataclass(frozen=True)
class Argument:
    """An argument of a subtree; without a default, a value or a variable, every `use` must give it."""

    mark: Mark
    default: Value | None


@dataclass(frozen=True)
class Subtree:
    """A named tree under `trees`.

    Attributes:
        mark: Its name in the file.
        returns: Variables that it writes for others, each with its place; its other variables are then
            its own. None where it shares all variables with what is around it.
        library: Name of the library it comes from, or "" for one of the mission's own.
    """

    name: str
    mark: Mark
    doc: str
    args: Mapping[str, Argument]
    returns: Mapping[str, Mark] | None
    do: Node
    library: str = ""


@dataclass(frozen=True)
class Library:
    """A file of subtrees."""

    name: str
    trees: Mapping[str, Subtree]


@dataclass(frozen=True)
class MissionParam:
    """A constant of the mission.

    Attributes:
        mark: Its name in the file.
        value: What it is in this run: the default, or what was given beside the file.
        type: `text`, `integer`, `number`, `boolean` or `list`; "" where the file does not say.
        minimum, maximum: Bounds, inclusive, or None.
        choices: Values it may have, or None for any.
    """

    mark: Mark
    value: Literal
    type: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[JsonValue, ...] | None = None
    doc: str = ""


@dataclass(frozen=True)
class Route:
    """Where objects of a class go: to any of the bins."""

    label: str
    key: Mark
    bins: tuple[Named, ...]


@dataclass(frozen=True)
class Mission:
    """A whole mission file.

    Attributes:
        name: Key `mission`.
        cell: Path of the cell file as written, below the mission's folder.
        libraries: Paths of library files as written.
        params: The mission's constants, overrides applied.
        tree: The tree as written; None where it could not be read.
        trees: The subtrees by name, those of the libraries included once they are read.
        is_complete: False where a library or a subtree could not be read, so that there may be more of them.
    """

    name: str
    description: str
    cell: Named
    libraries: tuple[Named, ...] = ()
    params: Mapping[str, MissionParam] = field(default_factory=dict)
    routes: tuple[Route, ...] = ()
    tree: Node | None = None
    trees: Mapping[str, Subtree] = field(default_factory=dict)
    is_complete: bool = True
