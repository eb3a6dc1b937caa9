"""A fake cell with something on its table, or in its tool, for a skill to work on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from executive.geometry import tool_down
from executive.messages import Detections, Item, Target
from executive.skill import HOLDING, Direction, Skill
from executive.testing.fake_cell import ROUTES, FakeCell, SilentOperator, bare_table
from executive.workcell import CellOptions


@dataclass(frozen=True)
class Stage:
    """A fake cell of which one look has been taken.

    Attributes:
        cell: The cell: one object of every class in a row on its table, an operator who wants one of each.
        detections: What the look found: everything but what the tool holds.
        targets: Where that is, one target each.
        item: What the skill is about: the item in the tool if it needs one there, else the first target's.
    """

    cell: FakeCell
    detections: Detections
    targets: list[Target]
    item: Item


def set_up(skill: type[Skill], *, holding: bool) -> Stage:
    """Return a stage for a skill.

    The cup rests on the first target if the skill works on a target with the tool but without the arm:
    somebody else has brought it there. It rests on what it holds, too.

    Args:
        skill: Who is to act on it.
        holding: The tool holds an object, and the ledger knows; else it is empty.
    """
    fake = FakeCell(options=CellOptions(SilentOperator(list(ROUTES)), base=Path()))
    _furnish(fake)
    detections, targets = look(fake)
    if holding or _works_on_target(skill):
        _touch(fake, targets[0])
    if holding:
        held = targets[0].item
        fake.tool.close()
        fake.ledger.touched(held)
        fake.ledger.held(held)
        detections, targets = look(fake)
        if skill.tool_state[0] is HOLDING:
            return Stage(fake, detections, targets, held)
    return Stage(fake, detections, targets, targets[0].item)


def _works_on_target(skill: type[Skill]) -> bool:
    inputs = (port.type for port in skill.ports.values() if port.direction is Direction.IN)
    return "tool" in skill.uses and "arm" not in skill.uses and Target in inputs


def _furnish(fake: FakeCell) -> None:
    """Stand one object of every class in a row on the table."""
    table, labels = bare_table().table, list(fake.cell.classes)
    x, (low, high) = sum(table.x) / 2, table.y
    for label, y in zip(labels, _spread(low, high, len(labels)), strict=True):
        fake.world.put(label, x, y)


def _spread(low: float, high: float, count: int) -> Iterable[float]:
    """Return so many numbers between two, none of them at the edge."""
    return (float(y) for y in np.linspace(low, high, count + 2)[1:-1])


def look(fake: FakeCell, view: str = "table") -> tuple[Detections, list[Target]]:
    """Return what the first detector sees in a view, and where the ledger now takes everything to be."""
    camera = fake.camera
    frame = camera.capture()
    request = fake.detector.request(frame, view)
    while not request.ready:
        fake.advance()
    answer = request.result()
    detections = Detections(frame, answer.found, answer.detector, answer.reliability, view, camera.area(view))
    positions = [fake.cell.localizer.locate(detection, frame) for detection in answer.found]
    return detections, list(fake.ledger.observe(detections, positions))


def _touch(fake: FakeCell, target: Target) -> None:
    """Put the cup onto a target."""
    kind = fake.cell.classes[target.label]
    top = target.position + np.array([kind.ring, 0.0, kind.height / 2])
    fake.arm.put(tool_down(top, 0.0))
