"""How a skill behaves on the tick thread: always the same, quick, on one clock, and tidy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from executive.testing.conformance.case import Case, GotStuck
from executive.testing.conformance.rehearsal import Rehearsal
from executive.testing.conformance.same import same
from executive.testing.fake_cell import FakeCell, bare_table

QUICK = 0.05
"""Computing time that a tick may take [s]; a control step is 1/240 s of the run's time."""


def repeats_itself(case: Case) -> Iterator[str]:
    """In the same situation it makes the same calls at the same ticks and ends alike."""
    for first, second in case.twice:
        if difference := _difference(first, second):
            yield (
                f"{first.where}, twice the same, {difference}. Nothing may depend on chance, on time, on an "
                "object's address, or on what an earlier run has left; a seed may be a param."
            )


def ticks_come_back(case: Case) -> Iterator[str]:
    """Every tick comes back, whatever goes wrong and wherever it is halted: none loops or waits for ever."""
    try:
        _ = case.ended, case.halted
    except GotStuck as problem:
        yield str(problem)


def ticks_are_quick(case: Case) -> Iterator[str]:
    """No tick computes for longer than 50 ms, the quicker of two runs counted."""
    for first, second in case.twice:
        least = [min(pair) for pair in zip(first.durations, second.durations, strict=False)]
        slowest = max(range(len(least)), key=least.__getitem__)
        if least[slowest] > QUICK:
            yield (
                f"{first.where} it computed for {least[slowest] * 1000:.0f} ms in tick {slowest}, which "
                "holds up the arm. Spread the work over ticks by yield, or let a detector do it beside."
            )


def never_sooner_than_shortest(case: Case) -> Iterator[str]:
    """What shortest promises is no more than any success took."""
    least = FakeCell.least_times(bare_table())
    for given in (case.defaults, *(_said(case, rehearsal) for rehearsal in case.plain)):
        try:
            seconds = case.skill.shortest(least, given)
        except Exception as error:
            yield (
                f"{case.name}.shortest raises {type(error).__name__}: {error}, asked with no more than a "
                f"mission may say ({', '.join(given) or 'nothing'}). Return 0 where nothing is known."
            )
            return
        if not seconds >= 0:
            yield f"{case.name}.shortest is {seconds} s. Return 0 where nothing is known."
    for rehearsal in case.ended:
        if rehearsal.ending.status == "SUCCESS":
            seconds = case.skill.shortest(least, _said(case, rehearsal))
            if seconds > rehearsal.seconds + 1e-9:
                yield (
                    f"{rehearsal.where} it took {rehearsal.seconds:.3f} s, less than the {seconds:.3f} s "
                    "that shortest promises. executive check refuses timeouts by it: return a bound that "
                    "holds on every cell."
                )


def keeps_to_the_clock(case: Case) -> Iterator[str]:
    """It never asks the wall clock, and never sleeps on it."""
    for rehearsal in case.ended:
        if rehearsal.clocks:
            yield (
                f"{rehearsal.where} it called {' and '.join(rehearsal.clocks)}. "
                "The only clock is cell.clock: now, and sleep to yield from."
            )


def leaves_nothing_open(case: Case) -> Iterator[str]:
    """It leaves no thread, no open file and no process behind, to its end or halted."""
    for rehearsal in (*case.ended, *case.halted):
        if rehearsal.left:
            halted = f" halted at tick {rehearsal.ticks}" if rehearsal.ending.status == "HALTED" else ""
            yield (
                f"{rehearsal.where}{halted} it left {' and '.join(rehearsal.left)}. "
                "Close it in finally; what works beside the ticks is a detector."
            )


def _said(case: Case, rehearsal: Rehearsal) -> dict[str, Any]:
    """Return what a mission would have said for a run: all params, and the inputs that no item is."""
    inputs = {name: port for name, port in case.skill.ports.items() if port.refers != "item"}
    known = {**case.skill.params, **inputs}
    return {**case.defaults, **{name: value for name, value in rehearsal.given.items() if name in known}}


def _difference(one: Rehearsal, other: Rehearsal) -> str:
    """Return how two runs differ, or ""; of two that end as a fault that fault is told, not its traces."""
    if one.ending.status == other.ending.status == "FAULT" and one.ticks == other.ticks:
        return ""
    for first, second in zip(one.calls, other.calls, strict=False):
        if (first.tick, first.name) != (second.tick, second.name):
            return f"it called {first.name} at tick {first.tick} and then {second.name} at tick {second.tick}"
        if not same(first.arguments, second.arguments):
            return f"it called {first.name} at tick {first.tick} with different arguments"
    if (one.ticks, str(one.ending)) != (other.ticks, str(other.ending)):
        return f"{one.ending} after {one.ticks} ticks and then {other.ending} after {other.ticks}"
    if len(one.calls) != len(other.calls):
        return f"it made {len(one.calls)} calls of the cell and then {len(other.calls)}"
    unlike = [name for name in one.outputs if not same(one.outputs[name], other.outputs.get(name))]
    return f"it set {unlike[0]} to different values" if unlike else ""
