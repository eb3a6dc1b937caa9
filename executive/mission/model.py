"""A mission as typed values: what its file says, before anything is looked up or checked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from executive.mission.source import Mark


@dataclass(frozen=True)
class Literal:
    """A value written in the file.

    Attributes:
        value: Plain value: nothing, truth value, number, text, list or mapping.
        mark: Where it stands.
        origin: How the reader sees it where that is not the value itself, for instance `$attempts`.
    """

    value: Any
    mark: Mark
    origin: str = ""


@dataclass(frozen=True)
class Reference:
    """`$name`: a param of the mission, an argument of the subtree, or a variable of the run."""

    name: str
    mark: Mark


Value = Literal | Reference


@dataclass(frozen=True)
class Setting:
    """`key: value` inside a skill: a param, an input or an output."""

    key: Mark
    value: Value


@dataclass(frozen=True)
class Match:
    """`Skill.reason` or `label.reason` in an `on`, `catch` or `until`."""

    source: str
    reason: str
    mark: Mark

    def __str__(self) -> str:
        return f"{self.source}.{self.reason}"


@dataclass(frozen=True)
class Node:
    """Base of everything a tree is made of.

    Attributes:
        mark: The word that names the node in the file.
        label: What `as:` calls it, or "".
    """

    mark: Mark
    label: str

    @property
    def children(self) -> tuple[Node, ...]:
        """The nodes directly inside this one, in the order of the file."""
        return ()

    def walk(self) -> Iterator[Node]:
        """Yield this node and every node below it, top to bottom."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True)
class SkillNode(Node):
    """A skill and what the mission sets of it."""

    skill: str
    settings: Mapping[str, Setting]


@dataclass(frozen=True)
class SequenceNode(Node):
    """One after the other, until one fails. `listed` is true for a bare list."""

    steps: tuple[Node, ...]
    listed: bool = True

    @property
    def children(self) -> tuple[Node, ...]:
        """The steps."""
        return self.steps


@dataclass(frozen=True)
class FallbackNode(Node):
    """One after the other, until one succeeds."""

    choices: tuple[Node, ...]

    @property
    def children(self) -> tuple[Node, ...]:
        """The choices, best first."""
        return self.choices


@dataclass(frozen=True)
class RetryNode(Node):
    """Again after a failure, at most `attempts` times, after `recover` where there is one.

    Attributes:
        on: What is worth another attempt; empty means every failure.
    """

    attempts: Value
    on: tuple[Match, ...]
    recover: Node | None
    do: Node

    @property
    def children(self) -> tuple[Node, ...]:
        """The recovery, if any, and the body."""
        return (self.do,) if self.recover is None else (self.recover, self.do)


@dataclass(frozen=True)
class RepeatNode(Node):
    """Again after a success: `times` times, or `until` the body fails in one of these ways."""

    times: Value | None
    until: tuple[Match, ...]
    do: Node

    @property
    def children(self) -> tuple[Node, ...]:
        """The body."""
        return (self.do,)


@dataclass(frozen=True)
class Catch:
    """What to do instead after a failure `on` one of these."""

    on: tuple[Match, ...]
    do: Node


@dataclass(frozen=True)
class TryNode(Node):
    """A body, what to do when it fails, and what to do in the end either way."""

    do: Node
    catches: tuple[Catch, ...]
    finish: Node | None

    @property
    def children(self) -> tuple[Node, ...]:
        """The body, every catch and the end."""
        caught = tuple(catch.do for catch in self.catches)
        return (self.do, *caught, self.finish) if self.finish else (self.do, *caught)


@dataclass(frozen=True)
class TimeoutNode(Node):
    """A body that must end within `seconds` on the run's clock."""

    seconds: Value
    do: Node

    @property
    def children(self) -> tuple[Node, ...]:
        """The body."""
        return (self.do,)


@dataclass(frozen=True)
class InvertNode(Node):
    """Success where the body fails, failure where it succeeds."""

    do: Node

    @property
    def children(self) -> tuple[Node, ...]:
        """The body."""
        return (self.do,)


@dataclass(frozen=True)
class SucceedNode(Node):
    """Success however the body ends; without a body, success at once."""

    do: Node | None

    @property
    def children(self) -> tuple[Node, ...]:
        """The body, if any."""
        return (self.do,) if self.do else ()


@dataclass(frozen=True)
class UseNode(Node):
    """A subtree by name. It shares the variables around it; its arguments are its own.

    Attributes:
        body: The subtree with the arguments put in; None until the mission is expanded.
    """

    name: str
    arguments: Mapping[str, Setting]
    body: Node | None = None

    @property
    def children(self) -> tuple[Node, ...]:
        """The body, once expanded."""
        return (self.body,) if self.body else ()


@dataclass(frozen=True)
class Argument:
    """An argument of a subtree; without a default every `use` must give it."""

    mark: Mark
    default: Literal | None


@dataclass(frozen=True)
class Subtree:
    """A named tree under `trees`.

    Attributes:
        mark: Its name in the file.
        returns: Variables that it promises to write, each with its place.
    """

    name: str
    mark: Mark
    doc: str
    args: Mapping[str, Argument]
    returns: Mapping[str, Mark]
    do: Node


@dataclass(frozen=True)
class Route:
    """Where objects of a class go."""

    label: str
    key: Mark
    bin: str
    mark: Mark


@dataclass(frozen=True)
class Mission:
    """A whole mission file.

    Attributes:
        name: Key `mission`.
        cell: Path of the cell file as written, below the mission's folder.
        cell_mark: Where it is written.
        params: The mission's constants, overrides applied.
        tree: The tree as written; None where it could not be read.
        trees: The subtrees by name.
    """

    name: str
    description: str
    cell: str
    cell_mark: Mark
    params: Mapping[str, Literal] = field(default_factory=dict)
    routes: tuple[Route, ...] = ()
    tree: Node | None = None
    trees: Mapping[str, Subtree] = field(default_factory=dict)
