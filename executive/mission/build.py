"""From a checked mission to the tree that runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from math import inf
from typing import Any

from executive.cell import Cell
from executive.control.attempt import Try
from executive.control.backoff import Backoff
from executive.control.beside import Beside
from executive.control.fallback import Fallback
from executive.control.for_each import ForEach
from executive.control.invert import Invert
from executive.control.node import ControlNode, Site
from executive.control.parallel import Parallel
from executive.control.repeat import Repeat
from executive.control.retry import Retry
from executive.control.scope import Scope
from executive.control.sequence import Sequence as SequenceOf
from executive.control.skill_node import SkillNode, Wiring
from executive.control.succeed import Succeed
from executive.control.timeout import Timeout
from executive.control.while_loop import While
from executive.errors import InputError
from executive.events import Emit
from executive.mission.load import LoadedMission
from executive.mission.model import nodes
from executive.mission.model.typed import convert
from executive.mission.model.values import Match
from executive.mission.model.wiring import literals, wires
from executive.skill import Direction, Param, Port, Skill

TreeNode = ControlNode | SkillNode
"""What a mission's tree is made of: py_trees behaviours that know their `path` and their `failure`."""


def build(
    loaded: LoadedMission,
    skills: Mapping[str, type[Skill]],
    cell: Cell,
    scope: Scope,
    emit: Emit,
    substitutes: Mapping[str, type[Skill]] | None = None,
) -> TreeNode:
    """Return the root of a fresh tree of py_trees behaviours; every node has a unique, readable `path`.

    `substitutes` run instead of the skills of nodes, by a pattern of their paths as a shell knows them: `*`
    stands for anything, `/` included. The first one that fits is taken.

    Raises:
        InputError: A pattern fits no node that runs a skill.
    """
    builder = Builder(skills, cell, scope, emit, substitutes or {})
    root = builder.node(loaded.tree)
    if unused := [pattern for pattern in builder.substitutes if pattern not in builder.used]:
        paths = [node.path for node in root.iterate() if isinstance(node, SkillNode)]
        raise InputError(f'no node is called "{unused[0]}"; there are: {", ".join(paths)}')
    return root


@dataclass(frozen=True)
class Builder:
    """Builds the nodes of one tree."""

    skills: Mapping[str, type[Skill]]
    cell: Cell
    scope: Scope
    emit: Emit
    substitutes: Mapping[str, type[Skill]] = field(default_factory=dict)
    used: list[str] = field(default_factory=list)

    def node(self, node: nodes.Node) -> TreeNode:
        """Return the behaviour for a node."""
        return _BUILDERS[type(node)](self, node)

    def _site(self, node: nodes.Node) -> Site:
        return Site(node.path, node.label, self.emit)

    def _all(self, children: Sequence[nodes.Node]) -> list[TreeNode]:
        return [self.node(child) for child in children]

    def _sequence(self, node: Any) -> TreeNode:
        return SequenceOf(self._site(node), self._all(node.steps))

    def _fallback(self, node: Any) -> TreeNode:
        return Fallback(self._site(node), self._all(node.choices))

    def _parallel(self, node: Any) -> TreeNode:
        if node.wait_for.value == "lead":
            return Beside(self._site(node), self._all(node.branches))
        count = {"all": None, "any": 1}.get(node.wait_for.value, node.wait_for.value)
        return Parallel(self._site(node), self._all(node.branches), count, convert(node.halt.value, bool))

    def _retry(self, node: Any) -> TreeNode:
        recover = None if node.recover is None else self.node(node.recover)
        attempts, backoff = convert(node.attempts.value, int), _backoff(node.backoff)
        return Retry(
            self._site(node), self.node(node.do), attempts, _names(node.on), recover, backoff, self.cell.clock
        )

    def _repeat(self, node: Any) -> TreeNode:
        times = None if node.times is None else convert(node.times.value, int)
        return Repeat(self._site(node), self.node(node.do), times, _names(node.until))

    def _while(self, node: Any) -> TreeNode:
        return While(self._site(node), self.node(node.condition), self.node(node.do))

    def _for_each(self, node: Any) -> TreeNode:
        source = node.source.value if hasattr(node.source, "value") else node.source.name
        return ForEach(self._site(node), self.node(node.do), self.scope, node.each.name, source)

    def _try(self, node: Any) -> TreeNode:
        handlers = [(_names(catch.on), self.node(catch.do)) for catch in node.catches]
        finish = None if node.finish is None else self.node(node.finish)
        return Try(self._site(node), self.node(node.do), handlers, finish)

    def _timeout(self, node: Any) -> TreeNode:
        seconds = convert(node.seconds.value, float)
        return Timeout(self._site(node), self.node(node.do), seconds, self.cell.clock)

    def _invert(self, node: Any) -> TreeNode:
        return Invert(self._site(node), self.node(node.do))

    def _succeed(self, node: Any) -> TreeNode:
        return Succeed(self._site(node), None if node.do is None else self.node(node.do))

    def _use(self, node: Any) -> TreeNode:
        body = self.node(node.body)
        root = SequenceOf(self._site(node), [body]) if node.label else body
        root.subtrees = (node.name, *root.subtrees)
        return root

    def _skill(self, node: Any) -> TreeNode:
        skill = self.skills[node.skill]
        declared: dict[str, Param | Port] = {**skill.params, **skill.ports}
        wiring = Wiring(
            constants={name: convert(value.value, declared[name].type) for name, value in literals(node)},
            inputs={wire.port.name: wire.variable for wire in wires(node, skill, Direction.IN)},
            outputs={wire.port.name: wire.variable for wire in wires(node, skill, Direction.OUT)},
        )
        runs = self._substitute(node.path) or skill
        return SkillNode(self._site(node), node.skill, runs, wiring, self.cell, self.scope)

    def _substitute(self, path: str) -> type[Skill] | None:
        fitting = [pattern for pattern in self.substitutes if fnmatchcase(path, pattern)]
        self.used.extend(fitting)
        return self.substitutes[fitting[0]] if fitting else None


def _names(matches: Sequence[Match]) -> list[tuple[str, str]]:
    return [(match.source, match.reason) for match in matches]


def _backoff(node: Any) -> Backoff | None:
    if node is None:
        return None

    first, factor, most = (
        inf if value is None else convert(value.value, float)
        for value in (node.first, node.factor, node.most)
    )
    return Backoff(first, factor, most)


_BUILDERS: Mapping[type[nodes.Node], Callable[[Builder, Any], TreeNode]] = {
    nodes.SkillNode: Builder._skill,
    nodes.SequenceNode: Builder._sequence,
    nodes.FallbackNode: Builder._fallback,
    nodes.ParallelNode: Builder._parallel,
    nodes.RetryNode: Builder._retry,
    nodes.RepeatNode: Builder._repeat,
    nodes.WhileNode: Builder._while,
    nodes.ForEachNode: Builder._for_each,
    nodes.TryNode: Builder._try,
    nodes.TimeoutNode: Builder._timeout,
    nodes.InvertNode: Builder._invert,
    nodes.SucceedNode: Builder._succeed,
    nodes.UseNode: Builder._use,
}
