"""The same tree twice: of the executive's nodes and of bare py_trees'.

A shape is written once, against a kit; the two kits make equal trees of it, node for node.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Protocol

from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell import Cell
from executive.control.fallback import Fallback
from executive.control.node import Site
from executive.control.retry import Retry
from executive.control.scope import Scope
from executive.control.sequence import Sequence as SequenceOf
from executive.control.skill_node import SkillNode, Wiring
from executive.control.timeout import Timeout
from executive.events import Event, Observer
from executive.skill import Skill
from executive.testing.fake_cell import FakeCell

FAN_OUT = 5
"""Children of a node in a balanced tree."""

ATTEMPTS = 3
"""Of every retry."""

PATIENCE = 1e9
"""Of every timeout: longer than anybody measures [s]."""


class Kit(Protocol):
    """Makes the nodes that both sides have."""

    def leaf(self, *, ends: bool) -> Behaviour:
        """Return a leaf that succeeds at once, or else runs for ever."""

    def sequence(self, children: Sequence[Behaviour]) -> Behaviour:
        """Return a sequence with memory."""

    def fallback(self, children: Sequence[Behaviour]) -> Behaviour:
        """Return a fallback with memory."""

    def retry(self, body: Behaviour) -> Behaviour:
        """Return a retry of `ATTEMPTS` attempts."""

    def timeout(self, body: Behaviour) -> Behaviour:
        """Return a timeout of `PATIENCE`."""


def flat(kit: Kit, nodes: int) -> Behaviour:
    """Return one sequence of leaves, of which the last runs for ever."""
    return kit.sequence([*_done(kit, nodes - 2), kit.leaf(ends=False)])


def balanced(kit: Kit, nodes: int) -> Behaviour:
    """Return sequences of `FAN_OUT` children as deep as needed; the last leaf runs for ever."""
    last = 0
    while FAN_OUT * last + 1 < nodes:
        last = min(FAN_OUT * (last + 1), nodes - 1)

    def node(index: int) -> Behaviour:
        # Numbered level by level, as in a heap.
        children = range(FAN_OUT * index + 1, min(FAN_OUT * (index + 1) + 1, nodes))
        return kit.sequence([node(child) for child in children]) if children else kit.leaf(ends=index != last)

    return node(0)


def nested(kit: Kit, nodes: int) -> Behaviour:
    """Return retry, timeout, fallback, retry and timeout around a flat tree, and a second choice."""
    body = kit.retry(kit.timeout(flat(kit, nodes - 6)))
    return kit.retry(kit.timeout(kit.fallback([body, kit.leaf(ends=True)])))


def ending(kit: Kit, nodes: int) -> Behaviour:
    """Return one sequence of leaves that all succeed at once."""
    return kit.sequence(_done(kit, nodes - 1))


WAITING: Mapping[str, Callable[[Kit, int], Behaviour]] = {
    "flat": flat,
    "balanced": balanced,
    "nested": nested,
}
"""The shapes that come to wait for their last leaf, by name; any number of nodes from 8 on."""


class Ours:
    """Makes nodes as a mission does, on a fake cell; events are stamped and handed on as a run does it."""

    def __init__(self, observers: Sequence[Observer] = ()) -> None:
        self._observers = list(observers)
        self._cell, self._scope = FakeCell().cell, Scope()
        self._number = itertools.count(1)

    def leaf(self, *, ends: bool) -> Behaviour:
        """Return a skill as a leaf."""
        skill = _Ends if ends else _Waits
        name = skill.__name__.strip("_")
        return SkillNode(self._site(name), name, skill, Wiring(), self._cell, self._scope)

    def sequence(self, children: Sequence[Behaviour]) -> Behaviour:
        """Return a sequence."""
        return SequenceOf(self._site("sequence"), children)

    def fallback(self, children: Sequence[Behaviour]) -> Behaviour:
        """Return a fallback."""
        return Fallback(self._site("fallback"), children)

    def retry(self, body: Behaviour) -> Behaviour:
        """Return a retry."""
        return Retry(self._site("retry"), body, ATTEMPTS)

    def timeout(self, body: Behaviour) -> Behaviour:
        """Return a timeout on the cell's clock."""
        return Timeout(self._site("timeout"), body, PATIENCE, self._cell.clock)

    def _site(self, name: str) -> Site:
        return Site(f"tree/repeat/do/{next(self._number)}:{name}", emit=self._emit)

    def _emit(self, kind: str, **data: Any) -> None:
        event = Event(kind, 0, round(self._cell.clock.now, 6), data)
        for observer in self._observers:
            observer(event)


class Bare:
    """Makes py_trees' own nodes."""

    def leaf(self, *, ends: bool) -> Behaviour:
        """Return a behaviour that always answers the same."""
        return _Answer(Status.SUCCESS if ends else Status.RUNNING)

    def sequence(self, children: Sequence[Behaviour]) -> Behaviour:
        """Return a sequence with memory."""
        return composites.Sequence("sequence", memory=True, children=children)

    def fallback(self, children: Sequence[Behaviour]) -> Behaviour:
        """Return a selector with memory."""
        return composites.Selector("fallback", memory=True, children=children)

    def retry(self, body: Behaviour) -> Behaviour:
        """Return a retry; it takes a tick more per attempt than ours."""
        return decorators.Retry("retry", body, ATTEMPTS)

    def timeout(self, body: Behaviour) -> Behaviour:
        """Return a timeout; it counts on the wall clock."""
        return decorators.Timeout("timeout", body, PATIENCE)


def _done(kit: Kit, count: int) -> list[Behaviour]:
    return [kit.leaf(ends=True) for _ in range(count)]


class _Ends(Skill):
    def run(self, cell: Cell) -> Iterator[None]:
        del cell
        yield from ()


class _Waits(Skill):
    def run(self, cell: Cell) -> Iterator[None]:
        del cell
        while True:
            yield


class _Answer(Behaviour):
    def __init__(self, answer: Status) -> None:
        super().__init__(answer.value)
        self._answer = answer

    def update(self) -> Status:
        return self._answer
