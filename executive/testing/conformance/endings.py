"""How a skill ends, whatever happens, and how it leaves arm and tool."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from executive.skill import ANY, EMPTY, HOLDING, ToolState
from executive.testing.conformance.case import Case
from executive.testing.conformance.declarations import HALT
from executive.testing.conformance.rehearsal import LONGEST, Rehearsal
from executive.testing.conformance.situations import NotArranged


def arranged(case: Case) -> Iterator[str]:
    """It can be tried: whatever it needs can be made up, or was given."""
    try:
        _ = case.scenes
    except NotArranged as problem:
        yield f"{case.name} cannot be tried: {problem}"


def hands_back_steps(case: Case) -> Iterator[str]:
    """What its run returns is an iterator: it is a generator, or hands one on."""
    for rehearsal in case.plain:
        if not issubclass(rehearsal.handed, Iterator) and rehearsal.ending.status != "FAULT":
            yield (
                f"{case.name}.run returned a {rehearsal.handed.__name__}. "
                'Make it a generator: if it never waits, begin it with "yield from ()".'
            )
            return


def comes_to_an_end(case: Case) -> Iterator[str]:
    """It ends within a minute on the run's clock."""
    for rehearsal in case.ended:
        if rehearsal.ending.status == "RUNNING":
            yield (
                f"{rehearsal.where} {case.name} was not over after {LONGEST:g} s. "
                "Whatever it waits for may never come: wait for so long at most, then fail with a reason."
            )


def ends_as_declared(case: Case) -> Iterator[str]:
    """It succeeds, or fails with a declared reason and a sentence."""
    yield from _undeclared(case, case.plain)


def adversity_ends_as_declared(case: Case) -> Iterator[str]:
    """Whatever goes wrong in the cell, it succeeds, or fails with a declared reason and a sentence."""
    yield from _undeclared(case, case.hard)


def succeeds_somewhere(case: Case) -> Iterator[str]:
    """It succeeds in one situation at least, so that what it says of success was seen."""
    if not any(rehearsal.ending.status == "SUCCESS" for rehearsal in case.ended):
        rehearsal = case.plain[0]
        yield (
            f"{case.name} never succeeded; {rehearsal.where} {rehearsal.ending}. "
            f"Arrange a stage on which it can: conformance({case.skill.__name__}, lambda stage: ...), "
            "as skills/README.md shows."
        )


def tool_left_as_declared(case: Case) -> Iterator[str]:
    """After success and after every failure the tool holds what tool_state and tool_left say."""
    for rehearsal in case.ended:
        if rehearsal.ending.status in ("SUCCESS", "FAILURE"):
            yield from tool_fault(case, rehearsal)


def rests_at_the_end(case: Case) -> Iterator[str]:
    """Where it started the arm, the arm is at rest when it ends."""
    for rehearsal in case.ended:
        if rehearsal.moved and not rehearsal.at_rest and rehearsal.ending.status in ("SUCCESS", "FAILURE"):
            yield (
                f"{rehearsal.where} {rehearsal.ending} while the arm still moves. "
                "Wait until it is at rest, or call cell.arm.stop() in finally, as follow of "
                "executive.moving does."
            )


def tool_fault(case: Case, rehearsal: Rehearsal) -> Iterator[str]:
    """Yield what is wrong with the tool at the end of a run."""
    wanted, why = _wanted(case, rehearsal)
    if wanted is not ANY and (wanted is HOLDING) != rehearsal.holds:
        holds = "holds something" if rehearsal.holds else "is empty"
        should = "hold something" if wanted is HOLDING else "be empty"
        yield (
            f"{rehearsal.where} {_when(rehearsal)}, and the tool {holds}. It should {should}: {why}. "
            "Leave the tool as declared, or declare how it is left."
        )
    elif rehearsal.holds and rehearsal.believed is None:
        yield (
            f"{rehearsal.where} {_when(rehearsal)}, and the tool holds what the ledger does not know of. "
            "Tell it by cell.ledger.held, or open the tool in finally."
        )


def _wanted(case: Case, rehearsal: Rehearsal) -> tuple[ToolState, str]:
    """Return what the tool must hold at the end of a run, and why."""
    before = HOLDING if rehearsal.held else EMPTY
    if rehearsal.ending.status == "SUCCESS":
        after = case.skill.tool_state[1]
        return (before, "tool_state says as before") if after is ANY else (after, "tool_state says so")
    name = HALT if rehearsal.ending.status == "HALTED" else rehearsal.ending.reason
    if name in case.skill.tool_left:
        return case.skill.tool_left[name], f'tool_left says so of "{name}"'
    return before, f'as before, for tool_left says nothing of "{name}"'


def _when(rehearsal: Rehearsal) -> str:
    if rehearsal.ending.status == "HALTED":
        return f"it was halted at tick {rehearsal.ticks}"
    return str(rehearsal.ending)


def _undeclared(case: Case, rehearsals: Iterable[Rehearsal]) -> Iterator[str]:
    reasons = case.skill.reasons
    for rehearsal in rehearsals:
        where, ending = f"{rehearsal.where} at tick {rehearsal.ticks}", rehearsal.ending
        if ending.status == "FAULT":
            yield (
                f"{where} {ending.message}. That is a fault, which ends the run: fail with a declared reason "
                "where this can happen, or mend it."
            )
        elif ending.status == "FAILURE" and ending.reason not in reasons:
            yield (
                f'{where} it failed with "{ending.reason}", which it does not declare. '
                f"Add it to reasons; there are: {', '.join(reasons) or 'none'}."
            )
        elif ending.status == "FAILURE" and not ending.message.strip():
            yield (
                f'{where} it failed with "{ending.reason}" and no sentence. '
                "Say what happened, with the numbers: it is all that the operator will read."
            )
