"""From a checked mission to the tree that runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from math import inf
from typing import Any

from executive.cell.protocols import Cell
from executive.errors import InputError
from executive.events import Emit
from executive.mission.load import LoadedMission
from executive.mission.model import nodes
from executive.mission.model.typed import convert
from executive.mission.model.values import Literal, Match, Value
from executive.mission.model.wiring import literals, wires
from executive.skill import Direction, Param, Port, Skill
from executive.tree.backoff import Backoff
from executive.tree.blackboard import Scope
from executive.tree.fallback import Fallback
from executive.tree.for_each import ForEach
from executive.tree.invert import Invert
from executive.tree.node import ControlNode, Site
from executive.tree.parallel import Parallel
from executive.tree.parallel_lead import Beside
from executive.tree.repeat import Repeat
from executive.tree.retry import Retry
from executive.tree.sequence import Sequence as SequenceOf
from executive.tree.skill_leaf import SkillNode, Wiring
from executive.tree.succeed import Succeed
from executive.tree.timeout import Timeout
from executive.tree.try_catch import Try
from executive.tree.while_loop import While

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
        site = Site(node.path, node.label, self.emit)
        match node:
            case nodes.SkillNode():
                return self._skill(site, node)
            case nodes.SequenceNode():
                return SequenceOf(site, self._all(node.steps))
            case nodes.FallbackNode():
                return Fallback(site, self._all(node.choices))
            case nodes.ParallelNode():
                return self._parallel(site, node)
            case nodes.RetryNode():
                return self._retry(site, node)
            case nodes.RepeatNode():
                times = None if node.times is None else _constant(node.times, int)
                return Repeat(site, self.node(node.do), times, _names(node.until))
            case nodes.WhileNode():
                return While(site, self.node(node.condition), self.node(node.do))
            case nodes.ForEachNode(each=each, source=source):
                elements = source.value if isinstance(source, Literal) else source.name
                return ForEach(site, self.node(node.do), self.scope, each.name, elements)
            case nodes.TryNode():
                handlers = [(_names(catch.on), self.node(catch.do)) for catch in node.catches]
                return Try(site, self.node(node.do), handlers, self._maybe(node.finish))
            case nodes.TimeoutNode():
                return Timeout(site, self.node(node.do), _constant(node.seconds, float), self.cell.clock)
            case nodes.InvertNode():
                return Invert(site, self.node(node.do))
            case nodes.SucceedNode():
                return Succeed(site, self._maybe(node.do))
            case nodes.UseNode(body=nodes.Node() as written):
                body = self.node(written)
                root = SequenceOf(site, [body]) if node.label else body
                root.subtrees = (node.name, *root.subtrees)
                return root
        raise AssertionError(f"a checked mission has no {type(node).__name__}")

    def _all(self, children: Sequence[nodes.Node]) -> list[TreeNode]:
        return [self.node(child) for child in children]

    def _maybe(self, child: nodes.Node | None) -> TreeNode | None:
        return None if child is None else self.node(child)

    def _parallel(self, site: Site, node: nodes.ParallelNode) -> TreeNode:
        branches = self._all(node.branches)
        wait_for: Any = getattr(node.wait_for, "value", "all")
        if wait_for == "lead":
            return Beside(site, branches)
        count = {"all": None, "any": 1}.get(wait_for, wait_for)
        return Parallel(site, branches, count, _constant(node.halt, bool))

    def _retry(self, site: Site, node: nodes.RetryNode) -> TreeNode:
        recover, attempts = self._maybe(node.recover), _constant(node.attempts, int)
        backoff, do = _backoff(node.backoff), self.node(node.do)
        return Retry(site, do, attempts, _names(node.on), recover, backoff, self.cell.clock)

    def _skill(self, site: Site, node: nodes.SkillNode) -> TreeNode:
        skill = self.skills[node.skill]
        declared: dict[str, Param | Port] = {**skill.params, **skill.ports}
        wiring = Wiring(
            constants={name: convert(value.value, declared[name].type) for name, value in literals(node)},
            inputs={wire.port.name: wire.variable for wire in wires(node, skill, Direction.IN)},
            outputs={wire.port.name: wire.variable for wire in wires(node, skill, Direction.OUT)},
        )
        runs = self._substitute(node.path) or skill
        return SkillNode(site, node.skill, runs, wiring, self.cell, self.scope)

    def _substitute(self, path: str) -> type[Skill] | None:
        fitting = [pattern for pattern in self.substitutes if fnmatchcase(path, pattern)]
        self.used.extend(fitting)
        return self.substitutes[fitting[0]] if fitting else None


def _names(matches: Sequence[Match]) -> list[tuple[str, str]]:
    return [(match.source, match.reason) for match in matches]


def _constant(value: Value, declared: Any) -> Any:
    """Return a constant as the type declared for it; the check has found that it fits."""
    assert isinstance(value, Literal)
    return convert(value.value, declared)


def _backoff(backoff: nodes.Backoff | None) -> Backoff | None:
    if backoff is None:
        return None
    times = (backoff.first, backoff.factor, backoff.most)
    first, factor, most = (inf if value is None else _constant(value, float) for value in times)
    return Backoff(first, factor, most)
