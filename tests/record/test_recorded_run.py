"""A run with its record, on the fake cell, also on a disk that fills up at any moment."""

from __future__ import annotations

import json
import os
from pathlib import Path
from unittest.mock import Mock

import py_trees
import pytest
from click.testing import CliRunner, Result
from events import at, run_ended

from executive.cell.json_values import to_json
from executive.cells.fake.cell import FakeCell
from executive.cli.main import main
from executive.errors import InputError
from executive.events import NodeStarted, RunEnded, RunStarted, TargetSelected
from executive.mission.load import load_mission
from executive.plugins import load_skills
from executive.record.journal import Journal, read_journal
from executive.record.picture_recorder import PictureRecorder
from executive.record.recorded_run import GuardedView, RecordOptions, record_run
from executive.record.recorder import Recorder
from executive.record.run_directory import RunDirectory
from executive.run.assembly import RunOptions
from executive.run.run import Run


class Watcher:
    """A view that notes what it hears."""

    def __init__(self) -> None:
        self.seen: list = []

    def open(self, run):
        self.seen.append(run.root)

    def __call__(self, event):
        self.seen.append(type(event.event))

    def close(self):
        self.seen.append("closed")

    def show_message(self, message):
        self.seen.append(message)


@pytest.fixture
def run(bring_one, tmp_path, monkeypatch):
    """Run the mission that brings one object once; each cell that is closed is counted."""
    closed = []
    monkeypatch.setattr(FakeCell, "close", lambda self: closed.append(self))

    def once(*views, **options):
        loaded = load_mission(bring_one, load_skills())
        try:
            record = RecordOptions(views, **options)
            run_options = RunOptions(3, make_cell=FakeCell)
            return record_run(loaded, run_options, tmp_path / "runs", record)
        finally:
            assert len(closed) == 1

    return once


def test_leaves_a_directory_that_explains_the_run(run, tmp_path):
    result, left = run(), tmp_path / "runs" / "latest"
    assert {path.name for path in left.iterdir()} == {
        "mission.yaml", "params.yaml", "cell.yaml", "tree.json", "journal.jsonl", "world.log",
        "result.json", "frames",
    }  # fmt: skip
    assert json.loads((left / "result.json").read_text()) == to_json(result)
    assert result.audit.agrees
    events = read_journal(left / "journal.jsonl")
    (decision,) = (one for one in events if isinstance(one.event, TargetSelected))
    assert (left / "frames" / f"{decision.tick:06d}_{decision.event.item}.jpg").is_file()
    assert (type(events[0].event), type(events[-1].event)) == (RunStarted, RunEnded)


def test_a_view_receives_the_tree_first_and_the_end_last(run):
    view, other = Watcher(), Watcher()
    run(view, other, saves_pictures=False)
    assert view.seen == other.seen
    root, first, *_, last, closed = view.seen
    assert isinstance(root, py_trees.behaviour.Behaviour)
    assert (first, last, closed) == (RunStarted, RunEnded, "closed")


@pytest.mark.parametrize("error", [InputError("no such weights"), KeyboardInterrupt()])
def test_whatever_ends_a_run_early_view_journal_and_cell_are_closed(run, tmp_path, monkeypatch, error):
    def fails(self):
        raise error

    monkeypatch.setattr(Run, "count_ground_truth", fails)
    view, other = Watcher(), Watcher()
    with pytest.raises(type(error)):
        run(view, other)
    assert view.seen[-1] == other.seen[-1] == "closed"
    left = tmp_path / "runs" / "latest"
    assert not (left / "result.json").exists()
    Journal(left / "journal.jsonl", resume=True).close()


@pytest.mark.parametrize(
    ("method", "calls"),
    [
        ("open", ["open", "close"]),
        ("event", ["open", "event", "close"]),
        ("close", ["open", "event", "event", "close", "close"]),
    ],
)
def test_a_view_that_failed_is_only_closed(method: str, calls: list[str]) -> None:
    inner = Mock(spec=["open", "event", "close"])
    getattr(inner, method).side_effect = ValueError("no ink")
    inner.side_effect = inner.event
    view = GuardedView(inner)
    view.open(None)
    view(None)
    view(None)
    view.close()
    seen = [name for name, _, _ in inner.method_calls]
    assert seen == calls
    assert "failed during the run: ValueError: no ink" in view.problem


def test_a_picture_that_cannot_be_drawn_is_reported_and_the_run_continues(tmp_path, monkeypatch):
    # No event can be asked for its data.
    monkeypatch.setattr(PictureRecorder, "__call__", lambda self, event: event["kind"])
    directory = RunDirectory(tmp_path)
    recorder = Recorder(directory)
    recorder(at(0, NodeStarted("a")))
    recorder(at(1, run_ended()))
    recorder.close()
    assert recorder.problem.startswith("not every picture was drawn: TypeError: ")
    assert len(read_journal(directory.journal)) == 2


RECORD = ("write", "fsync", "replace", "rename")
WORLD = ("pwrite",)


class Disk:
    """Takes so many calls, then half of one more, and nothing after that."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, names: tuple[str, ...]) -> None:
        self.room, self.asked = 1_000_000, 0
        for name in names:
            monkeypatch.setattr(os, name, self._limited(getattr(os, name)))

    @property
    def full(self) -> bool:
        return self.asked > self.room

    def _limited(self, call):
        def limited(*args, **options):
            self.asked += 1
            if not self.full:
                return call(*args, **options)
            if self.asked == self.room + 1 and call.__name__ == "write" and len(args[1]) > 1:
                return call(args[0], args[1][: len(args[1]) // 2])
            raise OSError(28, "No space left on device")

        return limited


@pytest.fixture
def run_command(bring_one, tmp_path, monkeypatch, cells):
    """Run the command once, without pictures; the result, and the directory that it left, if any."""
    monkeypatch.setattr(PictureRecorder, "__call__", lambda self, timed: None)

    def once() -> tuple[Result, Path | None]:
        before = set(tmp_path.glob("runs/[0-9]*/*"))
        few = ("--set", "cell.kind=fake", "--set", "cell.table.objects=[1, 1]")
        words = ["run", bring_one, "--runs", str(tmp_path / "runs"), *few, "--json"]
        shown = CliRunner().invoke(main, words)
        (left,) = set(tmp_path.glob("runs/[0-9]*/*")) - before or {None}
        return shown, left

    return once


@pytest.mark.slow
def test_a_run_whose_disk_fills_up_ends_at_rest_and_says_so(run_command, monkeypatch, cells):
    disk = Disk(monkeypatch, RECORD)
    codes = []
    while True:
        disk.room, disk.asked = len(codes), 0
        shown, left = run_command()
        if not disk.full:
            break
        codes.append(shown.exit_code)
        assert cells[-1].arm.at_rest
        assert "Traceback" not in shown.output
        assert "no space left on device" in shown.stderr
        assert left is None or not list(left.rglob(".*.part"))
        if shown.exit_code == 3:
            result = json.loads(shown.stdout)
            assert (result["status"], result["run"]) == ("FAULT", str(left))
            assert read_journal(left / "journal.jsonl") is not None
    # A run that has not begun has bad input; a run that is over and recorded lacks only its report.
    assert codes == sorted(codes, key=(2, 3, 0).index)
    assert set(codes) == {0, 2, 3}


@pytest.mark.parametrize("room", [0, 300])
def test_a_run_whose_world_cannot_be_kept_ends_at_rest_and_says_so(run_command, monkeypatch, cells, room):
    disk = Disk(monkeypatch, WORLD)
    disk.room = room
    shown, left = run_command()
    assert cells[-1].arm.at_rest
    assert "no space left on device" in shown.stderr
    assert "Traceback" not in shown.output
    assert shown.exit_code == (3 if room else 2)
    if room:
        assert json.loads(shown.stdout) == json.loads((left / "result.json").read_text())
        assert json.loads(shown.stdout)["message"].endswith("could not be resumed after an interruption")
