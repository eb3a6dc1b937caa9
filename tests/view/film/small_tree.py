"""A small tree, and what a journal says of its nodes."""

from __future__ import annotations

from executive.mission.outline import OutlineNode


def node(path: str, depth: int, kind: str = "skill") -> OutlineNode:
    name = path.rpartition("/")[2]
    return OutlineNode(path, name, depth, "", kind, name, skill=name if kind == "skill" else "")


NODES = [node("tree", 0, "sequence"), node("tree/Grasp", 1), node("tree/Transit", 1)]


def status(tick: int, path: str, now: str, **data):
    return {"tick": tick, "clock": tick / 240, "kind": "status", "node": path, "status": now, **data}
