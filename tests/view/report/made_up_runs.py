"""A tree, and what its nodes did, without a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from executive.mission.outline import OutlineNode
from executive.view.report.course import Entry, Span


def skill(name: str, *uses: str, senses: bool = False) -> OutlineNode:
    return OutlineNode(f"tree/{name}", name, 1, "", "skill", name, skill=name, senses=senses, uses=uses)


TREE = (
    OutlineNode("tree", "tree", 0, "", "sequence", "sequence"),
    skill("MoveToScan", "arm"),
    skill("Detect", "camera", senses=True),
    skill("SelectTarget"),
    skill("Approach", "arm", "tool"),
    skill("Grasp", "tool"),
    skill("Transit", "arm", "tool"),
    skill("Release", "tool"),
    skill("Wait"),
)
"""A pick: what moves, what looks, what decides, and what only lets time pass."""


def ran(name: str, began: float, ended: float, item: str = "", status: str = "SUCCESS", *why: str) -> Span:
    """Return one time that a skill of the tree ran; `why` is the reason and the message of a failure."""
    reason, message = why or ("", "")
    return Span(f"tree/{name}", began, ended, status, reason, message, item)


def told(clock: float, node: str, status: str, **data: Any) -> Entry:
    """Return what a journal says of a node at a time."""
    stamp = {"tick": round(240 * clock), "clock": clock, "kind": "status"}
    return {**stamp, "node": node, "status": status, **data}


def picks(count: int, pace: float = 5.0) -> Sequence[Span]:
    """Return the course of a run that brings so many objects, each in so much time [s]."""
    looks = {"MoveToScan": 0.2, "Detect": 0.01}
    acts = {"SelectTarget": 0.0, "Approach": 0.3, "Grasp": 0.02, "Transit": 0.4, "Release": 0.02}
    course: list[Span] = []
    began = 0.0
    for number in range(count):
        for name, share in {**looks, **acts}.items():
            course.append(ran(name, began, began + share * pace, f"cube-{number + 1}" * (name in acts)))
            began += share * pace
        began = (number + 1) * pace
    return course
