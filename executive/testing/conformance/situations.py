"""Start of a skill's run: situation, fake cell with objects, and values of params and inputs."""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Union, get_args, get_origin

import numpy as np

from executive.cell.detection import Detections
from executive.cell.objects import Item, Target
from executive.cell.workcell import CellOptions
from executive.cells.fake.cell import ROUTES, FakeCell, SilentOperator, load_empty_cell
from executive.geometry import tool_down
from executive.mission.model.port_types import describe_type
from executive.skill import ANY, EMPTY, HOLDING, Direction, Param, Port, Skill

SMALL_NUMBER = 0.1
"""A generated number, if the bounds of the param allow it; small, because it may be a duration [s]."""

_START_STATES: Mapping[Any, tuple[bool, ...]] = {EMPTY: (False,), HOLDING: (True,), ANY: (False, True)}
_TOOL_TEXTS = {False: "with an empty tool", True: "with an item in the tool"}


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


Arrange = Callable[[Stage], Mapping[str, Any]]
"""Changes a stage for a skill and returns values for some of its params and inputs."""


class NotTried(Exception):
    """A check cannot be run."""


class NotArranged(NotTried):
    """A skill cannot be tried, because a value for it is missing; the message says how to give one."""


@dataclass(frozen=True)
class Situation:
    """Start of a run of a skill.

    Attributes:
        name: Name, as a part of a sentence: `with an empty tool`.
        holding: True if the tool holds an object.
        params: Params that differ from their defaults.
        has_all_inputs: True if optional inputs have values, too.
    """

    name: str
    holding: bool
    params: Mapping[str, Any] = field(default_factory=dict)
    has_all_inputs: bool = False


def list_situations(skill: type[Skill], arrange: Arrange) -> Iterator[Situation]:
    """Yield the situations in which a skill is tried.

    The tool is in the required state, or in both states if none is required. The values are the defaults,
    all inputs, and each further choice of a param without a value from `arrange`.

    Raises:
        NotArranged: The required state of the tool is undeclared, or a value cannot be generated.
    """
    state = skill.tool_state
    if not isinstance(state, tuple) or not state or state[0] not in _START_STATES:
        raise NotArranged(f"its tool_state is {state!r}; it must begin with ANY, EMPTY or HOLDING")
    first = _START_STATES[state[0]][0]
    for holding in _START_STATES[state[0]]:
        yield Situation(_TOOL_TEXTS[holding], holding)
    if any(not port.is_required for port in list_inputs(skill)):
        yield Situation(f"{_TOOL_TEXTS[first]} and all inputs given", first, has_all_inputs=True)
    stage, values = prepare(skill, Situation("", first), arrange)
    for param in skill.params.values():
        for value in () if param.name in values else _list_choices(param, stage):
            yield Situation(f"{_TOOL_TEXTS[first]} and {param.name}: {value}", first, {param.name: value})


def prepare(skill: type[Skill], situation: Situation, arrange: Arrange) -> tuple[Stage, dict[str, Any]]:
    """Return a fresh stage and the values with which a skill starts there.

    Raises:
        NotArranged: A required value is missing.
    """
    stage = set_up(skill, holding=situation.holding)
    try:
        values = {**situation.params, **arrange(stage)}
    except Exception as error:
        raise NotArranged(f"the function `arrange` raised {type(error).__name__}: {error}") from error
    declarations: list[Param | Port] = [*skill.params.values(), *list_inputs(skill)]
    missing = []
    for declared in declarations:
        is_used = declared.is_required or (situation.has_all_inputs and isinstance(declared, Port))
        if declared.name in values or not is_used:
            continue
        if (value := _generate(declared, stage)) is not None:
            values[declared.name] = value
        elif declared.is_required:
            missing.append(declared)
    if missing:
        names = " and ".join(f'"{declared.name}" ({describe_type(declared.type)})' for declared in missing)
        example = ", ".join(f'"{declared.name}": ...' for declared in missing)
        raise NotArranged(
            f"no value can be generated for {names}. Return it from a function in a test: "
            f"conformance({skill.__name__}, lambda stage: {{{example}}}), as skills/README.md shows."
        )
    return stage, values


def _list_choices(param: Param, stage: Stage) -> list[Any]:
    """Return the values of a param other than the default: choices, names, False and True."""
    values = [False, True] if param.type is bool else list(param.choices or ())
    values += [_find_name(param.refers, stage)] if param.refers else []
    return [value for value in values if value not in (param.default, None)]


def _generate(declared: Param | Port, stage: Stage) -> Any:
    """Return an allowed value of a param or an input, or None if none is known."""
    if isinstance(declared, Port):
        return _find_value(declared.type, declared.refers, stage)
    if declared.choices:
        return declared.choices[0]
    if declared.refers:
        return _find_name(declared.refers, stage)
    if declared.type not in (int, float):
        return {str: f"some {declared.name}", bool: False}.get(declared.type)
    number = 1 if declared.type is int else SMALL_NUMBER
    number = number if declared.ge is None else max(number, declared.ge)
    return declared.type(number if declared.le is None else min(number, declared.le))


def _find_value(kind: Any, refers: str, stage: Stage) -> Any:
    """Return a value of a type from the stage, or None."""
    if kind is str:
        return _find_name(refers, stage)
    if get_origin(kind) in (Union, types.UnionType):
        return _find_value(get_args(kind)[0], refers, stage)
    if kind == list[Target]:
        return list(stage.targets)
    return {Target: stage.targets[0], Detections: stage.detections}.get(kind)


def _find_name(refers: str, stage: Stage) -> str | None:
    """Return a name of the referenced kind from the stage, or None."""
    fake = stage.cell
    label = fake.ledger.get_label(stage.item)
    names = {
        "item": stage.item,
        "class": label,
        "bin": fake.routes[label][0],
        "detector": next(iter(fake.detectors)),
        "pose": list(fake.arm.poses)[-1],
    }
    return names.get(refers)


def set_up(skill: type[Skill], *, holding: bool) -> Stage:
    """Return a stage for a skill.

    The cup is on the first target if the skill needs a target and the tool but not the arm, as after another
    skill.

    Args:
        skill: The skill.
        holding: True if the tool holds an object that the ledger knows; False if the tool is empty.
    """
    fake = FakeCell(options=CellOptions(SilentOperator(list(ROUTES)), base=Path()))
    table, labels = load_empty_cell().table, list(fake.cell.classes)
    for label, y in zip(labels, np.linspace(*table.y, len(labels) + 2)[1:-1], strict=True):
        fake.world.put(label, sum(table.x) / 2, float(y))
    detections, targets = look(fake)
    item = targets[0].item
    if holding or _works_on_target(skill):
        kind = fake.cell.classes[targets[0].label]
        top = targets[0].position + np.array([kind.ring, 0.0, kind.height / 2])
        fake.arm.set_tool_pose(tool_down(top, 0.0))
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
