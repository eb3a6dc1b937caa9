"""Checks of a skill's runs in each situation, under each fault, and with a halt at any tick."""

from __future__ import annotations

import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Union, get_args, get_origin

from executive.mission.model.port_types import describe_type, find_element_type
from executive.skill import ANY, EMPTY, HOLDING, ToolState
from executive.testing.conformance.declarations import HALT
from executive.testing.conformance.rehearsal import MAX_TIME, SkillRehearsal, is_same
from executive.testing.conformance.situations import NotArranged
from executive.testing.conformance.skill_runs import SkillRuns, TickNotReturned

MAX_TICK_TIME = 0.05
"""Maximum computing time of a tick [s]; a control step is 1/240 s on the run's clock."""

_ACTIONS = ("arm.start", "arm.stop", "tool.open", "tool.close", "camera.capture")
"""Commands to a part of the cell, which must be in `uses`."""
_MEASUREMENTS = ("camera.capture", "operator.ask")
"""Calls that return new information, which require `senses`."""


def succeeds_somewhere(runs: SkillRuns) -> Iterator[str]:
    """The skill can be tried, and succeeds in at least one situation."""
    try:
        _ = runs.situations
    except NotArranged as problem:
        yield f"{runs.name} cannot be tried: {problem}"
        return
    if not any(rehearsal.status == "SUCCESS" for rehearsal in runs.complete_runs):
        yield (
            f"{runs.name} never succeeded; {runs.complete_runs[0].end}. "
            "Arrange a stage on which it succeeds: "
            f"conformance({runs.skill.__name__}, lambda stage: ...), as skills/README.md shows."
        )


def comes_to_an_end(runs: SkillRuns) -> Iterator[str]:
    """Each tick returns, and the skill ends within a minute on the run's clock."""
    try:
        _ = runs.complete_runs, runs.halted_runs
    except TickNotReturned as problem:
        yield str(problem)
        return
    for rehearsal in runs.complete_runs:
        if rehearsal.status == "RUNNING":
            yield (
                f"{rehearsal.where} {runs.name} was not over after {MAX_TIME:g} s. "
                "Limit the duration of each wait, and fail with a reason afterwards."
            )


def ends_as_declared(runs: SkillRuns) -> Iterator[str]:
    """Under each fault the skill succeeds with all outputs, or fails with a declared reason and a message."""
    for rehearsal in runs.complete_runs:
        where = f"{rehearsal.where} at tick {rehearsal.ticks}"
        if rehearsal.status == "FAULT":
            yield (
                f"{where} {rehearsal.message}. That is a fault, which ends the run: fail with a declared "
                "reason, or correct the code."
            )
        elif rehearsal.status == "FAILURE" and not rehearsal.message.strip():
            yield (
                f'{where} it failed with "{rehearsal.reason}" and no message. '
                "Write what happened, with numbers: the operator reads only this message."
            )


def outputs_fit(runs: SkillRuns) -> Iterator[str]:
    """Each output has its declared type."""
    for rehearsal in runs.complete_runs:
        for name, value in rehearsal.outputs.items():
            declared = runs.skill.ports[name].type
            if not _has_type(value, declared):
                yield (
                    f"{rehearsal.where} {runs.name}.{name} is of the type {type(value).__name__}, not "
                    f"{describe_type(declared)}. Set a value of this type, or change the declaration."
                )


def keeps_inputs(runs: SkillRuns) -> Iterator[str]:
    """The skill does not change its params and inputs."""
    for rehearsal in runs.complete_runs:
        for name in rehearsal.changed:
            yield (
                f"{rehearsal.where} it changed the value of self.{name}. "
                "Other nodes read the same value later: work on a copy."
            )


def uses_only_what_it_declares(runs: SkillRuns) -> Iterator[str]:
    """The skill commands only the parts in `uses`, moves only with `moves`, and senses only with `senses`."""
    skill = runs.skill
    for name in dict.fromkeys(call.name for rehearsal in runs.complete_runs for call in rehearsal.calls):
        part = name.partition(".")[0]
        if name in _ACTIONS and part not in skill.uses:
            yield f'{runs.name} calls cell.{name} and does not declare the {part}. Add "{part}" to uses.'
        if name == "arm.start" and not skill.moves:
            yield f"{runs.name} calls cell.{name} and does not declare that it moves. Add moves = True."
        if name in _MEASUREMENTS and not skill.senses:
            yield f"{runs.name} calls cell.{name} and does not declare that it senses. Add senses = True."


def leaves_tool_as_declared(runs: SkillRuns) -> Iterator[str]:
    """After success, each failure and a halt at any tick, the tool is in the declared state."""
    for rehearsal in _first_violations(
        [*runs.complete_runs, *runs.halted_runs], lambda rehearsal: bool(_tool_problem(runs, rehearsal))
    ):
        yield _tool_problem(runs, rehearsal)


def leaves_arm_at_rest(runs: SkillRuns) -> Iterator[str]:
    """If the skill started the arm, the arm is at rest after its end or a halt."""
    for rehearsal in _first_violations([*runs.complete_runs, *runs.halted_runs], _is_arm_left_moving):
        yield (
            f"{rehearsal.end}, and the arm still moves. "
            "Call cell.arm.stop() in finally, or use follow of executive.manipulation.motions."
        )


def halts_at_once(runs: SkillRuns) -> Iterator[str]:
    """A halt at any tick ends the skill in the same tick, without an exception."""
    for rehearsal in _first_violations(runs.halted_runs, lambda rehearsal: rehearsal.status == "FAULT"):
        yield (
            f"{rehearsal.where} at tick {rehearsal.ticks} {rehearsal.message}. "
            "The code in finally must take no control step and raise no exception."
        )


def repeats_itself(runs: SkillRuns) -> Iterator[str]:
    """In equal situations the skill makes the same calls at the same ticks and has the same end."""
    for _, first, second in runs.repeated_runs:
        if difference := _describe_difference(first, second):
            yield (
                f"{first.where}, in two equal runs, {difference}. "
                "The skill may not depend on chance, wall time or earlier runs; a seed may be a param."
            )


def ticks_are_quick(runs: SkillRuns) -> Iterator[str]:
    """No tick computes for longer than 50 ms in the faster of two runs."""
    for _, first, second in runs.repeated_runs:
        durations = list(map(min, first.durations, second.durations))
        longest = max(durations, default=0.0)
        if longest > MAX_TICK_TIME:
            yield (
                f"{first.where} it computed for {longest * 1000:.0f} ms in tick {durations.index(longest)}, "
                "which blocks the arm. Distribute the work over ticks by yield, or leave it to a detector."
            )


def _describe_difference(run: SkillRehearsal, other: SkillRehearsal) -> str:
    """Return the first difference between two runs, or ""."""
    for first, second in zip(run.calls, other.calls, strict=False):
        if (first.tick, first.name) != (second.tick, second.name):
            return f"it called {first.name} at tick {first.tick} and then {second.name} at tick {second.tick}"
        if not is_same(first.arguments, second.arguments):
            return f"it called {first.name} at tick {first.tick} with different arguments"
    if (run.ticks, run.status) != (other.ticks, other.status):
        return (
            f"it ended as {run.status} after {run.ticks} ticks and then as {other.status} after {other.ticks}"
        )
    return "" if is_same(run.outputs, other.outputs) else "it set its outputs to different values"


def _first_violations(
    rehearsals: Iterable[SkillRehearsal], is_violation: Callable[[SkillRehearsal], bool]
) -> Iterable[SkillRehearsal]:
    """Return the first run of each situation that violates a rule."""
    first: dict[str, SkillRehearsal] = {}
    for rehearsal in filter(is_violation, rehearsals):
        first.setdefault(rehearsal.where, rehearsal)
    return first.values()


def _is_arm_left_moving(rehearsal: SkillRehearsal) -> bool:
    has_ended = rehearsal.status in ("SUCCESS", "FAILURE", "HALTED")
    return has_ended and rehearsal.has_moved and not rehearsal.at_rest


def _tool_problem(runs: SkillRuns, rehearsal: SkillRehearsal) -> str:
    """Return the problem with the tool at the end of a run, or ""."""
    if rehearsal.status not in ("SUCCESS", "FAILURE", "HALTED"):
        return ""
    required, why = _required_tool_state(runs, rehearsal)
    if required is not ANY and (required is HOLDING) != rehearsal.holds:
        actual = "holds something" if rehearsal.holds else "is empty"
        should = "hold something" if required is HOLDING else "be empty"
        return (
            f"{rehearsal.end}, and the tool {actual}. It should {should}, {why}. "
            "Leave the tool in this state, or change the declaration."
        )
    if rehearsal.holds and not rehearsal.is_known:
        return (
            f"{rehearsal.end}, and the tool holds an object that the ledger does not know. "
            "Call cell.ledger.record_grasp, or open the tool in finally."
        )
    return ""


def _required_tool_state(runs: SkillRuns, rehearsal: SkillRehearsal) -> tuple[ToolState, str]:
    """Return the required state of the tool at the end of a run, and the reason."""
    before = HOLDING if rehearsal.held else EMPTY
    if rehearsal.status == "SUCCESS":
        after = runs.skill.tool_state[1]
        return (before, "as before") if after is ANY else (after, "by tool_state")
    name = HALT if rehearsal.status == "HALTED" else rehearsal.reason
    if name in runs.skill.tool_left:
        return runs.skill.tool_left[name], f'by tool_left["{name}"]'
    return before, f'as before, because tool_left has no "{name}"'


def _has_type(value: Any, declared: Any) -> bool:
    """Return True if a value is of a declared type, element by element."""
    if declared is Any:
        return True
    origin = get_origin(declared)
    if origin in (Union, types.UnionType):
        return any(_has_type(value, part) for part in get_args(declared))
    if declared is float:
        return isinstance(value, float | int)
    kind = origin or declared
    if isinstance(kind, type) and not isinstance(value, kind):
        return False
    element = None if isinstance(value, str | Mapping) else find_element_type(declared)
    return element is None or all(_has_type(item, element) for item in value)
