"""Content of mission and library files as typed values, before expansion and checks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pydantic import JsonValue

from executive.mission.model.nodes import Node
from executive.mission.model.values import Literal, LocatedName, Value
from executive.mission.source import Mark


@dataclass(frozen=True)
class Argument:
    """An argument of a subtree and its position; without a default, every `use` must give the argument."""

    mark: Mark
    default: Value | None


@dataclass(frozen=True)
class Subtree:
    """A named tree under `trees`.

    Attributes:
        mark: Position of the name.
        returns: Variables that the caller gets, with their positions; all other variables are then local.
            None if the subtree shares all variables with the caller.
        library: Name of the library that defines the subtree; "" if the mission file defines it.
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
    """Content of a library file: its subtrees by name."""

    name: str
    trees: Mapping[str, Subtree]


@dataclass(frozen=True)
class MissionParam:
    """A constant of the mission.

    Attributes:
        mark: Position of the name.
        value: Value in this run: the value of `--set`, otherwise the default.
        type: `text`, `integer`, `number`, `boolean` or `list`; "" if unknown.
        minimum, maximum: Inclusive bounds, or None.
        choices: Allowed values, or None if all values are allowed.
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
    """Class of objects `label`, with its position, and the bins that may receive the objects."""

    label: str
    label_mark: Mark
    bins: tuple[LocatedName, ...]


@dataclass(frozen=True)
class Mission:
    """Content of a mission file.

    Attributes:
        name: Value of the key `mission`.
        cell: Path of the cell file, relative to the folder of the mission.
        libraries: Paths of the library files, relative to the folder of the mission.
        params: Constants by name, with the values of `--set`.
        tree: Root node of the tree; None if the key is missing.
        trees: Subtrees of the mission and of its libraries, by name.
        is_complete: False if a library could not be read, so that `trees` may lack subtrees.
    """

    name: str
    description: str
    cell: LocatedName
    libraries: tuple[LocatedName, ...] = ()
    params: Mapping[str, MissionParam] = field(default_factory=dict)
    routes: tuple[Route, ...] = ()
    tree: Node | None = None
    trees: Mapping[str, Subtree] = field(default_factory=dict)
    is_complete: bool = True
