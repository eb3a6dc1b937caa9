"""Values for the params and inputs of a skill, made up from what it declares of them."""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import Any, Union, get_args, get_origin

from executive.messages import Bin, Detection, Detections, Frame, ObjectClass, Target
from executive.mission.model.port_types import called, element_of
from executive.skill import Param, Port
from executive.testing.conformance.stage import Stage

FEW = 0.1
"""What a number is made up to be, where its bounds allow it; in seconds, this is soon over."""


class CannotMakeUp(Exception):
    """Nothing is known that an input could be; the text says which and of what type."""


def made_up(declared: Param | Port, stage: Stage) -> Any:
    """Return a value that a param, or an input, may have.

    An input is something on the stage. Any value that a param allows is as good as another.

    Raises:
        CannotMakeUp: It is of a type that no cell has and no mission can say, or a plain input that does not
            say what it names.
    """
    try:
        if isinstance(declared, Param):
            return _param(declared, stage)
        return _input(declared.type, declared.refers, stage)
    except CannotMakeUp:
        kind = "param" if isinstance(declared, Param) else "input"
        raise CannotMakeUp(f'the {kind} "{declared.name}" ({called(declared.type)})') from None


def others(param: Param, stage: Stage) -> Iterator[Any]:
    """Yield every further value of a param that makes a skill do something else: choices, names, truths."""
    values = list(param.choices or ())
    if param.type is bool:
        values = [False, True]
    elif param.refers:
        with suppress(CannotMakeUp):
            values.append(named(param.refers, stage))
    yield from (value for value in values if value != param.default)


def named(refers: str, stage: Stage) -> str:
    """Return the name of something on the stage.

    Raises:
        CannotMakeUp: It has nothing of this sort.
    """
    fake = stage.cell
    label = fake.ledger.label(stage.item)
    names = {
        "item": stage.item,
        "class": label,
        "bin": fake.routes[label][0],
        "detector": next(iter(fake.detectors)),
        "pose": list(fake.arm.poses)[-1],
    }
    if refers not in names:
        raise CannotMakeUp
    return names[refers]


def _param(param: Param, stage: Stage) -> Any:
    if param.choices:
        return param.choices[0]
    if param.refers:
        return named(param.refers, stage)
    makers: Mapping[Any, Callable[[Param], Any]] = {bool: _no, int: _whole, float: _number, str: _text}
    if param.type not in makers:
        raise CannotMakeUp
    return makers[param.type](param)


def _input(declared: Any, refers: str, stage: Stage) -> Any:
    if declared is str and refers:
        return named(refers, stage)
    if get_origin(declared) in (Union, types.UnionType):
        return _first(get_args(declared), refers, stage)
    cell, detections = stage.cell.cell, stage.detections
    there: Mapping[Any, Any] = {
        Target: stage.targets[0],
        Detections: detections,
        Detection: detections.found[0],
        Frame: detections.frame,
        Bin: next(iter(cell.bins.values())),
        ObjectClass: next(iter(cell.classes.values())),
    }
    if declared in there:
        return there[declared]
    element = None if declared is Any else element_of(declared)
    if element is None:
        raise CannotMakeUp
    values = stage.targets if element is Target else [_input(element, refers, stage)]
    return tuple(values) if get_origin(declared) is tuple else list(values)


def _first(kinds: tuple[Any, ...], refers: str, stage: Stage) -> Any:
    for kind in kinds:
        try:
            return _input(kind, refers, stage)
        except CannotMakeUp:
            continue
    raise CannotMakeUp


def _no(param: Param) -> bool:
    del param
    return False


def _whole(param: Param) -> int:
    return int(_within(param, 1))


def _number(param: Param) -> float:
    return float(_within(param, FEW))


def _within(param: Param, wanted: float) -> float:
    least = wanted if param.ge is None else max(wanted, param.ge)
    return least if param.le is None else min(least, param.le)


def _text(param: Param) -> str:
    return f"some {param.name}"
