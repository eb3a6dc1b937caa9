"""The shape of a built tree as plain lines."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from py_trees.behaviour import Behaviour

_NUMBER = re.compile(r"[0-9]+:")


@dataclass(frozen=True)
class OutlineNode:
    """One node of an outline.

    Attributes:
        path: Unique path from the root.
        name: What it is called, after what it is to its parent: `Grasp`, `recover: look`, `do`.
        depth: How many nodes are above it.
        detail: What the mission says about it, in a few words.
    """

    path: str
    name: str
    depth: int
    detail: str


def outline(root: Behaviour) -> list[OutlineNode]:
    """Return every node of the tree in the order of the mission, parents before children."""
    return list(_outline(root, "tree", 0))


def _outline(node: Behaviour, parent: str, depth: int) -> Iterator[OutlineNode]:
    path = getattr(node, "path", node.name)
    slot, _, last = path.removeprefix(f"{parent}/").rpartition("/")
    last = _NUMBER.sub("", last)
    slot = slot.replace("/", " ")
    # A list in the second catch is the catch itself.
    name = f"{slot} {last}" if last.isdigit() else f"{slot}: {last}" if slot else last
    detail = getattr(node, "detail", "")
    if getattr(node, "label", "") and hasattr(node, "word"):
        detail = ", ".join(part for part in (node.word, detail) if part)
    yield OutlineNode(path, name, depth, detail)
    for child in node.children:
        yield from _outline(child, path, depth + 1)
