"""Stage of a skill: a fake cell with objects on the table, and perhaps one in the tool."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from executive.cell.detection import Detections
from executive.cell.objects import Item, Target
from executive.cell.workcell import CellOptions
from executive.cells.fake.cell import ROUTES, FakeCell, SilentOperator, bare_table
from executive.geometry import tool_down
from executive.skill import HOLDING, Direction, Port, Skill


@dataclass(frozen=True)
class Stage:
    """A fake cell after one look.

    Attributes:
        cell: Cell with one object of each class in a row on the table, and an operator who requests each.
        detections: Result of the look, without the object in the tool.
        targets: One target per detection.
        item: Item in the tool if the skill requires one there, else the item of the first target.
    """

    cell: FakeCell
    detections: Detections
    targets: list[Target]
    item: Item


def set_up(skill: type[Skill], *, holding: bool) -> Stage:
    """Return a stage for a skill.

    The cup is on the first target if the skill needs a target and the tool but not the arm, as after another
    skill.

    Args:
        skill: The skill.
        holding: True if the tool holds an object that the ledger knows; False if the tool is empty.
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
    """Return the detections of the first detector on the table, and the targets of the ledger."""
    camera, view = fake.camera, "table"
    frame = camera.capture()
    request = next(iter(fake.cell.detectors.values())).request(frame, view)
    while not request.ready:
        fake.advance()
    detections = Detections(**vars(request.result()), frame=frame, view=view, area=camera.area(view))
    return detections, list(fake.ledger.observe(detections, fake.cell.localizer.localize(detections)))


def _works_on_target(skill: type[Skill]) -> bool:
    input_types = [port.type for port in list_inputs(skill)]
    return "tool" in skill.uses and "arm" not in skill.uses and Target in input_types


def list_inputs(skill: type[Skill]) -> list[Port]:
    """Return the input ports of a skill."""
    return [port for port in skill.ports.values() if port.direction is Direction.IN]
