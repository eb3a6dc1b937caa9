"""Inputs and interruptions of a run, from its journal."""

from __future__ import annotations

import pytest
from events import at, read, run_ended, run_started

from executive.events import RunHalted, RunResumed, TimedEvent, ToolCommanded
from executive.run.replay import InputLog


def sense(tick: int, value: object, name: str = "tool.holding", nth: int = 1) -> TimedEvent:
    return at(tick, read(name, value, nth))


def resume(tick: int, ticked: int, intent: str = "") -> TimedEvent:
    return at(tick, RunResumed(ticked, intent, {}))


START = at(0, run_started())


def values(log: InputLog) -> list[object]:
    return [one.reading.value for one in log.inputs["tool.holding"]]


def test_an_incomplete_control_step_is_void_once_the_run_was_resumed() -> None:
    killed = [START, sense(4, True), sense(5, False), at(5, ToolCommanded("open"))]
    assert InputLog(killed).last_action == "open"
    resumed = InputLog([*killed, resume(5, 5, "open"), sense(5, True, nth=3)])
    assert values(resumed) == [True, True]
    assert (resumed.last_action, resumed.interruptions[5].last_action) == ("", "open")


def test_a_second_resumption_voids_only_the_end_of_the_first() -> None:
    first = [START, sense(2, 1), sense(3, 2), resume(3, 3), sense(4, 3), sense(6, 4)]
    log = InputLog([*first, resume(9, 6), sense(9, 5)])
    assert values(log) == [1, 3, 5]
    assert {one.kept_step_count: one.resume_tick for one in log.interruptions.values()} == {3: 3, 6: 9}


def test_the_steps_after_a_halt_do_not_count() -> None:
    halted = [START, sense(8, 1), at(9, RunHalted(True)), sense(30, 2), at(30, run_ended())]
    log = InputLog(halted)
    assert (log.make_final_interruption(30).kept_step_count, values(log.select_before(9))) == (9, [1])
    # Once the run was resumed, the halt is void.
    assert InputLog([*halted, resume(30, 9)]).halt is None


@pytest.mark.parametrize(("steps", "complete"), [(0, 0), (8, 8), (500, 9)])
def test_a_control_step_counts_if_the_world_made_it_and_the_journal_reaches_it(
    steps: int, complete: int
) -> None:
    # Step 8 is the last one in the journal: whether it is complete is known from the steps of the world.
    assert InputLog([START, sense(8, 1)]).make_final_interruption(steps).kept_step_count == complete


def test_a_kill_within_a_control_step_discards_the_step_but_no_action() -> None:
    log = InputLog([START, at(8, ToolCommanded("open"))])
    interruption = log.make_final_interruption(8, is_complete=False)
    assert (interruption.kept_step_count, interruption.last_action) == (8, "open")


@pytest.mark.parametrize(("steps", "complete"), [(9, 6), (10, 10)])
def test_a_resumption_that_was_interrupted_at_once_is_repeated_from_its_beginning(
    steps: int, complete: int
) -> None:
    log = InputLog([START, sense(5, 1), resume(9, 6, "close"), sense(9, 2)])
    interruption = log.make_final_interruption(steps)
    assert (interruption.kept_step_count, interruption.resume_tick) == (complete, steps)
