"""Outline of a behaviour tree: its nodes as plain data, for drawings, run records and web pages."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

from py_trees.behaviour import Behaviour
from pydantic import Field

from executive.tree.node import ControlNode
from executive.tree.skill_leaf import SkillLeaf

_INDEX_PATTERN = re.compile(r"[0-9]+:")
"""Index before the name of a list element in a path: `2:` in `2:try`."""
SKILL_KIND = "skill"
"""Value of `OutlineNode.kind` for leaves that run a skill."""


@dataclass(frozen=True)
class Connection:
    """A port of a skill and the variable to which the port is connected.

    Attributes:
        port, variable: Name of the port, and name of the variable.
        required: False for an input that has a default, which applies while the variable is unwritten.
    """

    port: str
    variable: str
    required: bool


@dataclass(frozen=True)
class OutlineNode:
    """One node of an outline; an alias is the key of an attribute in JSON files.

    Attributes:
        path: Unique path from the root.
        name: Name of the node, with `parent_key` in front if the path contains this key: `recover: look`.
        depth: Number of ancestors.
        detail: Summary of the node's settings in the mission.
        kind: `skill`, or the keyword of a control node.
        symbol: Symbol of a control node in drawings; "" for a skill.
        title: Label of the node; for a node without label, name of the skill or keyword.
        parent_key: Key under which the parent has the node: `do`, `recover`, `catch 1`; "" in a list.
        trigger: Failures after which the handler of a catch runs: `on Grasp.missed`; "" for other nodes.
        subtrees: Names of the subtrees with this node as root, the outermost first.
        skill: Name of the skill. In a control node, all attributes from `skill` to `uses` are empty.
        doc: Description of the skill, one sentence.
        params: Values of the skill's params.
        reads, writes: Connections of the skill's inputs and outputs.
        reasons: Reasons for which the skill may fail.
        senses: True if the skill gets new information, such as an image.
        uses: Devices that no concurrent branch may use at the same time.
    """

    path: str
    name: str
    depth: int
    detail: str
    kind: str
    title: str
    parent_key: Annotated[str, Field(alias="slot")] = ""
    trigger: Annotated[str, Field(alias="when")] = ""
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

    @property
    def joined_subtrees(self) -> str:
        """Names of the subtrees with this node as root, separated by " / "."""
        return " / ".join(self.subtrees)


def make_outline(root: Behaviour) -> list[OutlineNode]:
    """Return every node of the tree in the order of the mission, parents before children."""
    return list(_iterate_outline(root, None))


def list_child_indices(nodes: Sequence[OutlineNode]) -> list[list[int]]:
    """Return for each node of an outline the indices of its children in `nodes`."""
    child_indices: list[list[int]] = [[] for _ in nodes]
    ancestors: list[int] = []
    for index, node in enumerate(nodes):
        del ancestors[node.depth :]
        if ancestors:
            child_indices[ancestors[-1]].append(index)
        ancestors.append(index)
    return child_indices


def _iterate_outline(node: Behaviour, parent: Behaviour | None, depth: int = 0) -> Iterator[OutlineNode]:
    path = _get_path(node)
    relative_path = path.removeprefix(f"{_get_path(parent) if parent else 'tree'}/")
    label = getattr(node, "label", "")
    detail = getattr(node, "detail", "")
    kind = _get_kind(node)
    if label and kind != SKILL_KIND:
        detail = ", ".join(filter(None, (kind, detail)))
    title = label or (node.skill_name if isinstance(node, SkillLeaf) else kind)
    subtrees = tuple(getattr(node, "subtree_names", ()))
    parent_key = _find_parent_key(node, parent, relative_path, (title, *reversed(subtrees)))
    trigger = ""
    if parent is not None and (control_node := _get_control_node(parent)):
        trigger = control_node.describe_trigger(control_node.children[parent.children.index(node)])
    name = _format_name(relative_path)
    outline_node = OutlineNode(path, name, depth, detail, kind, title, parent_key, trigger, subtrees)
    if isinstance(node, SkillLeaf):
        yield _describe_skill(outline_node, node)
    else:
        # A py_trees behaviour that is no node of a mission is drawn in the default style.
        yield replace(outline_node, symbol=(_get_control_node(node) or ControlNode).symbol)
    for child in node.children:
        yield from _iterate_outline(child, node, depth + 1)


def _get_path(node: Behaviour) -> str:
    """Return the path of a node; for a py_trees behaviour without path, its name."""
    return str(getattr(node, "path", node.name))


def _get_kind(node: Behaviour) -> str:
    """Return "skill", the keyword of a control node, or the class name of another py_trees behaviour."""
    if isinstance(node, SkillLeaf):
        return SKILL_KIND
    control_node = _get_control_node(node)
    return control_node.keyword if control_node else type(node).__name__.lower()


def _get_control_node(behaviour: Behaviour) -> ControlNode | None:
    node = getattr(behaviour, "node", None)
    return node if isinstance(node, ControlNode) else None


def _format_name(relative_path: str) -> str:
    """Return the name of a node below its parent, from its path relative to the parent."""
    keys, _, name = relative_path.rpartition("/")
    keys = keys.replace("/", " ")
    name = _INDEX_PATTERN.sub("", name)
    # The path of a list without a label ends with a key and an index, such as "catch/2".
    return f"{keys} {name}" if name.isdigit() else f"{keys}: {name}" if keys else name


def _find_parent_key(
    node: Behaviour, parent: Behaviour | None, relative_path: str, names: Sequence[str]
) -> str:
    """Return the key under which the parent has a node, or "".

    The path of the node relative to its parent consists of the key and some of the `names`, from the last
    to the first. If the path has no key, the function compares the node with the children of the parent.
    """
    parts = [_INDEX_PATTERN.sub("", part) for part in relative_path.split("/")] if parent else []
    for name in names:
        if parts and parts[-1] == name:
            del parts[-1]
    if not parts and parent is not None and (control_node := _get_control_node(parent)):
        omitted_keys = [name for name, key in control_node.keys.items() if not key.in_path]
        child = control_node.children[parent.children.index(node)]
        parts = [name for name in omitted_keys if child in control_node.list_children(name)]
    return " ".join(parts)


def _describe_skill(node: OutlineNode, leaf: SkillLeaf) -> OutlineNode:
    """Return `node` with the declarations and connections of the skill of `leaf`."""
    skill = leaf.skill_type
    wiring = leaf.wiring
    optional_names = [port.name for port in skill.ports.values() if port.default is not ...]

    def make_connections(variables_by_port: Mapping[str, str]) -> tuple[Connection, ...]:
        return tuple(
            Connection(name, f"{variable}{wiring.make_field_suffix(name)}", name not in optional_names)
            for name, variable in variables_by_port.items()
        )

    return replace(
        node,
        skill=leaf.skill_name,
        doc=(inspect.getdoc(skill) or "").partition("\n")[0],
        params=dict(wiring.constants),
        reads=make_connections(wiring.inputs),
        writes=make_connections(wiring.outputs),
        reasons=tuple(skill.reasons),
        senses=skill.senses,
        uses=tuple(skill.uses),
    )
