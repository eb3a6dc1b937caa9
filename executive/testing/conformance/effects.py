"""What a skill changes: its outputs, and nothing else that it has not declared."""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping
from typing import Any, Union, get_args, get_origin

from executive.mission.model.port_types import called, element_of
from executive.skill import Direction, Port
from executive.testing.conformance.case import Case

_USED = {
    "arm.start": "arm",
    "arm.stop": "arm",
    "tool.open": "tool",
    "tool.close": "tool",
    "camera.capture": "camera",
}
_SENSED = ("camera.capture", "operator.ask")


def outputs_set(case: Case) -> Iterator[str]:
    """When it succeeds it has set every output."""
    for rehearsal in case.ended:
        missing = [port.name for port in _outputs(case) if port.name not in rehearsal.outputs]
        if rehearsal.ending.status == "SUCCESS" and missing:
            yield (
                f"{rehearsal.where} {case.name} succeeded without setting {', '.join(missing)}. "
                "Set every output before run returns, or fail with a reason."
            )


def outputs_fit(case: Case) -> Iterator[str]:
    """Every output is of the type that it declares, and names what there is."""
    for rehearsal in case.ended:
        for port in _outputs(case):
            if rehearsal.ending.status != "SUCCESS" or port.name not in rehearsal.outputs:
                continue
            value = rehearsal.outputs[port.name]
            where = f"{rehearsal.where} {case.name}.{port.name} is {_shown(value)}"
            if not _is_a(value, port.type):
                yield f"{where}, not {called(port.type)}. Set what it declares, or declare what it is."
            elif wrong := [name for name in _names(value, port) if name not in rehearsal.names[port.refers]]:
                known = ", ".join(rehearsal.names[port.refers]) or "none"
                yield f'{where}, but there is no {port.refers} "{wrong[0]}". There are: {known}.'


def writes_only_outputs(case: Case) -> Iterator[str]:
    """It sets no attribute of itself that is neither an output nor private."""
    for rehearsal in case.ended:
        for name in rehearsal.written:
            yield (
                f"{rehearsal.where} it set self.{name}, which is no output. "
                f"Declare it as Out[...], call it _{name}, or make it a local name."
            )
        for name in rehearsal.rebound:
            yield (
                f"{rehearsal.where} it set self.{name} anew, which was given to it. "
                "Params and inputs are read only; take a local name."
            )


def inputs_unchanged(case: Case) -> Iterator[str]:
    """Its params and inputs are afterwards what they were."""
    for rehearsal in case.ended:
        for name in rehearsal.mutated:
            yield (
                f"{rehearsal.where} it changed what self.{name} holds. "
                "Others read the same value after it: work on a copy."
            )


def uses_only_what_it_declares(case: Case) -> Iterator[str]:
    """It commands only what it says it uses, moves only if it moves, and senses only if it senses."""
    skill = case.skill
    for name in dict.fromkeys(call.name for rehearsal in case.ended for call in rehearsal.calls):
        part = _USED.get(name)
        if part is not None and part not in skill.uses:
            yield f'{case.name} calls cell.{name} and does not use the {part}. Add "{part}" to uses.'
        if name == "arm.start" and not skill.moves:
            yield f"{case.name} calls cell.{name} and does not say that it moves. Add moves = True."
        if name in _SENSED and not skill.senses:
            yield f"{case.name} calls cell.{name} and does not say that it senses. Add senses = True."


def moves_if_it_says_so(case: Case) -> Iterator[str]:
    """Where it says that it moves and succeeds at all, it starts the arm in one situation at least."""
    succeeds = any(rehearsal.ending.status == "SUCCESS" for rehearsal in case.ended)
    if case.skill.moves and succeeds and not any(rehearsal.moved for rehearsal in case.ended):
        yield (
            f"{case.name} says that it moves, and succeeds without starting the arm in any situation. "
            'Write "yield from" before follow or carry of executive.moving, leave moves out, or arrange a '
            f"stage on which it moves: conformance({case.skill.__name__}, lambda stage: ...), as "
            "skills/README.md shows."
        )


def _outputs(case: Case) -> list[Port]:
    return [port for port in case.skill.ports.values() if port.direction is Direction.OUT]


def _is_a(value: Any, declared: Any) -> bool:
    """Tell whether a value is of a declared type, element by element."""
    if declared is Any:
        return True
    origin = get_origin(declared)
    if origin in (Union, types.UnionType):
        return any(_is_a(value, part) for part in get_args(declared))
    if declared is float:
        return isinstance(value, float | int)
    kind = origin or declared
    if isinstance(kind, type) and not isinstance(value, kind):
        return False
    element = None if isinstance(value, str | Mapping) else element_of(declared)
    return element is None or all(_is_a(one, element) for one in value)


def _names(value: Any, port: Port) -> list[str]:
    """Return the names of the cell that an output says."""
    if port.refers not in ("item", "bin", "class"):
        return []
    return [value] if isinstance(value, str) else [name for name in value or () if isinstance(name, str)]


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"a {type(value).__name__}"
