"""A small tree, and events of its nodes."""

from __future__ import annotations

from events import at, skill_ended, skill_started

from executive.events import NodeStarted, TimedEvent
from executive.mission.outline import OutlineNode


def node(path: str, depth: int, kind: str = "skill") -> OutlineNode:
    name = path.rpartition("/")[2]
    return OutlineNode(path, name, depth, "", kind, name, skill=name if kind == "skill" else "")


NODES = [node("tree", 0, "sequence"), node("tree/Grasp", 1), node("tree/Transit", 1)]


def started(tick: int, path: str, item: str = "") -> TimedEvent:
    return at(tick, skill_started(path, item) if item else NodeStarted(path))


def ended(tick: int, path: str, status: str = "SUCCESS", item: str = "", **fields: str) -> TimedEvent:
    return at(tick, skill_ended(path, status, item, **fields))
