"""A fake cell with objects on its table, or one in its tool, for a skill to work on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from executive.cell.detection import Detections
from executive.cell.objects import Item, Target
from executive.cell.workcell import CellOptions
from executive.cells.fake.cell import ROUTES, FakeCell, SilentOperator, bare_table
from executive.geometry import tool_down
from executive.skill import HOLDING, Direction, Skill


@dataclass(frozen=True)
class Stage:
    """A fake cell of which one look has been taken.

    Attributes:
        cell: The cell: one object of every class in a row on its table, an operator who wants one of each.
        detections: Result of the look: everything but the object in the tool.
        targets: One target per detection.
        item: The item that the skill is about: that in the tool if the skill needs one there, else the first
            target's.
    """

    cell: FakeCell
    detections: Detections
    targets: list[Target]
    item: Item


def set_up(skill: type[Skill], *, holding: bool) -> Stage:
    """Return a stage for a skill.

    The cup rests on the first target if the skill works on a target with the tool but without the arm:
    another skill has brought it there.

    Args:
        skill: The skill that is to act on it.
        holding: The tool holds an object, and the ledger knows; else it is empty.
    """
    fake = FakeCell(options=CellOptions(SilentOperator(list(ROUTES)), base=Path()))
    table, labels = bare_table().table, list(fake.cell.classes)
    for label, y in zip(labels, np.linspace(*table.y, len(labels) + 2)[1:-1], strict=True):
        fake.world.put(label, sum(table.x) / 2, float(y))
    detections, targets = look(fake)
    item = targets[0].item
    if holding or _works_on_target(skill):
        kind = fake.cell.classes[targets[0].label]
        top = targets[0].position + np.array([kind.ring, 0.0, kind.height / 2])
        fake.arm.put(tool_down(top, 0.0))
    if holding:
        fake.tool.close()
        fake.ledger.record_touch(item)
        fake.ledger.record_grasp(item)
        detections, targets = look(fake)
        if skill.tool_state[0] is not HOLDING:
            item = targets[0].item
    return Stage(fake, detections, targets, item)


def look(fake: FakeCell) -> tuple[Detections, list[Target]]:
    """Return what the first detector sees on the table, and where the ledger takes everything to be."""
    camera, view = fake.camera, "table"
    frame = camera.capture()
    request = next(iter(fake.cell.detectors.values())).request(frame, view)
    while not request.ready:
        fake.advance()
    detections = Detections(**vars(request.result()), frame=frame, view=view, area=camera.area(view))
    return detections, list(fake.ledger.observe(detections, fake.cell.localizer.localize(detections)))


def _works_on_target(skill: type[Skill]) -> bool:
    inputs = [port.type for port in skill.ports.values() if port.direction is Direction.IN]
    return "tool" in skill.uses and "arm" not in skill.uses and Target in inputs
