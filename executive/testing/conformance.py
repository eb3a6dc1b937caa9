"""Conformance checks: rules for the behaviour of every skill, applied to test runs of the skill.

A skill runs on a fake cell in several situations: without and with a fault of the cell, and with a halt at
many ticks. Each function with the argument `runs` is a rule: its docstring states the rule, and the function
yields one text per violation. `Skill` checks the rules for declarations when the class of a skill is defined.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, get_args

import numpy as np

from executive.cell.device_config import STEP
from executive.cell.frame import Detections
from executive.cell.objects import Item, Target
from executive.cell.tools import ToolMeasurement
from executive.errors import Interrupted, to_text
from executive.manipulation.motions import capture_and_detect, complete, localize_and_observe
from executive.mission.ports import describe_type, find_element_type, is_assignable
from executive.skill import ANY, EMPTY, HALT, HOLDING, Direction, Param, Port, Skill
from executive.station.border import Access
from executive.station.station import CellOptions, SilentOperator
from executive.testing import faults
from executive.testing.fake_cell import SHIPPED_ROUTES, FakeCell
from executive.testing.faulty_cell import FaultInjector, ScheduledFault
from executive.testing.run_skill import SkillResult, observe_accesses, run_skill
from executive.tree.keys import is_union

MAX_TICKS = int(60.0 / STEP)
"""Maximum duration of a skill [control steps]; no skill needs as long on the fake cell."""
MAX_HALTS = 40
"""Maximum number of halts at evenly spaced ticks of a run."""
MAX_PROBLEMS = 5
"""Maximum number of violations that a check reports."""
GENERATED_NUMBER = 0.1
"""Value generated for each numeric param, clipped to its bounds; small, so that durations [s] are short."""
_ACTIONS = ("arm.start", "arm.stop", "tool.open", "tool.close", "camera.capture")
"""Commands to parts of the cell; the part must be in `uses` of the skill."""
_MEASUREMENTS = ("camera.capture", "operator.ask")
"""Calls that return new information; they require `senses` of the skill."""
_QUERY_PREFIXES = ("is_", "find_", "get_", "count_", "describe", "sees_")
"""First letters of the methods of the cell that change nothing, so that a condition may call them."""
_FAULTS = (
    ("tool", "while the tool cannot hold", faults.after(0.0, faults.grip_fails())),
    ("tool", "while the held object falls", faults.after(0.0, faults.grip_lost(None))),
    ("arm", "while the arm collides", faults.after(0.0, faults.arm_collides())),
    ("arm", "while no path is found", faults.after(0.0, faults.no_path())),
    ("camera", "while no detector answers", faults.after(0.0, faults.detector_dead())),
    ("camera", "while nothing is detected", faults.after(0.0, faults.detector_finds_nothing())),
)
"""Faults in test runs: device in `uses` of the affected skills, description, fault."""


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
    """No run of a skill can be prepared; the message states the cause and the correction."""


@dataclass(frozen=True)
class Situation:
    """Conditions at the start of a test run of a skill.

    Attributes:
        name: Description, as the beginning of a sentence: `with an empty tool`.
        is_holding: True if the tool holds an object.
        params: Values of the params that differ from their defaults, by name.
        script: Faults of the cell.
    """

    name: str
    is_holding: bool
    params: Mapping[str, Any] = field(default_factory=dict)
    script: Sequence[ScheduledFault] = ()


def _list_situations(skill: type[Skill]) -> Iterator[Situation]:
    """Yield situations: for each allowed state of the tool, without and with faults; for each choice."""
    for is_holding in {EMPTY: (False,), HOLDING: (True,), ANY: (False, True)}[skill.tool_state[0]]:
        name = "with an item in the tool" if is_holding else "with an empty tool"
        yield Situation(name, is_holding)
        for device, text, fault in _FAULTS:
            if device in skill.uses:
                yield Situation(f"{name} {text}", is_holding, script=(fault,))
    for param in skill.params.values():
        for value in [False, True] if param.type is bool else param.choices or ():
            if value != param.default:
                yield Situation(f"{name} and {param.name}: {value}", is_holding, {param.name: value})


def _prepare_scene(
    skill: type[Skill], situation: Situation, arrange: Arrange
) -> tuple[SkillScene, dict[str, Any]]:
    """Return a new scene, and the values of params and inputs by name, for a run in a situation.

    Raises:
        NotTestable: A required value cannot be generated.
    """
    scene = _build_scene(skill, is_holding=situation.is_holding)
    values = {**situation.params, **arrange(scene)}
    entries: list[Param | Port] = [*skill.params.values(), *list_input_ports(skill)]
    for entry in entries:
        if entry.name not in values and (entry.is_required or entry.name in skill.one_of[:1]):
            values[entry.name] = _generate_value(entry, scene)
            if values[entry.name] is None:
                raise NotTestable(
                    f'no value can be generated for "{entry.name}" ({describe_type(entry.type)}). Return it: '
                    f'list_conformance_checks({skill.__name__}, lambda scene: {{"{entry.name}": ...}})'
                )
    return scene, values


def list_input_ports(skill: type[Skill]) -> list[Port]:
    """Return the input ports of a skill."""
    return [port for port in skill.ports.values() if port.direction is Direction.IN]


def _generate_value(entry: Param | Port, scene: SkillScene) -> Any:
    """Return a valid value for a param or input; None if no value can be generated."""
    if isinstance(entry, Param) and entry.choices:
        return entry.choices[0]
    targets = scene.targets
    values = {Target: targets[0], list[Target]: list(targets), Detections: scene.detections, int: 1}
    if isinstance(entry, Param):
        number = max(GENERATED_NUMBER, entry.ge or 0.0)
        number = number if entry.le is None else min(number, entry.le)
        values = {bool: False, int: math.ceil(number), float: number, str: f"some {entry.name}"}
    if entry.refers_to:
        label = scene.cell.ledger.get_label(scene.item)
        names = {"item": scene.item, "class": label, "bin": scene.cell.routes[label][0], "pose": "home"}
        values[str] = names.get(entry.refers_to, next(iter(scene.cell.detectors)))
    value_types = get_args(entry.type) if is_union(entry.type) else [entry.type]
    return next((values[each] for each in value_types if each in values), None)


def _build_scene(skill: type[Skill], *, is_holding: bool) -> SkillScene:
    """Return a new scene for a skill; if `is_holding` is True, the tool holds an item of the ledger.

    If the skill has a target as input, and uses the tool without the arm, the tool touches the first target.
    """
    fake = FakeCell(options=CellOptions(SilentOperator(list(SHIPPED_ROUTES)), cell_folder=Path()))
    classes = fake.cell.classes
    table = fake.config.table
    for label, y in zip(classes, np.linspace(*table.y, len(classes) + 2)[1:-1], strict=True):
        fake.world.put(label, sum(table.x) / 2, float(y))
    detections, targets = _detect_targets(fake)
    first = targets[0]
    touches_target = Target in [port.type for port in list_input_ports(skill)] and "arm" not in skill.uses
    if is_holding or (touches_target and "tool" in skill.uses):
        offset = (classes[first.label].contact_radius, 0.0, classes[first.label].height / 2)
        fake.arm.set_tool_position(first.position + offset)
    if is_holding:
        fake.tool.close()
        fake.ledger.record_measurement(first.item, ToolMeasurement())
        fake.ledger.record_grasp(first.item)
        detections, targets = _detect_targets(fake)
    item = first.item if skill.tool_state[0] is HOLDING else targets[0].item
    return SkillScene(fake, detections, targets, item)


def _detect_targets(fake: FakeCell) -> tuple[Detections, list[Target]]:
    """Look at the table; return the detections of the first detector, and their targets."""
    detections = complete(capture_and_detect(fake.cell, "", "table"), fake.advance)
    _, targets = complete(localize_and_observe(fake.cell, detections))
    return detections, targets


@dataclass(frozen=True)
class SkillTestRun:
    """One run of a skill in a situation, to its end or to a halt.

    Attributes:
        situation: Situation in which the run began.
        text: Situation and result, as the beginning of a sentence.
        result: Result of the run; the status is `FAULT` if the skill raised an exception.
        calls: Control step and name, for instance `arm.start`, of each call of a part of the cell.
        are_inputs_equal: True if params and inputs have the same values as before.
        is_holding: True if the tool holds an object at the end.
        is_item_held: True if the tool holds an item at the end according to the ledger.
        is_at_rest: True if the arm was at rest at the end.
    """

    situation: Situation
    text: str
    result: SkillResult
    calls: list[tuple[int, str]]
    are_inputs_equal: bool
    is_holding: bool
    is_item_held: bool
    is_at_rest: bool


@dataclass
class SkillRuns:
    """The test runs of one skill, which all its checks share; the runs are executed at their first use.

    Attributes:
        name: Name of the skill in messages.
        skill: Class of the skill.
        arrange: Function, given by the author of the skill, that prepares the `SkillScene` of each run.
    """

    name: str
    skill: type[Skill]
    arrange: Arrange

    @cached_property
    def all(self) -> list[SkillTestRun]:
        """One run in each situation, and halted runs in the situations without a fault.

        Runs are halted at evenly spaced ticks, at calls, and one tick after each call.
        """
        runs = [self._run(situation) for situation in _list_situations(self.skill)]
        for run in list(runs):
            last_tick = run.result.ticks
            ticks = set(range(1, last_tick + 1, 1 + last_tick // MAX_HALTS))
            ticks |= {tick + offset for tick, _ in run.calls for offset in (0, 1)} - {0}
            if run.result.status != "RUNNING" and not run.situation.script:
                runs += [self._run(run.situation, tick) for tick in ticks if tick <= last_tick]
        return runs

    def _run(self, situation: Situation, halt_at: int | None = None) -> SkillTestRun:
        scene, values = _prepare_scene(self.skill, situation, self.arrange)
        fake = scene.cell
        FaultInjector(situation.script).install(fake)
        calls: list[tuple[int, str]] = []
        first_tick = fake.tick_count

        def record_call(access: Access) -> None:
            if access.is_call:
                calls.append((fake.tick_count - first_tick, access.path))

        fake.cell = observe_accesses(fake.cell, record_call)
        initial_values = str(values)
        try:
            result = run_skill(self.skill, fake, inputs=values, max_ticks=MAX_TICKS, halt_at=halt_at)
        except Interrupted:
            raise
        except BaseException as error:
            message = f"{type(error).__name__}: {to_text(error)}"
            result = SkillResult("FAULT", "", message, ticks=fake.tick_count - first_tick)
        ending = f"{result.status} at tick {result.ticks} {result.reason} {result.message}".rstrip()
        return SkillTestRun(
            situation=situation,
            text=f"{situation.name}: {ending}",
            result=result,
            calls=calls,
            are_inputs_equal=str(values) == initial_values,
            is_holding=fake.tool.holding,
            is_item_held=fake.ledger.find_held_item() is not None,
            is_at_rest=fake.arm.at_rest and result.braking_steps == 0,
        )


Rule = Callable[[SkillRuns], Iterator[str]]
"""Function whose docstring states a rule; yields one text per violation: place, problem, correction."""


def can_succeed(runs: SkillRuns) -> Iterator[str]:
    """The skill succeeds in at least one situation; a condition may always fail."""
    if not (runs.skill.is_condition or any(run.result.status == "SUCCESS" for run in runs.all)):
        yield f"{runs.name} never succeeded; {runs.all[0].text}. Set up another scene with `arrange`."


def ends_as_declared(runs: SkillRuns) -> Iterator[str]:
    """The skill ends within 60 s with success, with a declared reason and a message, or with a halt."""
    for run in runs.all:
        if run.result.status == "RUNNING":
            yield f"{run.text}. Limit the duration of each wait, and fail with a reason when it expires."
        elif run.result.status == "FAULT":
            yield f"{run.text}. A fault ends the run: fail with a declared reason, or correct the code."
        elif run.result.status == "FAILURE" and not run.result.message.strip():
            yield f"{run.text} has no message. State what happened: the operator reads only this message."


def has_outputs_of_declared_types(runs: SkillRuns) -> Iterator[str]:
    """Each output, and each element of a list, has the declared type."""
    for run in runs.all:
        for name, value in run.result.outputs.items():
            port_type = runs.skill.ports[name].type
            element_type = find_element_type(port_type)
            elements = value if isinstance(value, list | tuple) and element_type is not None else ()
            are_elements_right = all(is_assignable(type(each), element_type) for each in elements)
            if not (is_assignable(type(value), port_type) and are_elements_right):
                yield f"{run.text}, and {runs.name}.{name} is {value!r}, not {describe_type(port_type)}."


def leaves_inputs_unchanged(runs: SkillRuns) -> Iterator[str]:
    """The skill does not change its params and inputs."""
    for run in runs.all:
        if not run.are_inputs_equal:
            yield f"{run.text}, and an input has changed. Other nodes read the value later: change a copy."


def uses_only_declared_parts(runs: SkillRuns) -> Iterator[str]:
    """The skill commands only parts in `uses`, moves only with `moves`, and senses only with `senses`.

    A condition only reads the cell.
    """
    skill = runs.skill
    for name in dict.fromkeys(name for run in runs.all for _, name in run.calls):
        part, _, method = name.partition(".")
        if name in _ACTIONS and part not in skill.uses:
            yield f'{runs.name} calls cell.{name} and does not declare the {part}. Add "{part}" to uses.'
        if name == "arm.start" and not skill.moves:
            yield f"{runs.name} calls cell.{name} and does not declare that it moves. Add moves = True."
        if name in _MEASUREMENTS and not skill.senses:
            yield f"{runs.name} calls cell.{name} and does not declare that it senses. Add senses = True."
        if skill.is_condition and not method.startswith(_QUERY_PREFIXES):
            yield f"{runs.name} calls cell.{name}, and declares is_condition. A condition only reads."


def leaves_tool_as_declared(runs: SkillRuns) -> Iterator[str]:
    """After success, each failure and a halt at any tick, the tool is in the declared state."""
    for run in runs.all:
        before = HOLDING if run.situation.is_holding else EMPTY
        after = before if runs.skill.tool_state[1] is ANY else runs.skill.tool_state[1]
        if run.result.status != "SUCCESS":
            after = runs.skill.tool_state_after_failure.get(run.result.reason or HALT, before)
        if run.result.status in ("RUNNING", "FAULT"):
            continue
        if after is not ANY and (after is HOLDING) != run.is_holding:
            actual = "holds something" if run.is_holding else "is empty"
            yield f"{run.text}, and the tool {actual}, unlike tool_state or tool_state_after_failure."
        elif run.is_holding and not run.is_item_held:
            yield f"{run.text}, and the ledger knows no held item. Call record_grasp, or open the tool."


def leaves_arm_at_rest(runs: SkillRuns) -> Iterator[str]:
    """The arm is at rest after the end and after a halt of the skill."""
    for run in runs.all:
        if not run.is_at_rest and run.result.status not in ("RUNNING", "FAULT"):
            yield f"{run.text}, and the arm still moves. Call cell.arm.stop() in finally, or use `follow`."


RULES: tuple[Rule, ...] = (
    can_succeed, ends_as_declared, has_outputs_of_declared_types, leaves_inputs_unchanged,
    uses_only_declared_parts, leaves_tool_as_declared, leaves_arm_at_rest,
)  # fmt: skip
"""All rules."""


@dataclass(frozen=True)
class Check:
    """One rule applied to one skill; a call raises `AssertionError` if the skill violates the rule.

    Attributes:
        runs: The test runs of the skill.
        rule: The rule.
    """

    runs: SkillRuns
    rule: Rule

    def __str__(self) -> str:
        return f"{self.runs.name}.{self.rule.__name__}"

    def find_problems(self) -> list[str]:
        """Return the first violations of the rule, or the reason why the skill cannot be tested."""
        try:
            return list(islice(self.rule(self.runs), MAX_PROBLEMS))
        except NotTestable as error:
            return [f"{self.runs.name} cannot be tested: {error}"]

    def __call__(self) -> None:
        """Run the check.

        Raises:
            AssertionError: The skill violates the rule, or cannot be tested.
        """
        problems = self.find_problems()
        assert not problems, "\n".join((f"{self.rule.__doc__} Violated:", *problems))


def list_conformance_checks(
    skill: type[Skill], arrange: Arrange = lambda _: {}, name: str = ""
) -> list[Check]:
    """Return one check per rule for a skill; the skill is run only when a check is called.

    Args:
        skill: Class of the skill.
        arrange: Function that gets the `SkillScene` of each run. The function may change the scene, and
            returns values of params and inputs by name; missing required values are generated.
        name: Name under which the skill is installed; "": the name of the class.
    """
    runs = SkillRuns(name or skill.__name__, skill, arrange)
    return [Check(runs, rule) for rule in RULES]
