"""Checks of how a skill behaves in every situation, under every fault, and halted at any moment."""

from __future__ import annotations

import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Union, get_args, get_origin

from executive.mission.model.port_types import describe_type, find_element_type
from executive.skill import ANY, EMPTY, HOLDING, ToolState
from executive.testing.conformance.declarations import HALT
from executive.testing.conformance.rehearsal import MAX_TIME, SkillRehearsal, is_same
from executive.testing.conformance.situations import NotArranged
from executive.testing.conformance.skill_runs import GotStuck, SkillRuns

MAX_TICK_TIME = 0.05
"""Computing time that a tick may take [s]; a control step is 1/240 s of the run's time."""

_ACTS = ("arm.start", "arm.stop", "tool.open", "tool.close", "camera.capture")
"""Calls that act by a part of the cell, which the skill must use."""
_SENSES = ("camera.capture", "operator.ask")
"""Calls by which a skill takes in something new."""


def arranged(runs: SkillRuns) -> Iterator[str]:
    """It can be tried, and it succeeds in one situation at least."""
    try:
        _ = runs.situations
    except NotArranged as problem:
        yield f"{runs.name} cannot be tried: {problem}"
        return
    if not any(rehearsal.status == "SUCCESS" for rehearsal in runs.complete_runs):
        yield (
            f"{runs.name} never succeeded; {runs.complete_runs[0].end}. Arrange a stage on which it can: "
            f"conformance({runs.skill.__name__}, lambda stage: ...), as skills/README.md shows."
        )


def comes_to_an_end(runs: SkillRuns) -> Iterator[str]:
    """Every tick comes back, and it ends within a minute on the run's clock."""
    try:
        _ = runs.complete_runs, runs.halted_runs
    except GotStuck as problem:
        yield str(problem)
        return
    for rehearsal in runs.complete_runs:
        if rehearsal.status == "RUNNING":
            yield (
                f"{rehearsal.where} {runs.name} was not over after {MAX_TIME:g} s. "
                "Whatever it waits for may never come: wait for so long at most, then fail with a reason."
            )


def ends_as_declared(runs: SkillRuns) -> Iterator[str]:
    """Whatever goes wrong, it succeeds with all outputs, or fails with a declared reason and a sentence."""
    for rehearsal in runs.complete_runs:
        where = f"{rehearsal.where} at tick {rehearsal.ticks}"
        if rehearsal.status == "FAULT":
            yield (
                f"{where} {rehearsal.message}. That is a fault, which ends the run: fail with a declared "
                "reason where this can happen, or mend it."
            )
        elif rehearsal.status == "FAILURE" and not rehearsal.message.strip():
            yield (
                f'{where} it failed with "{rehearsal.reason}" and no sentence. '
                "Say what happened, with the numbers: it is all that the operator will read."
            )


def outputs_fit(runs: SkillRuns) -> Iterator[str]:
    """Every output is of the type that it declares."""
    for rehearsal in runs.complete_runs:
        for name, value in rehearsal.outputs.items():
            declared = runs.skill.ports[name].type
            if not _is_of(value, declared):
                yield (
                    f"{rehearsal.where} {runs.name}.{name} is of the type {type(value).__name__}, not "
                    f"{describe_type(declared)}. Set what it declares, or declare what it is."
                )


def inputs_unchanged(runs: SkillRuns) -> Iterator[str]:
    """Its params and inputs are afterwards what they were."""
    for rehearsal in runs.complete_runs:
        for name in rehearsal.changed:
            yield (
                f"{rehearsal.where} it changed what self.{name} holds. "
                "Others read the same value after it: work on a copy."
            )


def uses_only_what_it_declares(runs: SkillRuns) -> Iterator[str]:
    """It commands only what it says it uses, moves only if it moves, and senses only if it senses."""
    skill = runs.skill
    for name in dict.fromkeys(call.name for rehearsal in runs.complete_runs for call in rehearsal.calls):
        part = name.partition(".")[0]
        if name in _ACTS and part not in skill.uses:
            yield f'{runs.name} calls cell.{name} and does not use the {part}. Add "{part}" to uses.'
        if name == "arm.start" and not skill.moves:
            yield f"{runs.name} calls cell.{name} and does not say that it moves. Add moves = True."
        if name in _SENSES and not skill.senses:
            yield f"{runs.name} calls cell.{name} and does not say that it senses. Add senses = True."


def tool_left_as_declared(runs: SkillRuns) -> Iterator[str]:
    """After success, every failure and a halt at any tick the tool holds what is declared."""
    for rehearsal in _first_wrong(
        [*runs.complete_runs, *runs.halted_runs], lambda one: bool(_tool_fault(runs, one))
    ):
        yield _tool_fault(runs, rehearsal)


def arm_left_at_rest(runs: SkillRuns) -> Iterator[str]:
    """Where it started the arm, the arm is at rest when it ends or is halted."""
    for rehearsal in _first_wrong([*runs.complete_runs, *runs.halted_runs], _leaves_arm_moving):
        yield (
            f"{rehearsal.end}, and the arm still moves. "
            "Call cell.arm.stop() in finally, or use follow of executive.manipulation.motions."
        )


def halts_at_once(runs: SkillRuns) -> Iterator[str]:
    """Halted at any tick, it ends there and then, and raises nothing."""
    for rehearsal in _first_wrong(runs.halted_runs, lambda one: one.status == "FAULT"):
        yield (
            f"{rehearsal.where} at tick {rehearsal.ticks} {rehearsal.message}. "
            "What finally does must be done at once and cannot fail."
        )


def repeats_itself(runs: SkillRuns) -> Iterator[str]:
    """In the same situation it makes the same calls at the same ticks and ends alike."""
    for _, first, second in runs.repeated_runs:
        if difference := _difference(first, second):
            yield (
                f"{first.where}, twice the same, {difference}. "
                "Nothing may depend on chance, on time, or on an earlier run; a seed may be a param."
            )


def ticks_are_quick(runs: SkillRuns) -> Iterator[str]:
    """No tick computes for longer than 50 ms, the quicker of two runs counted."""
    for _, first, second in runs.repeated_runs:
        least = [min(pair) for pair in zip(first.durations, second.durations, strict=False)]
        longest = max(least, default=0.0)
        if longest > MAX_TICK_TIME:
            yield (
                f"{first.where} it computed for {longest * 1000:.0f} ms in tick {least.index(longest)}, "
                "which holds up the arm. Spread the work over ticks by yield, or let a detector do it."
            )


def _difference(one: SkillRehearsal, other: SkillRehearsal) -> str:
    """Return how two runs differ, or ""."""
    for first, second in zip(one.calls, other.calls, strict=False):
        if (first.tick, first.name) != (second.tick, second.name):
            return f"it called {first.name} at tick {first.tick} and then {second.name} at tick {second.tick}"
        if not is_same(first.arguments, second.arguments):
            return f"it called {first.name} at tick {first.tick} with different arguments"
    if (one.ticks, one.status) != (other.ticks, other.status):
        return (
            f"it ended as {one.status} after {one.ticks} ticks and then as {other.status} after {other.ticks}"
        )
    return "" if is_same(one.outputs, other.outputs) else "it set its outputs to different values"


def _first_wrong(
    rehearsals: Iterable[SkillRehearsal], is_wrong: Callable[[SkillRehearsal], bool]
) -> Iterable[SkillRehearsal]:
    """Return the first run of each situation that is wrong: one halt is as good as the next."""
    found: dict[str, SkillRehearsal] = {}
    for rehearsal in filter(is_wrong, rehearsals):
        found.setdefault(rehearsal.where, rehearsal)
    return found.values()


def _leaves_arm_moving(rehearsal: SkillRehearsal) -> bool:
    has_ended = rehearsal.status in ("SUCCESS", "FAILURE", "HALTED")
    return has_ended and rehearsal.has_moved and not rehearsal.at_rest


def _tool_fault(runs: SkillRuns, rehearsal: SkillRehearsal) -> str:
    """Return what is wrong with the tool at the end of a run, or ""."""
    if rehearsal.status not in ("SUCCESS", "FAILURE", "HALTED"):
        return ""
    wanted, why = _wanted_tool(runs, rehearsal)
    if wanted is not ANY and (wanted is HOLDING) != rehearsal.holds:
        holds = "holds something" if rehearsal.holds else "is empty"
        should = "hold something" if wanted is HOLDING else "be empty"
        return (
            f"{rehearsal.end}, and the tool {holds}. It should {should}: {why}. "
            "Leave the tool as declared, or declare how it is left."
        )
    if rehearsal.holds and not rehearsal.is_known:
        return (
            f"{rehearsal.end}, and the tool holds an object that the ledger does not know of. "
            "Tell it by cell.ledger.record_grasp, or open the tool in finally."
        )
    return ""


def _wanted_tool(runs: SkillRuns, rehearsal: SkillRehearsal) -> tuple[ToolState, str]:
    """Return what the tool must hold at the end of a run, and why."""
    before = HOLDING if rehearsal.held else EMPTY
    if rehearsal.status == "SUCCESS":
        after = runs.skill.tool_state[1]
        return (before, "tool_state says as before") if after is ANY else (after, "tool_state says so")
    name = HALT if rehearsal.status == "HALTED" else rehearsal.reason
    if name in runs.skill.tool_left:
        return runs.skill.tool_left[name], f'tool_left says so of "{name}"'
    return before, f'as before, for tool_left says nothing of "{name}"'


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
    element = None if isinstance(value, str | Mapping) else find_element_type(declared)
    return element is None or all(_is_of(one, element) for one in value)
