"""Setup of a conformance test of a skill: situation, fake cell with objects, values of params and inputs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import numpy as np

from executive.cell.detection import Detections
from executive.cell.objects import Item, Target
from executive.cell.workcell import CellOptions
from executive.cells.fake.cell import SHIPPED_ROUTES, FakeCell, SilentOperator, load_empty_cell
from executive.mission.model.port_types import describe_type, is_union
from executive.skill import ANY, EMPTY, HOLDING, Direction, Param, Port, Skill

GENERATED_NUMBER = 0.1
"""Value generated for each numeric param, clipped to its bounds; small, so that durations [s] are short."""

_HOLDING_BY_STATE: Mapping[Any, tuple[bool, ...]] = {EMPTY: (False,), HOLDING: (True,), ANY: (False, True)}
"""Values of `Situation.is_holding` by the declared state of the tool before the run."""
_TOOL_TEXTS = {False: "with an empty tool", True: "with an item in the tool"}
"""Description of the tool by `Situation.is_holding`."""


@dataclass(frozen=True)
class SkillScene:
    """A fake cell with one captured image, its detections and their targets.

    Attributes:
        cell: Cell with a row of objects on the table, one per class; its operator requests each class once.
        detections: Detections in the image; an object in the tool is not among them.
        targets: One localized target per detection.
        item: Item in the tool if the skill requires `HOLDING`, else the item of the first target.
    """

    cell: FakeCell
    detections: Detections
    targets: list[Target]
    item: Item


Arrange = Callable[[SkillScene], Mapping[str, Any]]
"""Function that may change the scene of a skill, and returns values of params and inputs by name."""


class NotTestable(Exception):
    """A conformance check of a skill cannot be run."""


class ArrangementFailed(NotTestable):
    """The start of a test run cannot be prepared; the message states the cause and the correction."""


@dataclass(frozen=True)
class Situation:
    """Test scenario: the conditions at the start of a test run of a skill.

    Attributes:
        name: Description, as the beginning of a sentence: `with an empty tool`.
        is_holding: True if the tool holds an object.
        params: Values of the params that differ from their defaults, by name.
        has_all_inputs: True if values are generated for the optional inputs, too.
    """

    name: str
    is_holding: bool
    params: Mapping[str, Any] = field(default_factory=dict)
    has_all_inputs: bool = False


def list_situations(skill: type[Skill], arrange: Arrange) -> Iterator[Situation]:
    """Yield the situations in which a skill is tested.

    There is one situation for each allowed state of the tool, with default values; one with all optional
    inputs, if there are any; and one for each choice except the default, of params that `arrange` omits.

    Raises:
        ArrangementFailed: The declared `tool_state` is invalid, or a value cannot be generated.
    """
    tool_state = skill.tool_state
    if not isinstance(tool_state, tuple) or not tool_state or tool_state[0] not in _HOLDING_BY_STATE:
        raise ArrangementFailed(f"its tool_state is {tool_state!r}; it must begin with ANY, EMPTY or HOLDING")
    is_holding = _HOLDING_BY_STATE[tool_state[0]][0]
    for holds in _HOLDING_BY_STATE[tool_state[0]]:
        yield Situation(_TOOL_TEXTS[holds], holds)
    if any(not port.is_required for port in list_input_ports(skill)):
        yield Situation(f"{_TOOL_TEXTS[is_holding]} and all inputs given", is_holding, has_all_inputs=True)
    scene, values = prepare_scene(skill, Situation("", is_holding), arrange)
    for param in skill.params.values():
        for value in () if param.name in values else _list_choices(param, scene):
            name = f"{_TOOL_TEXTS[is_holding]} and {param.name}: {value}"
            yield Situation(name, is_holding, {param.name: value})


def prepare_scene(
    skill: type[Skill], situation: Situation, arrange: Arrange
) -> tuple[SkillScene, dict[str, Any]]:
    """Return a new scene, and the values of params and inputs by name, for a run in a situation.

    Raises:
        ArrangementFailed: `arrange` raised an exception, or a required value cannot be generated.
    """
    scene = build_scene(skill, is_holding=situation.is_holding)
    try:
        values = {**situation.params, **arrange(scene)}
    except Exception as error:
        raise ArrangementFailed(f"the function `arrange` raised {type(error).__name__}: {error}") from error
    declarations: list[Param | Port] = [*skill.params.values(), *list_input_ports(skill)]
    for entry in declarations:
        is_needed = entry.is_required or entry.name in skill.one_of[:1]
        needs_value = is_needed or (situation.has_all_inputs and isinstance(entry, Port))
        if needs_value and entry.name not in values and (value := _generate_value(entry, scene)) is not None:
            values[entry.name] = value
    if missing := [entry for entry in declarations if entry.is_required and entry.name not in values]:
        names = " and ".join(f'"{entry.name}" ({describe_type(entry.type)})' for entry in missing)
        example = ", ".join(f'"{entry.name}": ...' for entry in missing)
        raise ArrangementFailed(
            f"no value can be generated for {names}. Return it from a function in a test: "
            f"list_conformance_checks({skill.__name__}, lambda scene: {{{example}}}); "
            "skills/README.md has an example."
        )
    return scene, values


def _list_choices(param: Param, scene: SkillScene) -> list[Any]:
    """Return the choices of a param, or False and True, and a name to which it may refer; no default."""
    values = [False, True] if param.type is bool else list(param.choices or ())
    values += [_find_name_in_scene(param.refers_to, scene)] if param.refers_to else []
    return [value for value in values if value not in (param.default, None)]


def _generate_value(declared: Param | Port, scene: SkillScene) -> Any:
    """Return a valid value for a declared param or input; None if no value can be generated."""
    if isinstance(declared, Port):
        return _find_value_of_type(declared.type, declared.refers_to, scene)
    if declared.choices:
        return declared.choices[0]
    if declared.refers_to:
        return _find_name_in_scene(declared.refers_to, scene)
    if declared.type not in (int, float):
        return {str: f"some {declared.name}", bool: False}.get(declared.type)
    number = 1 if declared.type is int else GENERATED_NUMBER
    number = number if declared.ge is None else max(number, declared.ge)
    return declared.type(number if declared.le is None else min(number, declared.le))


def _find_value_of_type(value_type: Any, refers_to: str, scene: SkillScene) -> Any:
    """Return a value of this type from the scene; None if the scene has none."""
    if value_type is str:
        return _find_name_in_scene(refers_to, scene)
    if is_union(value_type):
        values = (_find_value_of_type(member, refers_to, scene) for member in get_args(value_type))
        return next((value for value in values if value is not None), None)
    if value_type == list[Target]:
        return list(scene.targets)
    return {Target: scene.targets[0], Detections: scene.detections, int: 1}.get(value_type)


def _find_name_in_scene(refers_to: str, scene: SkillScene) -> str | None:
    """Return a name of the kind `refers_to` from the scene, for instance of a bin; None: unknown kind."""
    fake = scene.cell
    label = fake.ledger.get_label(scene.item)
    return {
        "item": scene.item,
        "class": label,
        "bin": fake.routes[label][0],
        "detector": next(iter(fake.detectors)),
        "pose": list(fake.arm.poses)[-1],
    }.get(refers_to)


def build_scene(skill: type[Skill], *, is_holding: bool) -> SkillScene:
    """Return a new scene for a skill; if `is_holding` is True, the tool holds an item of the ledger.

    If the skill has a target as input, and uses the tool without the arm, the suction cup touches the
    first target.
    """
    fake = FakeCell(options=CellOptions(SilentOperator(list(SHIPPED_ROUTES)), cell_folder=Path()))
    table, labels = load_empty_cell().table, list(fake.cell.classes)
    for label, y in zip(labels, np.linspace(*table.y, len(labels) + 2)[1:-1], strict=True):
        fake.world.put(label, sum(table.x) / 2, float(y))
    detections, targets = detect_targets(fake)
    item = targets[0].item
    input_types = [port.type for port in list_input_ports(skill)]
    starts_at_target = "tool" in skill.uses and "arm" not in skill.uses and Target in input_types
    if is_holding or starts_at_target:
        object_class = fake.cell.classes[targets[0].label]
        top = targets[0].position + np.array([object_class.contact_radius, 0.0, object_class.height / 2])
        fake.arm.set_tool_position(top)
    if is_holding:
        fake.tool.close()
        fake.ledger.record_touch(item)
        fake.ledger.record_grasp(item)
        detections, targets = detect_targets(fake)
        if skill.tool_state[0] is not HOLDING:
            item = targets[0].item
    return SkillScene(fake, detections, targets, item)


def detect_targets(fake: FakeCell) -> tuple[Detections, list[Target]]:
    """Capture an image; return the detections of the first detector on the table, and their targets."""
    camera, view = fake.camera, "table"
    frame = camera.capture()
    request = next(iter(fake.cell.detectors.values())).request(frame, view)
    while not request.ready:
        fake.advance()
    detections = Detections(**vars(request.result()), frame=frame, view=view, area=camera.get_view_box(view))
    return detections, list(fake.ledger.observe(detections, fake.cell.localizer.localize(detections)))


def list_input_ports(skill: type[Skill]) -> list[Port]:
    """Return the input ports of a skill."""
    return [port for port in skill.ports.values() if port.direction is Direction.IN]
