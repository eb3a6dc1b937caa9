"""Rules for the behaviour of a skill: in each situation, under each fault, and with a halt at any tick.

Each public function is a rule: its docstring states the rule, and the function yields one text per violation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, get_args

from executive.mission.check.conditions import list_condition_violations
from executive.mission.model.port_types import describe_type, find_element_type, is_assignable, is_union
from executive.skill import ANY, EMPTY, HOLDING, ToolState
from executive.testing.conformance.declaration_checks import HALT
from executive.testing.conformance.situations import ArrangementFailed
from executive.testing.conformance.skill_runs import SkillRuns, TickNotReturned
from executive.testing.conformance.skill_test_run import MAX_RUN_TIME, SkillTestRun, has_equal_pickle

MAX_TICK_DURATION = 0.05
"""Maximum computing time of a tick [s]."""

_ACTIONS = ("arm.start", "arm.stop", "tool.open", "tool.close", "camera.capture")
"""Commands to parts of the cell; the part must be in `uses` of the skill."""
_MEASUREMENTS = ("camera.capture", "operator.ask")
"""Calls that return new information; they require `senses` of the skill."""
_QUERY_PREFIXES = ("is_", "find_", "get_", "count_", "describe", "sees_")
"""First letters of the methods of the cell that change nothing, so that a condition may call them."""


def can_succeed(runs: SkillRuns) -> Iterator[str]:
    """The skill can be tested, and succeeds in at least one situation; a condition may always fail."""
    try:
        _ = runs.situations  # Generates the values of all params and inputs.
    except ArrangementFailed as error:
        yield f"{runs.name} cannot be tested: {error}"
        return
    has_succeeded = any(test_run.status == "SUCCESS" for test_run in runs.unhalted_runs)
    if not (has_succeeded or runs.skill.is_condition):
        yield (
            f"{runs.name} never succeeded; {runs.unhalted_runs[0].result_description}. "
            "Set up a scene in which it succeeds: "
            f"list_conformance_checks({runs.skill.__name__}, lambda scene: ...); "
            "skills/README.md has an example."
        )


def terminates(runs: SkillRuns) -> Iterator[str]:
    """Each tick returns, and the skill ends within 60 s on the run's clock."""
    try:
        _ = runs.unhalted_runs, runs.halted_runs  # Executes all runs.
    except TickNotReturned as error:
        yield str(error)
        return
    for test_run in runs.unhalted_runs:
        if test_run.status == "RUNNING":
            yield (
                f"{test_run.description} {runs.name} was still running after {MAX_RUN_TIME:g} s. "
                "Limit the duration of each wait, and fail with a reason when it expires."
            )


def ends_as_declared(runs: SkillRuns) -> Iterator[str]:
    """Under each fault the skill succeeds with all outputs, or fails with a declared reason and a message."""
    for test_run in runs.unhalted_runs:
        prefix = f"{test_run.description} at tick {test_run.ticks}"
        if test_run.status == "FAULT":
            yield (
                f"{prefix} {test_run.message}. This is a fault, which ends the run: fail with a declared "
                "reason, or correct the code."
            )
        elif test_run.status == "FAILURE" and not test_run.message.strip():
            yield (
                f'{prefix} it failed with "{test_run.reason}" and no message. '
                "State what happened, with numbers: the operator reads only this message."
            )


def has_outputs_of_declared_types(runs: SkillRuns) -> Iterator[str]:
    """Each output has its declared type."""
    for test_run in runs.unhalted_runs:
        for name, value in test_run.outputs.items():
            port_type = runs.skill.ports[name].type
            if not _is_of_type(value, port_type):
                yield (
                    f"{test_run.description} {runs.name}.{name} is of the type {type(value).__name__}, not "
                    f"{describe_type(port_type)}. Set a value of this type, or change the declaration."
                )


def leaves_inputs_unchanged(runs: SkillRuns) -> Iterator[str]:
    """The skill does not change its params and inputs."""
    for test_run in runs.unhalted_runs:
        for name in test_run.changed_names:
            yield (
                f"{test_run.description} it changed the value of self.{name}. "
                "Other nodes read the same value later: change a copy."
            )


def uses_only_declared_parts(runs: SkillRuns) -> Iterator[str]:
    """The skill commands only parts in `uses`, moves only with `moves`, and senses only with `senses`."""
    skill = runs.skill
    for name in dict.fromkeys(call.name for test_run in runs.unhalted_runs for call in test_run.cell_calls):
        part = name.partition(".")[0]
        if name in _ACTIONS and part not in skill.uses:
            yield f'{runs.name} calls cell.{name} and does not declare the {part}. Add "{part}" to uses.'
        if name == "arm.start" and not skill.moves:
            yield f"{runs.name} calls cell.{name} and does not declare that it moves. Add moves = True."
        if name in _MEASUREMENTS and not skill.senses:
            yield f"{runs.name} calls cell.{name} and does not declare that it senses. Add senses = True."


def leaves_tool_as_declared(runs: SkillRuns) -> Iterator[str]:
    """After success, each failure and a halt at any tick, the tool is in the declared state."""
    yield from _list_first_problems(runs.ended_runs, _describe_tool_problem)


def leaves_arm_at_rest(runs: SkillRuns) -> Iterator[str]:
    """If the skill started the arm, the arm is at rest after the end or a halt of the skill."""
    yield from _list_first_problems(runs.ended_runs, _describe_arm_problem)


def halts_in_one_tick(runs: SkillRuns) -> Iterator[str]:
    """A halt at any tick ends the skill in the same tick, without an exception."""
    yield from _list_first_problems(runs.halted_runs, _describe_halt_fault)


def is_deterministic(runs: SkillRuns) -> Iterator[str]:
    """Two runs in the same situation make the same calls at the same ticks, and end with the same result."""
    for run, rerun in runs.repeated_runs:
        if difference := _describe_difference(run, rerun):
            yield (
                f"{run.description}, in two equal runs, {difference}. "
                "The skill may not depend on chance, wall time or earlier runs; a seed may be a param."
            )


def decides_without_effect(runs: SkillRuns) -> Iterator[str]:
    """A skill with `is_condition` decides in one tick, has no output, uses no device, and changes nothing."""
    skill, name = runs.skill, runs.name
    if not skill.is_condition:
        return
    for effect in list_condition_violations(skill):
        yield f"{name} {effect}, and declares is_condition. Remove one of the two."
    calls = [call.name for test_run in runs.unhalted_runs for call in test_run.cell_calls]
    for call in dict.fromkeys(calls):
        if not call.partition(".")[2].startswith(_QUERY_PREFIXES):
            yield f"{name} calls cell.{call}, and declares is_condition. A condition may only read the cell."
    if longest := max((test_run.ticks for test_run in runs.unhalted_runs), default=0):
        yield f"{name} took {longest + 1} ticks, and declares is_condition. Decide without a yield."


def has_short_ticks(runs: SkillRuns) -> Iterator[str]:
    """No tick computes for longer than 50 ms in the faster of two equal runs."""
    for run, rerun in runs.repeated_runs:
        durations = list(map(min, run.tick_durations, rerun.tick_durations))
        longest = max(durations, default=0.0)
        if longest > MAX_TICK_DURATION:
            yield (
                f"{run.description} tick {durations.index(longest)} computed for {longest * 1000:.0f} ms, "
                "which blocks the arm. Distribute the work over ticks with yield, or do it in a detector."
            )


def _describe_difference(run: SkillTestRun, rerun: SkillTestRun) -> str:
    """Return a description of the first difference between two runs, or ""."""
    for call, other in zip(run.cell_calls, rerun.cell_calls, strict=False):
        if (call.tick, call.name) != (other.tick, other.name):
            return f"it called {call.name} at tick {call.tick} and then {other.name} at tick {other.tick}"
        if not has_equal_pickle(call.arguments, other.arguments):
            return f"it called {call.name} at tick {call.tick} with different arguments"
    if (run.ticks, run.status) != (rerun.ticks, rerun.status):
        end, other_end = f"{run.status} after {run.ticks}", f"{rerun.status} after {rerun.ticks}"
        return f"it ended as {end} ticks and then as {other_end}"
    return "" if has_equal_pickle(run.outputs, rerun.outputs) else "it set its outputs to different values"


def _list_first_problems(runs: list[SkillTestRun], describe: Callable[[SkillTestRun], str]) -> Iterable[str]:
    """Return the first problem of each situation; `describe` returns "" for a run without a problem."""
    problems: dict[str, str] = {}
    for test_run in runs:
        if problem := describe(test_run):
            problems.setdefault(test_run.description, problem)
    return problems.values()


def _describe_halt_fault(test_run: SkillTestRun) -> str:
    advice = "The code in finally must take no control step and raise no exception."
    problem = f"{test_run.description} at tick {test_run.ticks} {test_run.message}. {advice}"
    return problem if test_run.status == "FAULT" else ""


def _describe_arm_problem(test_run: SkillTestRun) -> str:
    advice = "Call cell.arm.stop() in finally, or use follow of executive.manipulation.motions."
    is_moving = not test_run.is_at_rest and any(call.name == "arm.start" for call in test_run.cell_calls)
    return f"{test_run.result_description}, and the arm still moves. {advice}" if is_moving else ""


def _describe_tool_problem(test_run: SkillTestRun) -> str:
    """Return the violation of the declared tool state at the end of a run, or ""."""
    required, requirement = _find_required_tool_state(test_run)
    if required is not ANY and (required is HOLDING) != test_run.holds_object_at_end:
        actual = "holds something" if test_run.holds_object_at_end else "is empty"
        expected = "hold something" if required is HOLDING else "be empty"
        return (
            f"{test_run.result_description}, and the tool {actual}. It should {expected}, {requirement}. "
            "Leave the tool in this state, or change the declaration."
        )
    if test_run.holds_object_at_end and not test_run.is_item_held:
        return (
            f"{test_run.result_description}, and the tool holds an object that is not in the ledger. "
            "Call cell.ledger.record_grasp, or open the tool in finally."
        )
    return ""


def _find_required_tool_state(test_run: SkillTestRun) -> tuple[ToolState, str]:
    """Return the required state of the tool at the end of a run, and the declaration that requires it."""
    skill, initial_state = test_run.skill, HOLDING if test_run.holds_object_at_start else EMPTY
    if test_run.status == "SUCCESS":
        state_after = skill.tool_state[1]
        return (initial_state, "as before") if state_after is ANY else (state_after, "by tool_state")
    name = HALT if test_run.status == "HALTED" else test_run.reason
    if name in skill.tool_state_after_failure:
        return skill.tool_state_after_failure[name], f'by tool_state_after_failure["{name}"]'
    return initial_state, f'as before, because tool_state_after_failure has no "{name}"'


def _is_of_type(value: Any, declared_type: Any) -> bool:
    """Return True if a value, and each element of a list, has the declared type."""
    if declared_type is Any:
        return True
    if is_union(declared_type):
        return any(_is_of_type(value, part) for part in get_args(declared_type))
    element_type = find_element_type(declared_type)
    elements = () if element_type is None or isinstance(value, str) else value
    has_type = is_assignable(type(value), declared_type)
    return has_type and all(_is_of_type(element, element_type) for element in elements)
