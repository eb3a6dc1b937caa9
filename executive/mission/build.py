"""From a checked mission to the tree that runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from executive.cell import Cell
from executive.control.attempt import Try
from executive.control.fallback import Fallback
from executive.control.invert import Invert
from executive.control.node import ControlNode, Site
from executive.control.repeat import Repeat
from executive.control.retry import Retry
from executive.control.scope import Scope
from executive.control.sequence import Sequence as SequenceOf
from executive.control.skill_node import SkillNode, Wiring
from executive.control.succeed import Succeed
from executive.control.timeout import Timeout
from executive.events import Emit
from executive.mission import model
from executive.mission.load import LoadedMission
from executive.mission.typed import convert
from executive.mission.wiring import literals, wires
from executive.skill import Direction, Param, Port, Skill

TreeNode = ControlNode | SkillNode
"""What a mission's tree is made of: py_trees behaviours that know their `path` and their `failure`."""


def build(
    loaded: LoadedMission, skills: Mapping[str, type[Skill]], cell: Cell, scope: Scope, emit: Emit
) -> TreeNode:
    """Return the root of a fresh tree of py_trees behaviours; every node has a unique, readable `path`.

    A path names what is on the way: `tree/repeat/do/2:try/retry/do/Grasp`. A skill goes by its name or
    label; in a list, control nodes and whatever stands there twice carry their number.
    """
    return Builder(skills, cell, scope, emit).node(loaded.tree, "", "tree")


@dataclass(frozen=True)
class Builder:
    """Builds the nodes of one tree."""

    skills: Mapping[str, type[Skill]]
    cell: Cell
    scope: Scope
    emit: Emit

    def node(self, node: model.Node, parent: str, slot: str, name: str | None = None) -> TreeNode:
        """Return the behaviour for a node that stands in `slot` of `parent`.

        A bare list is the slot itself; any other node adds its own name to the path.
        """
        place = "/".join(part for part in (parent, slot) if part)
        if isinstance(node, model.SequenceNode) and node.listed and name is None:
            return self._sequence(node, place)
        path = "/".join(part for part in (place, name or name_of(node)) if part)
        return _BUILDERS[type(node)](self, node, path)

    def site(self, node: model.Node, path: str) -> Site:
        """Return where a behaviour stands."""
        return Site(path, node.label, self.emit)

    def list(self, nodes: Sequence[model.Node], parent: str) -> list[TreeNode]:
        """Return the behaviours of a list, named so that no two have the same path."""
        names = [name_of(node) for node in nodes]
        count = Counter(names)
        children = []
        for index, (node, name) in enumerate(zip(nodes, names, strict=True), 1):
            named = bool(node.label) or isinstance(node, model.SkillNode | model.UseNode)
            children.append(
                self.node(node, parent, "", name if named and count[name] == 1 else f"{index}:{name}")
            )
        return children

    def _sequence(self, node: Any, path: str) -> TreeNode:
        return SequenceOf(self.site(node, path), self.list(node.steps, path))

    def _fallback(self, node: Any, path: str) -> TreeNode:
        return Fallback(self.site(node, path), self.list(node.choices, path))

    def _retry(self, node: Any, path: str) -> TreeNode:
        recover = None if node.recover is None else self.node(node.recover, path, "recover")
        body = self.node(node.do, path, "do")
        attempts = convert(node.attempts.value, int)
        return Retry(self.site(node, path), body, attempts, _names(node.on), recover)

    def _repeat(self, node: Any, path: str) -> TreeNode:
        body = self.node(node.do, path, "do")
        times = None if node.times is None else convert(node.times.value, int)
        return Repeat(self.site(node, path), body, times, _names(node.until))

    def _try(self, node: Any, path: str) -> TreeNode:
        listed = isinstance(node.do, model.SequenceNode) and node.do.listed
        body = self.node(node.do, path, "do" if listed else "")
        handlers = [
            (_names(catch.on), self.node(catch.do, path, f"catch/{index}"))
            for index, catch in enumerate(node.catches, 1)
        ]
        finish = None if node.finish is None else self.node(node.finish, path, "finally")
        return Try(self.site(node, path), body, handlers, finish)

    def _timeout(self, node: Any, path: str) -> TreeNode:
        body = self.node(node.do, path, "do")
        return Timeout(self.site(node, path), body, convert(node.seconds.value, float), self.cell.clock)

    def _invert(self, node: Any, path: str) -> TreeNode:
        return Invert(self.site(node, path), self.node(node.do, path, "do"))

    def _succeed(self, node: Any, path: str) -> TreeNode:
        return Succeed(self.site(node, path), None if node.do is None else self.node(node.do, path, "do"))

    def _use(self, node: Any, path: str) -> TreeNode:
        parent, _, name = path.rpartition("/")
        body = node.body
        if node.label:
            return SequenceOf(self.site(node, path), [self.node(body, path, "do")])
        if isinstance(body, model.SequenceNode) and body.listed:
            return self._sequence(body, path)
        return self.node(body, parent, name)

    def _skill(self, node: Any, path: str) -> TreeNode:
        skill = self.skills[node.skill]
        declared: dict[str, Param | Port] = {**skill.params, **skill.ports}
        wiring = Wiring(
            constants={name: convert(value.value, declared[name].type) for name, value in literals(node)},
            inputs={wire.port.name: wire.variable for wire in wires(node, skill, Direction.IN)},
            outputs={wire.port.name: wire.variable for wire in wires(node, skill, Direction.OUT)},
        )
        return SkillNode(self.site(node, path), node.skill, skill, wiring, self.cell, self.scope)


def name_of(node: model.Node) -> str:
    """Return what a node is called in a path."""
    if node.label:
        return node.label
    if isinstance(node, model.SkillNode):
        return node.skill
    return node.name if isinstance(node, model.UseNode) else _WORDS[type(node)]


def _names(matches: Sequence[model.Match]) -> list[tuple[str, str]]:
    return [(match.source, match.reason) for match in matches]


_WORDS: Mapping[type, str] = {
    model.SequenceNode: "sequence",
    model.FallbackNode: "fallback",
    model.RetryNode: "retry",
    model.RepeatNode: "repeat",
    model.TryNode: "try",
    model.TimeoutNode: "timeout",
    model.InvertNode: "invert",
    model.SucceedNode: "succeed",
}

_BUILDERS: Mapping[type, Callable[[Builder, Any, str], TreeNode]] = {
    model.SkillNode: Builder._skill,
    model.SequenceNode: Builder._sequence,
    model.FallbackNode: Builder._fallback,
    model.RetryNode: Builder._retry,
    model.RepeatNode: Builder._repeat,
    model.TryNode: Builder._try,
    model.TimeoutNode: Builder._timeout,
    model.InvertNode: Builder._invert,
    model.SucceedNode: Builder._succeed,
    model.UseNode: Builder._use,
}
