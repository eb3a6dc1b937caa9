"""A tree, and what its nodes did, without a run."""

from __future__ import annotations

from collections.abc import Sequence

from executive.mission.outline import OutlineNode
from executive.record.timeline import Activation


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


def activation(
    path: str, start: float, end: float, item: str = "", status: str = "SUCCESS", *why: str
) -> Activation:
    """Return an activation; `why` is the reason and the message of a failure."""
    now = (round(240 * start), start, round(240 * end), end)
    return Activation(path, 1, path.rpartition("/")[2], item, status, *now, *why)


def ran(name: str, start: float, end: float, *item_status_and_why: str) -> Activation:
    """Return an activation of a skill of the tree."""
    return activation(f"tree/{name}", start, end, *item_status_and_why)


def picks(count: int, pace: float = 5.0) -> Sequence[Activation]:
    """Return the course of a run that brings so many objects, each in so much time [s]."""
    looks = {"MoveToScan": 0.2, "Detect": 0.01}
    acts = {"SelectTarget": 0.0, "Approach": 0.3, "Grasp": 0.02, "Transit": 0.4, "Release": 0.02}
    course: list[Activation] = []
    began = 0.0
    for number in range(count):
        for name, share in {**looks, **acts}.items():
            course.append(ran(name, began, began + share * pace, f"cube-{number + 1}" * (name in acts)))
            began += share * pace
        began = (number + 1) * pace
    return course
