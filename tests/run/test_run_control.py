"""Pausing, stepping and stopping a run from outside."""

from __future__ import annotations

import threading
from functools import partial
from pathlib import Path

import pytest

from executive.behaviours import load_skills
from executive.errors import Fault
from executive.events import Event, FaultRaised, ItemChanged, RunEnded, TimedEvent
from executive.mission.load import load_mission
from executive.run.assembly import RunOptions, assemble
from executive.run.operator import RunControl
from executive.run.run import Run
from executive.testing.fake_cell import FakeCell
from tests.benchmarks.longest_step import WallClockDriver


def make(missions: Path, observer) -> Run:
    one_object = {"cell.table.objects": "[1, 1]"}
    loaded = load_mission(missions / "sort_overhead.yaml", load_skills(), one_object)
    return assemble(loaded, RunOptions(3, make_cell=FakeCell), [observer])


@pytest.mark.parametrize("steps", [0, 3])
def test_a_paused_run_stands_still_and_a_step_is_a_tick(missions: Path, steps: int) -> None:
    ticks: list[int] = []

    def pause_once(event: Event) -> None:
        if event.tick >= 50 and not ticks:
            ticks.append(event.tick)
            run.control.step(steps) if steps else run.control.pause()
            threading.Timer(0.2, lambda: (ticks.append(run.tick), run.control.resume())).start()

    run = make(missions, pause_once)
    assert run.execute().status == "SUCCESS"
    # It ends the tick it is in before it stands still.
    assert ticks[1] == ticks[0] + 1 + steps


def test_the_time_of_devices_on_a_wall_clock_stands_still_in_a_pause(missions: Path) -> None:
    times: list[float] = []

    def pause_once(event: Event) -> None:
        if event.tick == 20 and not times:
            times.append(run.now)
            run.control.pause()
            threading.Timer(1.0, run.control.resume).start()
        elif event.tick > 25 and len(times) == 1:
            times.append(run.now)
            run.control.stop()

    overrides = {"cell.clock.step": "0.0166666667"}
    loaded = load_mission(missions / "sort_overhead.yaml", load_skills(), overrides)
    make_cell = partial(FakeCell, kind=WallClockDriver)
    run = assemble(loaded, RunOptions(3, make_cell=make_cell), [pause_once])
    run.execute()
    assert times[1] - times[0] < 0.5


def test_a_paused_run_can_be_stopped(missions: Path) -> None:
    run = make(missions, lambda event: None)
    run.control.step(50)
    threading.Timer(0.3, run.control.stop).start()
    outcome = run.execute()
    assert (outcome.status, outcome.message) == ("HALTED", "halted by the user")
    assert run.station.cell.arm.at_rest
    assert run.tick >= 50


def test_the_held_item_is_reported_at_the_end(missions: Path) -> None:
    def stop(timed: TimedEvent) -> None:
        if isinstance(timed.event, ItemChanged) and timed.event.state == "held":
            run.control.stop()

    run = make(missions, stop)
    held = run.execute().held_item
    assert held in {row.item for row in run.station.ledger.list_items()}


@pytest.mark.parametrize("kind", [ItemChanged, RunEnded, FaultRaised])
def test_a_record_that_breaks_at_the_very_end_is_a_fault_with_an_outcome(
    missions: Path, kind: type[Event]
) -> None:
    def refuse(timed: TimedEvent) -> None:
        if timed.tick >= 100:
            run.control.stop()
        if run.control.is_stopped and isinstance(timed.event, kind):
            raise Fault("the disk is full")
        if kind is FaultRaised and timed.tick >= 100:
            raise Fault("the disk is full")

    run = make(missions, refuse)
    outcome = run.execute()
    assert (outcome.status, outcome.message) == ("FAULT", "the disk is full")
    assert run.station.cell.arm.at_rest


def test_something_is_done_between_ticks_and_while_the_run_stands_still() -> None:
    control, done = RunControl(), []
    control.call_between_ticks(lambda: done.append(control.is_paused))
    control.wait_while_paused()
    assert done == [False]
    control.pause()

    def go_on_after_three() -> None:
        if len(done) == 4:
            control.resume()

    control.call_between_ticks(go_on_after_three)
    control.wait_while_paused()
    assert done == [False, True, True, True]
