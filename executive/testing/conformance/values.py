"""Values for the params and inputs of a skill, made up from their declarations."""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping
from typing import Any, Union, get_args, get_origin

from executive.messages import Bin, Detection, Detections, Frame, ObjectClass, Target
from executive.mission.model.port_types import called, element_of
from executive.skill import Param, Port
from executive.testing.conformance.stage import Stage

SMALL_NUMBER = 0.1
"""A number that is made up, where its bounds allow it; in seconds, this is soon over."""


class CannotMakeUp(Exception):
    """Nothing is known that an input could be; the text says which and of what type."""


def made_up(declared: Param | Port, stage: Stage) -> Any:
    """Return a value that a param, or an input, may have.

    Raises:
        CannotMakeUp: It is of a type that no cell has and no mission can say, or a plain input that does not
            say what it names.
    """
    try:
        return (
            _param(declared, stage) if isinstance(declared, Param) else _input(declared.type, declared, stage)
        )
    except CannotMakeUp:
        kind = "param" if isinstance(declared, Param) else "input"
        raise CannotMakeUp(f'the {kind} "{declared.name}" ({called(declared.type)})') from None


def other_values(param: Param, stage: Stage) -> Iterator[Any]:
    """Yield every further value of a param that makes a skill do something else: choices, names, truths."""
    names = _names(stage)
    values = [False, True] if param.type is bool else list(param.choices or ())
    values += [names[param.refers]] if param.refers in names else []
    yield from (value for value in values if value != param.default)


def _names(stage: Stage) -> Mapping[str, str]:
    """Return the name of something on the stage by its kind."""
    fake = stage.cell
    label = fake.ledger.label(stage.item)
    return {
        "item": stage.item,
        "class": label,
        "bin": fake.routes[label][0],
        "detector": next(iter(fake.detectors)),
        "pose": list(fake.arm.poses)[-1],
    }


def _param(param: Param, stage: Stage) -> Any:
    if param.choices:
        return param.choices[0]
    if param.refers:
        return _name(param, stage)
    if param.type is str:
        return f"some {param.name}"
    if param.type is bool:
        return False
    if param.type not in (int, float):
        raise CannotMakeUp
    number = 1 if param.type is int else SMALL_NUMBER
    least = number if param.ge is None else max(number, param.ge)
    return param.type(least if param.le is None else min(least, param.le))


def _name(declared: Param | Port, stage: Stage) -> str:
    names = _names(stage)
    if declared.refers not in names:
        raise CannotMakeUp
    return names[declared.refers]


def _input(kind: Any, port: Port, stage: Stage) -> Any:
    """Return something on the stage of a type."""
    if kind is str:
        return _name(port, stage)
    if get_origin(kind) in (Union, types.UnionType):
        return _input(get_args(kind)[0], port, stage)
    cell, detections = stage.cell.cell, stage.detections
    there: Mapping[Any, Any] = {
        Target: stage.targets[0],
        Detections: detections,
        Detection: detections.found[0],
        Frame: detections.frame,
        Bin: next(iter(cell.bins.values())),
        ObjectClass: next(iter(cell.classes.values())),
    }
    if kind in there:
        return there[kind]
    element = None if kind is Any else element_of(kind)
    if element is None:
        raise CannotMakeUp
    return list(stage.targets) if element is Target else [_input(element, port, stage)]
