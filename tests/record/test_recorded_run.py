"""A run with its record, on the fake cell, also on a disk that fills up at any moment."""

from __future__ import annotations

import json
import os
from pathlib import Path
from unittest.mock import Mock

import py_trees
import pytest
from at_terminal import invoke
from click.testing import Result

from executive.behaviours import load_skills
from executive.cell.json_values import to_json
from executive.errors import InputError
from executive.events import RunEnded, RunStarted, TargetSelected
from executive.mission.load import load_mission
from executive.record.journal import Journal, read_journal
from executive.record.picture_recorder import PictureRecorder
from executive.record.recorded_run import GuardedView, RecordOptions, record_run
from executive.run.assembly import RunOptions
from executive.run.run import Run
from executive.testing.fake_cell import FakeCell


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
    events = list(read_journal(left / "journal.jsonl"))
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

    monkeypatch.setattr(Run, "execute", fails)
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


class Disk:
    """Takes so many blocks of the log of the world, and then no more."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, room: int) -> None:
        self.room = room
        self.write = os.pwrite
        monkeypatch.setattr(os, "pwrite", self.write_or_fail)

    def write_or_fail(self, *args):
        self.room -= 1
        if self.room < 0:
            raise OSError(28, "No space left on device")
        return self.write(*args)


@pytest.fixture
def run_command(bring_one, tmp_path, monkeypatch, drivers):
    """Run the command once, without pictures; the result, and the directory that it left, if any."""
    monkeypatch.setattr(PictureRecorder, "__call__", lambda self, timed: None)

    def once() -> tuple[Result, Path | None]:
        before = set(tmp_path.glob("runs/[0-9]*/*"))
        few = ("--set", "cell.kind=fake", "--set", "cell.table.objects=[1, 1]")
        words = ["run", bring_one, "--runs", str(tmp_path / "runs"), *few, "--json"]
        shown = invoke(*words)
        (left,) = set(tmp_path.glob("runs/[0-9]*/*")) - before or {None}
        return shown, left

    return once


@pytest.mark.parametrize("room", [0, 300])
def test_a_run_whose_world_cannot_be_kept_ends_at_rest_and_says_so(run_command, monkeypatch, drivers, room):
    Disk(monkeypatch, room)
    shown, left = run_command()
    assert drivers[-1].arm.at_rest
    assert "no space left on device" in shown.stderr
    assert "Traceback" not in shown.output
    assert shown.exit_code == (3 if room else 2)
    if room:
        assert json.loads(shown.stdout) == json.loads((left / "result.json").read_text())
        assert json.loads(shown.stdout)["message"].endswith("could not be resumed after an interruption")
