"""Recorded runs that are decided once more, and runs that were cut off and are taken up again."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executive.behaviours import load_skills
from executive.cell.json_values import to_json
from executive.drivers.fake import FakeDriver
from executive.errors import InputError
from executive.events import BinsEmptied, InputRead, ItemChanged, TimedEvent, ToolCommanded
from executive.mission.load import LoadedMission, load_mission
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.replayed_run import ReplayResult, replay_and_compare, replay_run, resume_run
from executive.record.result import Result
from executive.record.run_directory import find_run
from executive.run.assembly import RunOptions
from executive.run.replay import InputLog
from executive.testing.fake_cell import FakeCell
from executive.testing.oracle import make_oracle_kind
from executive.testing.run_mission import make_raising, run_mission
from tests.benchmarks.kills import find_handled_twice
from tests.cut_off import Cut, Cutter

SEED = 3


@pytest.fixture(scope="module")
def whole_runs(missions: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one complete run of `sort_overhead`."""
    runs = tmp_path_factory.mktemp("whole")
    run_of(load(missions, "sort_overhead"), runs, frames=True)
    return runs


@pytest.fixture
def whole_run(whole_runs: Path, tmp_path: Path) -> Path:
    """The directory of the complete run, copied to `tmp_path`."""
    shutil.copytree(whole_runs, tmp_path, dirs_exist_ok=True)
    return next(tmp_path.glob("*/*/journal.jsonl")).parent


class Emptier(Cutter):
    """Empties all bins after each placement; ends the process some events after the first of them."""

    def open(self, run: Any) -> None:
        self._control = run.control

    def __call__(self, timed: TimedEvent) -> None:
        if isinstance(timed.event, ItemChanged) and timed.event.state == "placed":
            self._control.empty_bins()
        if isinstance(timed.event, BinsEmptied) and self._tick == 0:
            self._tick = timed.tick
        if self._tick:
            super().__call__(timed)


def load(missions: Path, name: str) -> LoadedMission:
    return load_mission(missions / f"{name}.yaml", load_skills())


def run_of(loaded: LoadedMission, runs: Path, **options: Any) -> Result:
    """Run a mission on the fake cell, asking for every class four times."""
    views, frames = options.pop("views", ()), options.pop("frames", False)
    run = RunOptions(SEED, [*loaded.routes] * 4, **{"make_cell": FakeCell, **options})
    return record_run(loaded, run, runs, RecordOptions(views, saves_pictures=frames))


def cut_off(loaded: LoadedMission, runs: Path, tick: int, nth: int = 1) -> Path:
    """Begin a run that is cut off, and return its directory."""
    with pytest.raises(Cut):
        run_of(loaded, runs, views=[Cutter(tick, nth)])
    return find_run("latest", runs)


def resumed(path: Path, **options: Any) -> Result:
    skills, views = options.pop("skills", load_skills()), options.pop("views", ())
    run = RunOptions(SEED, **{"make_cell": FakeCell, **options})
    return resume_run(path, skills, run, RecordOptions(views, saves_pictures=False))


def decided_again(path: Path, mission: Path | None = None) -> ReplayResult:
    """Decide the whole run once more, its cuts included."""
    return replay_run(path, read_journal(path / "journal.jsonl"), load_skills(), mission)


def handled_twice(path: Path) -> list[str]:
    """Every item that was handled again after it had been placed."""
    return find_handled_twice(list(read_journal(path / "journal.jsonl")))


CASES = [
    *(("sort_overhead", *cut) for cut in [(0, 1), (0, 3), (444, 7), (700, 1), (1203, 3), (2100, 11)]),
    *((name, 700, 1) for name in ("sort_wrist", "kit_fasteners", "pick_on_request", "fill_by_quota")),
    # During a verification, between the localization and the update of the ledger, in a guard, in a weighing.
    *[("sort_and_verify", 2100, 1), ("two_detectors", 713, 1), ("sort_guarded", 700, 1)],
    ("weigh_and_sort", 740, 1),
]
QUICK = ("sort_overhead", 700, 1)


@pytest.mark.parametrize(
    ("name", "after", "nth"),
    [pytest.param(*case, marks=[] if case == QUICK else pytest.mark.slow) for case in CASES],
)
def test_it_ends_as_if_nothing_had_happened(missions: Path, tmp_path: Path, name, after, nth) -> None:
    loaded = load(missions, name)
    whole = run_of(loaded, tmp_path)
    path = cut_off(loaded, tmp_path, after, nth)
    result = resumed(path)
    assert (result.status, result.items) == (whole.status, whole.items)
    assert result.audit.agrees
    assert handled_twice(path) == []
    assert decided_again(path).is_equal
    assert json.loads((path / "result.json").read_text()) == to_json(result)


@pytest.mark.slow
def test_the_world_of_a_scene_is_rebuilt(missions: Path, tmp_path: Path) -> None:
    loaded, scene = load(missions, "sort_overhead"), tmp_path / "scene.yaml"
    scene.write_text("scene: two objects\ntable: {objects: [2, 2]}\nunknown: {count: [1, 1], scale: 0.4}\n")
    with pytest.raises(Cut):
        run_of(
            loaded,
            tmp_path,
            make_cell=make_oracle_kind(),
            driver_options={"scene": str(scene)},
            views=[Cutter(600)],
        )
    # What happens to the file afterwards is nothing to the run.
    scene.unlink()
    result = resumed(find_run("latest", tmp_path), make_cell=make_oracle_kind())
    assert (result.status, result.audit.right, result.audit.agrees) == ("SUCCESS", 2, True)


@pytest.mark.slow
def test_a_run_that_was_halted_goes_on(missions: Path, tmp_path: Path) -> None:
    class Stopper(Cutter):
        def __call__(self, timed: TimedEvent) -> None:
            if isinstance(timed.event, ItemChanged) and timed.event.state == "held":
                os.kill(os.getpid(), signal.SIGINT)

    halted = run_of(load(missions, "sort_overhead"), tmp_path, views=[Stopper(0, 0)])
    assert (halted.status, bool(halted.held_item)) == ("HALTED", True)
    path = Path(halted.run)
    result = resumed(path)
    assert (result.status, result.items.placed) == ("SUCCESS", 6)
    assert handled_twice(path) == []
    assert decided_again(path).is_equal


@pytest.mark.slow
def test_a_run_that_a_bug_ended_resumes_after_the_repair(missions: Path, tmp_path: Path) -> None:
    skills = load_skills()
    buggy = {**skills, "Grasp": make_raising(skills["Grasp"], ZeroDivisionError("a bug"), delay_steps=3)}
    first = run_of(replace(load(missions, "sort_overhead"), skills=buggy), tmp_path)
    assert (first.status, "a bug" in first.message) == ("FAULT", True)
    run = Path(first.run)
    assert resumed(run, skills=buggy).message == first.message, "it is not mended yet"
    result = resumed(run)
    assert (result.status, result.audit.right) == ("SUCCESS", result.items.seen)
    assert handled_twice(run) == []


def test_there_must_be_something_to_take_up(whole_run: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"ended as SUCCESS; there is nothing to resume"):
        resumed(whole_run)
    (whole_run / "journal.jsonl").write_text("")
    with pytest.raises(InputError, match="was interrupted before its start"):
        resumed(whole_run)
    with pytest.raises(InputError, match=r'"nowhere" is no run directory, .* the last runs there: 20'):
        find_run("nowhere", tmp_path)
    with pytest.raises(InputError, match="it contains no run at all"):
        find_run("latest", tmp_path / "empty")


def test_a_run_whose_journal_lost_commands_to_the_tool_is_refused(whole_run: Path) -> None:
    content = (whole_run / "journal.jsonl").read_bytes()
    (whole_run / "journal.jsonl").write_bytes(content[: int(0.6 * len(content))])
    with pytest.raises(InputError, match="lacks later commands"):
        resumed(whole_run)


@pytest.mark.slow
def test_the_result_of_a_run_that_was_killed_after_its_end_is_written(missions: Path, tmp_path: Path) -> None:
    result = run_of(load(missions, "sort_overhead"), tmp_path, frames=True)
    path = Path(result.run)
    journal = (path / "journal.jsonl").read_bytes()
    (path / "result.json").unlink()
    completed = resumed(path)
    assert completed == replace(result, wall_time_s=completed.wall_time_s)
    assert json.loads((path / "result.json").read_text()) == to_json(completed)
    assert (path / "journal.jsonl").read_bytes() == journal


def test_a_mission_that_is_decided_otherwise_now_is_not_gone_on_with(missions: Path, tmp_path: Path) -> None:
    path = cut_off(load(missions, "inspect_then_sort"), tmp_path, 900)
    file = path / "mission.yaml"
    old, new = "try: {SelectTarget: {prefer: surest}}", "try: SelectTarget"
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    with pytest.raises(InputError, match=r"cannot be resumed: recorded: at .*; replayed: "):
        resumed(path)


class UnwillingCell(FakeCell):
    """A fake cell whose first object cannot be sealed."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        first = self.world.objects[0]
        self.tool.can_hold = lambda: self.tool.find_object() is not first


@pytest.mark.slow
def test_what_was_rejected_is_tried_again(missions: Path, tmp_path: Path) -> None:
    loaded = load_mission(missions / "sort_overhead.yaml", load_skills(), {"attempts": "1"})
    first = run_of(loaded, tmp_path, make_cell=UnwillingCell)
    path = Path(first.run)
    again = resumed(path, make_cell=UnwillingCell)
    for result in (first, again):
        assert (result.status, result.items.placed, result.items.rejected) == ("INCOMPLETE", 5, 1)
    with pytest.raises(Cut):
        resumed(path, views=[Cutter(again.ticks + 100)])
    result = resumed(path)
    assert (result.status, result.items.placed, result.items.seen) == ("SUCCESS", 6, 6)
    assert result.audit.agrees
    assert handled_twice(path) == []
    assert decided_again(path).is_equal


ALL = sorted(path.stem for path in (Path(__file__).parents[2] / "missions").glob("*.yaml"))


def recorded(missions: Path, runs: Path, name: str, **options: Any) -> Path:
    return Path(run_of(load(missions, name), runs, **options).run)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == "sort_overhead" else pytest.mark.slow) for name in ALL]
)
def test_the_same_mission_decides_the_same(missions: Path, tmp_path: Path, name: str) -> None:
    done = decided_again(recorded(missions, tmp_path, name))
    assert (done.is_equal, done.difference) == (True, "")
    assert done.decisions > 100


def edited(path: Path, old: str, new: str) -> Path:
    text = (path / "mission.yaml").read_text()
    assert old in text
    # Beside its library, as a mission lies.
    file = path / "edited.yaml"
    file.write_text(text.replace(old, new))
    return file


def test_the_first_other_decision_of_an_edited_mission_is_reported(missions: Path, tmp_path: Path) -> None:
    path = recorded(missions, tmp_path, "inspect_then_sort")
    done = decided_again(path, edited(path, "try: {SelectTarget: {prefer: surest}}", "try: SelectTarget"))
    assert done.edited
    assert done.recorded.event.item != done.replayed.event.item
    assert re.match(
        r"recorded: at [\d.]+ s \(step \d+\) TargetSelected: item .*; replayed: at ", done.difference
    )


def test_a_decision_too_many_is_a_difference_in_a_run_that_was_cut_off_too(missions: Path) -> None:
    file = missions / "sort_overhead.yaml"
    skills = load_skills()
    cut = [timed for timed in run_mission(file, seed=3).events if timed.tick <= 600]
    missing = next(n for n, timed in enumerate(cut) if isinstance(timed.event, ToolCommanded))
    without = [one for n, one in enumerate(cut) if n < missing or isinstance(one.event, InputRead)]
    loaded = load_mission(file, skills)
    assert replay_and_compare(loaded, InputLog(cut), 3).is_equal
    done = replay_and_compare(loaded, InputLog(without), 3)
    assert (done.recorded, done.replayed and type(done.replayed.event)) == (None, ToolCommanded)


SLOW = pytest.mark.slow


@pytest.mark.parametrize("nth", [*(pytest.param(nth, marks=SLOW) for nth in (1, 2, 10)), None])
def test_emptied_bins_stay_empty_in_a_replay_and_after_a_kill(
    missions: Path, tmp_path: Path, nth: int | None
) -> None:
    loaded = load(missions, "sort_overhead")
    with pytest.MonkeyPatch.context() as patch, pytest.raises(Cut):
        if nth is None:
            patch.setattr(FakeDriver, "remove_object", cut)
        run_of(loaded, tmp_path, views=[Emptier(0, nth or 10**9)])
    path = find_run("latest", tmp_path)
    result = resumed(path)
    assert (result.status, result.disagreement) == ("SUCCESS", "")
    assert result.items.placed == result.audit.right > 2
    assert decided_again(path).difference == ""


def cut(*_: object, **__: object) -> None:
    raise Cut
