"""The nodes of a mission's tree, as the file says them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property

from executive.mission.model.values import Match, Named, Setting, Value
from executive.mission.source import Mark

_LATER_CAPITAL = re.compile(r"(?<!^)(?=[A-Z])")


@dataclass(frozen=True)
class Node:
    """Base of everything a tree is made of.

    Attributes:
        mark: The word that names the node in the file.
        label: What `as:` calls it, or "".
        label_mark: Where that stands.
        path: Unique path from the root of the tree that runs, given once that is known; else "".
    """

    mark: Mark
    label: str
    label_mark: Mark | None = field(default=None, kw_only=True)
    path: str = field(default="", kw_only=True)

    @property
    def word(self) -> str:
        """Word for it in the file, by the name of its class: `for_each` for a `ForEachNode`."""
        return _LATER_CAPITAL.sub("_", type(self).__name__.removesuffix("Node")).lower()

    @cached_property
    def children(self) -> tuple[Node, ...]:
        """The nodes directly inside this one, in the order of the file."""
        parts = [getattr(self, field.name) for field in fields(self)]
        flat = [item for part in parts for item in (part if isinstance(part, tuple) else (part,))]
        inner = [item.do if isinstance(item, Catch) else item for item in flat]
        return tuple(item for item in inner if isinstance(item, Node))

    def walk(self) -> Iterator[Node]:
        """Yield this node and every node below it, top to bottom."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True)
class SkillNode(Node):
    """A skill and what the mission sets of it.

    Attributes:
        names: Variables of ports that the mission does not wire, where they are not called as the port.
    """

    skill: str
    settings: Mapping[str, Setting]
    names: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class UnknownNode(Node):
    """A node that could not be read; a finding says why. Anything may come of it.

    Attributes:
        parts: What could be read of it.
    """

    parts: tuple[Node, ...] = ()


@dataclass(frozen=True)
class SequenceNode(Node):
    """One after the other, until one fails. `listed` is true for a bare list."""

    steps: tuple[Node, ...]
    listed: bool = True


@dataclass(frozen=True)
class FallbackNode(Node):
    """One after the other, until one succeeds."""

    choices: tuple[Node, ...]


@dataclass(frozen=True)
class ParallelNode(Node):
    """All at the same time.

    Attributes:
        wait_for: How many must succeed, or `all` or `any`, or `lead`.
        halt: Whether a failure halts the others at once.
    """

    branches: tuple[Node, ...]
    wait_for: Value
    halt: Value


@dataclass(frozen=True)
class Backoff:
    """Wait before a further attempt: `first` [s], then `factor` times longer each time, at most `most`."""

    first: Value
    factor: Value
    most: Value | None


@dataclass(frozen=True)
class RetryNode(Node):
    """Again after a failure, at most `attempts` times, after `recover` where there is one.

    Attributes:
        on: What is worth another attempt; empty means every failure.
    """

    attempts: Value
    on: tuple[Match, ...]
    recover: Node | None
    backoff: Backoff | None
    do: Node


@dataclass(frozen=True)
class RepeatNode(Node):
    """Again after a success: `times` times, or `until` the body fails in one of these ways."""

    times: Value | None
    until: tuple[Match, ...]
    do: Node


@dataclass(frozen=True)
class WhileNode(Node):
    """Again as long as the condition succeeds."""

    condition: Node
    do: Node


@dataclass(frozen=True)
class ForEachNode(Node):
    """Once for every element of a list, which the variable `each` holds meanwhile."""

    each: Named
    source: Value
    do: Node


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


@dataclass(frozen=True)
class TimeoutNode(Node):
    """A body that must end within `seconds` on the run's clock."""

    seconds: Value
    do: Node


@dataclass(frozen=True)
class InvertNode(Node):
    """Success where the body fails, failure where it succeeds."""

    do: Node


@dataclass(frozen=True)
class SucceedNode(Node):
    """Success however the body ends; without a body, success at once."""

    do: Node | None


@dataclass(frozen=True)
class UseNode(Node):
    """A subtree by name.

    Attributes:
        arguments: Values of its arguments.
        returns: Other names for the variables it returns.
        promised: The variables it returns, as they are called here.
        body: The subtree with the arguments put in; None until the mission is expanded.
    """

    name: str
    arguments: Mapping[str, Setting]
    returns: Mapping[str, Setting] = field(default_factory=dict)
    promised: tuple[str, ...] = ()
    body: Node | None = None
