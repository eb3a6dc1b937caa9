"""Checks of how a skill behaves in every situation, under every adversity, and halted at any moment."""

from __future__ import annotations

import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Union, get_args, get_origin

from executive.mission.model.port_types import called, element_of
from executive.skill import ANY, EMPTY, HOLDING, Port, ToolState
from executive.testing.conformance.case import Case, GotStuck
from executive.testing.conformance.declarations import HALT
from executive.testing.conformance.rehearsal import MAX_TIME, Rehearsal
from executive.testing.conformance.same import is_same
from executive.testing.conformance.situations import NotArranged
from executive.testing.fake_cell import FakeCell, bare_table

MAX_TICK_TIME = 0.05
"""Computing time that a tick may take [s]; a control step is 1/240 s of the run's time."""

_PARTS: Mapping[str, str] = {
    "arm.start": "arm",
    "arm.stop": "arm",
    "tool.open": "tool",
    "tool.close": "tool",
    "camera.capture": "camera",
}
"""Part that a skill uses by a call."""
_SENSES = ("camera.capture", "operator.ask")
"""Calls by which a skill takes in something new."""


def arranged(case: Case) -> Iterator[str]:
    """It can be tried, and it succeeds in one situation at least."""
    try:
        _ = case.scenes
    except NotArranged as problem:
        yield f"{case.name} cannot be tried: {problem}"
        return
    if not any(rehearsal.ending.status == "SUCCESS" for rehearsal in case.ended):
        yield (
            f"{case.name} never succeeded; {case.plain[0].when}. "
            f"Arrange a stage on which it can: conformance({case.skill.__name__}, lambda stage: ...), "
            "as skills/README.md shows."
        )


def comes_to_an_end(case: Case) -> Iterator[str]:
    """Every tick comes back, and it ends within a minute on the run's clock."""
    try:
        _ = case.ended, case.halted
    except GotStuck as problem:
        yield str(problem)
        return
    for rehearsal in case.ended:
        if rehearsal.ending.status == "RUNNING":
            yield (
                f"{rehearsal.where} {case.name} was not over after {MAX_TIME:g} s. "
                "Whatever it waits for may never come: wait for so long at most, then fail with a reason."
            )


def ends_as_declared(case: Case) -> Iterator[str]:
    """Whatever goes wrong, it sets its outputs and succeeds, or fails with a declared reason and a sentence."""
    for rehearsal in case.ended:
        where, ending = f"{rehearsal.where} at tick {rehearsal.ticks}", rehearsal.ending
        if ending.status == "FAULT":
            yield (
                f"{where} {ending.message}. That is a fault, which ends the run: fail with a declared reason "
                "where this can happen, or mend it."
            )
        elif ending.status == "FAILURE" and not ending.message.strip():
            yield (
                f'{where} it failed with "{ending.reason}" and no sentence. '
                "Say what happened, with the numbers: it is all that the operator will read."
            )


def outputs_fit(case: Case) -> Iterator[str]:
    """Every output is of the type that it declares, and names what there is."""
    for rehearsal in case.ended:
        for name, value in rehearsal.outputs.items():
            port = case.skill.ports[name]
            where = f"{rehearsal.where} {case.name}.{name} is {_shown(value)}"
            if not _is_of(value, port.type):
                yield f"{where}, not {called(port.type)}. Set what it declares, or declare what it is."
            elif wrong := [one for one in _names_in(value, port) if one not in rehearsal.names[port.refers]]:
                known = ", ".join(rehearsal.names[port.refers]) or "none"
                yield f'{where}, but there is no {port.refers} "{wrong[0]}". There are: {known}.'


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
        part = _PARTS.get(name)
        if part is not None and part not in skill.uses:
            yield f'{case.name} calls cell.{name} and does not use the {part}. Add "{part}" to uses.'
        if name == "arm.start" and not skill.moves:
            yield f"{case.name} calls cell.{name} and does not say that it moves. Add moves = True."
        if name in _SENSES and not skill.senses:
            yield f"{case.name} calls cell.{name} and does not say that it senses. Add senses = True."


def tool_left_as_declared(case: Case) -> Iterator[str]:
    """After success, every failure and a halt at any tick the tool holds what is declared."""
    for rehearsal in _first_wrong([*case.ended, *case.halted], lambda one: bool(_tool_fault(case, one))):
        yield _tool_fault(case, rehearsal)


def arm_left_at_rest(case: Case) -> Iterator[str]:
    """Where it started the arm, the arm is at rest when it ends or is halted."""
    for rehearsal in _first_wrong([*case.ended, *case.halted], _leaves_arm_moving):
        yield (
            f"{rehearsal.when}, and the arm still moves. "
            "Call cell.arm.stop() in finally, or use follow of executive.moving."
        )


def halts_at_once(case: Case) -> Iterator[str]:
    """Halted at any tick, it ends there and then, and raises nothing."""
    for rehearsal in _first_wrong(case.halted, lambda one: one.ending.status == "FAULT"):
        yield (
            f"{rehearsal.where} at tick {rehearsal.ticks} {rehearsal.ending.message}. "
            "What finally does must be done at once and cannot fail."
        )


def repeats_itself(case: Case) -> Iterator[str]:
    """In the same situation it makes the same calls at the same ticks and ends alike."""
    for first, second in case.twice:
        if difference := _difference(first, second):
            yield (
                f"{first.where}, twice the same, {difference}. Nothing may depend on chance, on time, on an "
                "object's address, or on what an earlier run has left; a seed may be a param."
            )


def ticks_are_quick(case: Case) -> Iterator[str]:
    """No tick computes for longer than 50 ms, the quicker of two runs counted."""
    for first, second in case.twice:
        least = [min(pair) for pair in zip(first.durations, second.durations, strict=False)]
        if (longest := max(least)) > MAX_TICK_TIME:
            yield (
                f"{first.where} it computed for {longest * 1000:.0f} ms in tick {least.index(longest)}, which "
                "holds up the arm. Spread the work over ticks by yield, or let a detector do it beside."
            )


def never_sooner_than_shortest(case: Case) -> Iterator[str]:
    """The time that shortest promises is no longer than any success took."""
    least = FakeCell.least_times(bare_table())
    for rehearsal in case.ended:
        given = _given_by_mission(case, rehearsal)
        try:
            seconds = case.skill.shortest(least, given)
        except Exception as error:
            yield (
                f"{case.name}.shortest raises {type(error).__name__}: {error}, asked with no more than a "
                f"mission may say ({', '.join(given) or 'nothing'}). Return 0 where nothing is known."
            )
            return
        if rehearsal.ending.status == "SUCCESS" and seconds > rehearsal.seconds + 1e-9:
            yield (
                f"{rehearsal.where} it took {rehearsal.seconds:.3f} s, less than the {seconds:.3f} s "
                "that shortest promises. executive check refuses timeouts by it: return a bound that "
                "holds on every cell."
            )


def _first_wrong(
    rehearsals: Iterable[Rehearsal], is_wrong: Callable[[Rehearsal], bool]
) -> Iterable[Rehearsal]:
    """Return the first run of each situation that is wrong: one halt is as good as the next."""
    found: dict[str, Rehearsal] = {}
    for rehearsal in filter(is_wrong, rehearsals):
        found.setdefault(rehearsal.where, rehearsal)
    return found.values()


def _leaves_arm_moving(rehearsal: Rehearsal) -> bool:
    has_ended = rehearsal.ending.status in ("SUCCESS", "FAILURE", "HALTED")
    return has_ended and rehearsal.moved and not rehearsal.at_rest


def _tool_fault(case: Case, rehearsal: Rehearsal) -> str:
    """Return what is wrong with the tool at the end of a run, or ""."""
    if rehearsal.ending.status not in ("SUCCESS", "FAILURE", "HALTED"):
        return ""
    wanted, why = _wanted_tool(case, rehearsal)
    if wanted is not ANY and (wanted is HOLDING) != rehearsal.holds:
        holds = "holds something" if rehearsal.holds else "is empty"
        should = "hold something" if wanted is HOLDING else "be empty"
        return (
            f"{rehearsal.when}, and the tool {holds}. It should {should}: {why}. "
            "Leave the tool as declared, or declare how it is left."
        )
    if rehearsal.holds and rehearsal.believed is None:
        return (
            f"{rehearsal.when}, and the tool holds an object that the ledger does not know of. "
            "Tell it by cell.ledger.held, or open the tool in finally."
        )
    return ""


def _wanted_tool(case: Case, rehearsal: Rehearsal) -> tuple[ToolState, str]:
    """Return what the tool must hold at the end of a run, and why."""
    before = HOLDING if rehearsal.held else EMPTY
    if rehearsal.ending.status == "SUCCESS":
        after = case.skill.tool_state[1]
        return (before, "tool_state says as before") if after is ANY else (after, "tool_state says so")
    name = HALT if rehearsal.ending.status == "HALTED" else rehearsal.ending.reason
    if name in case.skill.tool_left:
        return case.skill.tool_left[name], f'tool_left says so of "{name}"'
    return before, f'as before, for tool_left says nothing of "{name}"'


def _given_by_mission(case: Case, rehearsal: Rehearsal) -> dict[str, Any]:
    """Return what a mission would have given for a run: all params, and the inputs that no item is."""
    inputs = {name: port for name, port in case.skill.ports.items() if port.refers != "item"}
    known = {**case.skill.params, **inputs}
    return {**case.defaults, **{name: value for name, value in rehearsal.given.items() if name in known}}


def _is_of(value: Any, declared: Any) -> bool:
    """Return True if a value is of a declared type, element by element."""
    if declared is Any:
        return True
    origin = get_origin(declared)
    if origin in (Union, types.UnionType):
        return any(_is_of(value, part) for part in get_args(declared))
    if declared is float:
        return isinstance(value, float | int)
    kind = origin or declared
    if isinstance(kind, type) and not isinstance(value, kind):
        return False
    element = None if isinstance(value, str | Mapping) else element_of(declared)
    return element is None or all(_is_of(one, element) for one in value)


def _names_in(value: Any, port: Port) -> list[str]:
    """Return the names of the cell that an output says."""
    if port.refers not in ("item", "bin", "class"):
        return []
    return [value] if isinstance(value, str) else [name for name in value or () if isinstance(name, str)]


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"a {type(value).__name__}"


def _difference(one: Rehearsal, other: Rehearsal) -> str:
    """Return how two runs differ, or ""."""
    for first, second in zip(one.calls, other.calls, strict=False):
        if (first.tick, first.name) != (second.tick, second.name):
            return f"it called {first.name} at tick {first.tick} and then {second.name} at tick {second.tick}"
        if not is_same(first.arguments, second.arguments):
            return f"it called {first.name} at tick {first.tick} with different arguments"
    if (one.ticks, one.ending.status) != (other.ticks, other.ending.status):
        return f"{one.ending} after {one.ticks} ticks and then {other.ending} after {other.ticks}"
    unlike = [name for name in one.outputs if not is_same(one.outputs[name], other.outputs[name])]
    return f"it set {unlike[0]} to different values" if unlike else ""
