"""Outline of a built tree as plain data, for drawings, records and pages."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from py_trees.behaviour import Behaviour

from executive.tree.node import ControlNode
from executive.tree.skill_leaf import SkillLeaf

_NUMBER = re.compile(r"[0-9]+:")
SKILL = "skill"
"""Kind of the leaves that run a skill."""


@dataclass(frozen=True)
class Connection:
    """A port of a skill and the variable it is connected to.

    Attributes:
        required: False for an input with a default for an unwritten variable.
    """

    port: str
    variable: str
    required: bool


@dataclass(frozen=True)
class OutlineNode:
    """One node of an outline.

    Attributes:
        path: Unique path from the root.
        name: Name with the role under its parent: `Grasp`, `recover: look`, `do`.
        depth: Number of ancestors.
        detail: Settings of the node in the mission, in a few words.
        kind: `skill`, or the keyword of a control node.
        symbol, shape: Its symbol and its Graphviz shape in drawings; "" for a skill.
        title: Label, or name of the skill or keyword.
        slot: Role under its parent: `do`, `recover`, `catch 1`; "" in a list.
        when: Failures after which a catch runs: `on Grasp.missed`; else "".
        subtrees: Names of the subtrees with this node as root, the outermost first.
        skill: Name of the skill; "" for a control node. The fields below are empty for a control node.
        doc: Description of the skill, one sentence.
        params: Constants of the skill from the mission.
        reads, writes: Connected ports.
        reasons: Reasons for which the skill may fail.
        senses: True if the skill senses the scene.
        uses: Parts of the cell that the skill uses exclusively.
    """

    path: str
    name: str
    depth: int
    detail: str
    kind: str
    title: str
    slot: str = ""
    when: str = ""
    subtrees: tuple[str, ...] = ()
    skill: str = ""
    doc: str = ""
    params: Mapping[str, object] = field(default_factory=dict)
    reads: tuple[Connection, ...] = ()
    writes: tuple[Connection, ...] = ()
    reasons: tuple[str, ...] = ()
    senses: bool = False
    uses: tuple[str, ...] = ()
    symbol: str = ""
    shape: str = ""

    @property
    def subtree(self) -> str:
        """Names of the subtrees with this node as root, separated by " / "."""
        return " / ".join(self.subtrees)


def outline(root: Behaviour) -> list[OutlineNode]:
    """Return every node of the tree in the order of the mission, parents before children."""
    return list(_outline(root, None))


def children(nodes: Sequence[OutlineNode]) -> list[list[int]]:
    """Return the indices of the children of each node."""
    found: list[list[int]] = [[] for _ in nodes]
    above: list[int] = []
    for index, node in enumerate(nodes):
        del above[node.depth :]
        if above:
            found[above[-1]].append(index)
        above.append(index)
    return found


def _outline(node: Behaviour, parent: Behaviour | None, depth: int = 0) -> Iterator[OutlineNode]:
    path = _path(node)
    place = path.removeprefix(f"{_path(parent) if parent else 'tree'}/")
    label, detail = getattr(node, "label", ""), getattr(node, "detail", "")
    kind = _kind(node)
    if label and kind != SKILL:
        detail = ", ".join(part for part in (kind, detail) if part)
    title = label or (node.skill_name if isinstance(node, SkillLeaf) else kind)
    subtrees = tuple(getattr(node, "subtrees", ()))
    slot = _slot(place, parent, node, title, subtrees) if parent else ""
    when = parent.describe_trigger(node) if isinstance(parent, ControlNode) else ""
    drawn = OutlineNode(path, _name(place), depth, detail, kind, title, slot, when, subtrees)
    if isinstance(node, SkillLeaf):
        yield _add_skill(drawn, node)
    else:
        style = node if isinstance(node, ControlNode) else ControlNode
        yield replace(drawn, symbol=style.symbol, shape=style.shape)
    for child in node.children:
        yield from _outline(child, node, depth + 1)


def _path(node: Behaviour) -> str:
    return str(getattr(node, "path", node.name))


def _kind(node: Behaviour) -> str:
    """Return the keyword of a control node; a py_trees behaviour has the name of its class."""
    if isinstance(node, SkillLeaf):
        return SKILL
    return node.keyword if isinstance(node, ControlNode) else type(node).__name__.lower()


def _name(place: str) -> str:
    """Return what a node is called below its parent."""
    slot, _, last = place.rpartition("/")
    last = _NUMBER.sub("", last)
    slot = slot.replace("/", " ")
    # A list in the second catch is the catch itself.
    return f"{slot} {last}" if last.isdigit() else f"{slot}: {last}" if slot else last


def _slot(place: str, parent: Behaviour, node: Behaviour, title: str, subtrees: tuple[str, ...]) -> str:
    """Return the rest of a node's place below its parent without its own name and its subtrees'.

    A bare list has no name of its own: it is the slot. Some keys are left out of paths.
    """
    parts = [_NUMBER.sub("", part) for part in place.split("/")]
    if parts[-1] == title:
        del parts[-1]
    for subtree in reversed(subtrees):
        if parts and parts[-1] == subtree:
            del parts[-1]
    if not parts and isinstance(parent, ControlNode):
        for key in parent.keys.values():
            if not key.is_in_path and node in parent.list_children(key.name):
                return key.name
    return " ".join(parts)


def _add_skill(node: OutlineNode, leaf: SkillLeaf) -> OutlineNode:
    """Return `node` with the declarations of the skill and the wiring of its leaf."""
    skill, wiring = leaf.skill_type, leaf.wiring
    ports = skill.ports

    def connections(wires: Mapping[str, str]) -> tuple[Connection, ...]:
        return tuple(
            Connection(port, variable, ports[port].default is ...) for port, variable in wires.items()
        )

    return replace(
        node,
        skill=leaf.skill_name,
        doc=(inspect.getdoc(skill) or "").partition("\n")[0],
        params=dict(wiring.constants),
        reads=connections(wiring.inputs),
        writes=connections(wiring.outputs),
        reasons=tuple(skill.reasons),
        senses=skill.senses,
        uses=tuple(skill.uses),
    )
