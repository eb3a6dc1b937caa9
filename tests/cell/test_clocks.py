"""A run on the wall clock, with the devices of the fake cell."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from executive.behaviours import load_skills
from executive.events import InputRead, ItemChanged, RunResumed, TimedEvent
from executive.mission.load import LoadedMission, load_mission
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.replayed_run import replay_run, resume_run
from executive.record.result import Result
from executive.run.assembly import RunOptions
from executive.run.run import Run
from executive.testing.fake_cell import FakeCell
from tests.benchmarks.longest_step import StepTimer, WallClockDriver
from tests.benchmarks.report import SilentView

pytestmark = pytest.mark.slow
OPTIONS = RunOptions(seed=3, requests=(), make_cell=partial(FakeCell, kind=WallClockDriver))
OVERRIDES = {"cell.kind": "fake", "cell.clock.step": "0.0166666667", "cell.table.objects": "[2, 2]"}
MAX_LATE_SHARE = 0.1
"""Largest share of late ticks on a computer with other load; `longest_step --wall-clock` is stricter."""

Recorded = tuple[Result, StepTimer]


@pytest.fixture(scope="module")
def mission() -> LoadedMission:
    return load_mission("sort_overhead", load_skills(), OVERRIDES)


@pytest.fixture(scope="module")
def recorded(mission: LoadedMission, tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """A recorded run, and the times of its ticks."""
    timer = StepTimer(())
    options = RecordOptions([timer], saves_pictures=False)
    return record_run(mission, OPTIONS, tmp_path_factory.mktemp("runs"), options), timer


def test_the_mission_succeeds_and_few_ticks_are_late(recorded: Recorded) -> None:
    result, timer = recorded
    assert (result.status, result.items.placed, result.disagreement) == ("SUCCESS", 2, "")
    assert timer.clock.late_tick_count <= MAX_LATE_SHARE * len(timer.steps)


def test_its_decisions_are_replayed(recorded: Recorded) -> None:
    run = Path(recorded[0].run)
    assert replay_run(run, read_journal(run / "journal.jsonl"), load_skills()).difference == ""


class HaltingView(SilentView):
    """View that halts a run after the first object is in its bin."""

    def open(self, run: Run) -> None:
        self._control = run.control

    def __call__(self, timed: TimedEvent) -> None:
        if isinstance(timed.event, ItemChanged) and timed.event.state == "placed":
            self._control.stop()


@pytest.fixture(scope="module")
def halted_and_resumed(mission: LoadedMission, tmp_path_factory: pytest.TempPathFactory) -> list[Result]:
    """Results of a run that was halted, and of its resumption."""
    options = RecordOptions([HaltingView()], saves_pictures=False)
    halted = record_run(mission, OPTIONS, tmp_path_factory.mktemp("runs"), options)
    options = RecordOptions(saves_pictures=False)
    return [halted, resume_run(Path(halted.run), mission.skills, OPTIONS, options)]


def test_its_time_goes_on_after_a_resumption(halted_and_resumed: list[Result]) -> None:
    halted, result = halted_and_resumed
    assert (halted.status, result.status, result.items.placed) == ("HALTED", "SUCCESS", 2)
    events = list(read_journal(Path(result.run) / "journal.jsonl"))
    (number,) = [number for number, timed in enumerate(events) if isinstance(timed.event, RunResumed)]
    resumed = events[number]
    kept_times = [timed.clock for timed in events[:number] if timed.tick < resumed.event.valid_ticks]
    assert kept_times[-1] <= resumed.clock <= halted.robot_time_s + 1.0
    # The event of a reading of the clock has the time on the previous reading.
    later_times = [timed.clock for timed in events[number:] if not isinstance(timed.event, InputRead)]
    assert later_times == sorted(later_times)


def test_a_resumed_run_is_replayed(halted_and_resumed: list[Result]) -> None:
    run = Path(halted_and_resumed[1].run)
    assert replay_run(run, read_journal(run / "journal.jsonl"), load_skills()).difference == ""
