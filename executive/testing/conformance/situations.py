"""Situations in which a skill is tried, and the values of its params and inputs."""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Union, get_args, get_origin

from executive.cell.detection import Detections
from executive.cell.objects import Target
from executive.mission.model.port_types import describe_type
from executive.skill import ANY, EMPTY, HOLDING, Param, Port, Skill
from executive.testing.conformance.stage import Stage, list_inputs, set_up

Arrange = Callable[[Stage], Mapping[str, Any]]
"""Changes a stage for a skill and returns values for some of its params and inputs."""

SMALL_NUMBER = 0.1
"""A generated number, if the bounds of the param allow it; small, because it may be a duration [s]."""

_START_STATES: Mapping[Any, tuple[bool, ...]] = {EMPTY: (False,), HOLDING: (True,), ANY: (False, True)}
_TOOL_TEXTS = {False: "with an empty tool", True: "with an item in the tool"}


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
