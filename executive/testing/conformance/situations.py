"""The situations in which a skill is tried, and the values that it is given there."""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Union, get_args, get_origin

from executive.cell.detection import Detections
from executive.cell.objects import Target
from executive.mission.model.port_types import describe_type
from executive.skill import ANY, EMPTY, HOLDING, Direction, Param, Port, Skill
from executive.testing.conformance.stage import Stage, set_up

Arrange = Callable[[Stage], Mapping[str, Any]]
"""Changes a stage for a skill and returns values for some of its params and inputs."""

SMALL_NUMBER = 0.1
"""A number that is made up, where its bounds allow it; in seconds, this is soon over."""

_HOLDING: Mapping[Any, tuple[bool, ...]] = {EMPTY: (False,), HOLDING: (True,), ANY: (False, True)}
_NAMES = {False: "with an empty tool", True: "with an item in the tool"}


class NotTried(Exception):
    """A check cannot be made; the text says why."""


class NotArranged(NotTried):
    """A skill cannot be tried, because nobody knows what to give it; the text says what to do."""


@dataclass(frozen=True)
class Situation:
    """One way to begin.

    Attributes:
        name: Its name, for a sentence: `with an empty tool`.
        holding: The tool holds an object.
        params: Params that differ from their defaults.
        has_all_inputs: Inputs that may be left out are given, too.
    """

    name: str
    holding: bool
    params: Mapping[str, Any] = field(default_factory=dict)
    has_all_inputs: bool = False


def situations(skill: type[Skill], arrange: Arrange) -> Iterator[Situation]:
    """Yield the situations in which a skill is tried.

    With the tool as the skill needs it, or both empty and not where it needs neither; with defaults alone,
    with all its inputs, and with every other choice of a param that its author does not give.

    Raises:
        NotArranged: It does not say what it needs of the tool, or a value for it cannot be made up.
    """
    state = skill.tool_state
    if not isinstance(state, tuple) or not state or state[0] not in _HOLDING:
        raise NotArranged(f"its tool_state is {state!r}; it must begin with ANY, EMPTY or HOLDING")
    first = _HOLDING[state[0]][0]
    for holding in _HOLDING[state[0]]:
        yield Situation(_NAMES[holding], holding)
    if any(not port.required for port in _inputs(skill)):
        yield Situation(f"{_NAMES[first]} and every input given", first, has_all_inputs=True)
    stage, values = begin(skill, Situation("", first), arrange)
    for param in skill.params.values():
        for value in () if param.name in values else _choices(param, stage):
            yield Situation(f"{_NAMES[first]} and {param.name}: {value}", first, {param.name: value})


def begin(skill: type[Skill], situation: Situation, arrange: Arrange) -> tuple[Stage, dict[str, Any]]:
    """Return a fresh stage and the values with which a skill starts there.

    Raises:
        NotArranged: A value that the skill needs is given by nobody.
    """
    stage = set_up(skill, holding=situation.holding)
    try:
        values = {**situation.params, **arrange(stage)}
    except Exception as error:
        raise NotArranged(f"what arranges it raised {type(error).__name__}: {error}") from error
    declarations: list[Param | Port] = [*skill.params.values(), *_inputs(skill)]
    missing = []
    for declared in declarations:
        is_wanted = declared.required or (situation.has_all_inputs and isinstance(declared, Port))
        if declared.name in values or not is_wanted:
            continue
        if (value := _made_up(declared, stage)) is not None:
            values[declared.name] = value
        elif declared.required:
            missing.append(declared)
    if missing:
        told = " and ".join(f'"{declared.name}" ({describe_type(declared.type)})' for declared in missing)
        given = ", ".join(f'"{declared.name}": ...' for declared in missing)
        raise NotArranged(
            f"no value can be made up for {told}. Give it in a test: "
            f"conformance({skill.__name__}, lambda stage: {{{given}}}), as skills/README.md shows."
        )
    return stage, values


def _choices(param: Param, stage: Stage) -> list[Any]:
    """Return the further values of a param that make a skill do something else: choices, names, truths."""
    values = [False, True] if param.type is bool else list(param.choices or ())
    values += [_named(param.refers, stage)] if param.refers else []
    return [value for value in values if value not in (param.default, None)]


def _made_up(declared: Param | Port, stage: Stage) -> Any:
    """Return a value that a param, or an input, may have; None if nothing is known that it could be."""
    if isinstance(declared, Port):
        return _on_stage(declared.type, declared.refers, stage)
    if declared.choices:
        return declared.choices[0]
    if declared.refers:
        return _named(declared.refers, stage)
    if declared.type not in (int, float):
        return {str: f"some {declared.name}", bool: False}.get(declared.type)
    number = 1 if declared.type is int else SMALL_NUMBER
    least = number if declared.ge is None else max(number, declared.ge)
    return declared.type(least if declared.le is None else min(least, declared.le))


def _on_stage(kind: Any, refers: str, stage: Stage) -> Any:
    """Return something on the stage of a type, or None."""
    if kind is str:
        return _named(refers, stage)
    if get_origin(kind) in (Union, types.UnionType):
        return _on_stage(get_args(kind)[0], refers, stage)
    if kind == list[Target]:
        return list(stage.targets)
    return {Target: stage.targets[0], Detections: stage.detections}.get(kind)


def _named(refers: str, stage: Stage) -> str | None:
    """Return the name of something on the stage, or None."""
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


def _inputs(skill: type[Skill]) -> list[Port]:
    return [port for port in skill.ports.values() if port.direction is Direction.IN]
