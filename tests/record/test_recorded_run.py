"""A run with its record, on a runtime that only pretends."""

from __future__ import annotations

import json
import sys
from types import ModuleType, SimpleNamespace

import py_trees
import pytest

from executive.errors import InputError
from executive.events import Event
from executive.record.journal import read_journal
from executive.record.recorded_run import recorded_run
from executive.runtime.outcome import Outcome


class PretendedRun:
    """Emits two events and ends; what a test wants otherwise it sets on the class."""

    error: BaseException | None = None
    closed = 0
    root = py_trees.behaviours.Success("tree")
    control = SimpleNamespace(pause=lambda: None)

    def __init__(self, loaded, skills, *, seed, gui, realtime, requests, keyboard, kind):
        self._observers = []

    def observe(self, observer):
        self._observers.append(observer)

    def record(self, recorder):
        self._observers.append(recorder)

    def log_to(self, path):
        path.write_bytes(b"the world")

    def execute(self):
        for event in (Event("run", 0, 0.0, {"seed": 7}), Event("decision", 3, 0.1, {"item": "cube-1"})):
            for observer in self._observers:
                observer(event)
        if self.error is not None:
            raise self.error
        return Outcome("SUCCESS", "", "", "", "", 240, 1.0)

    def items(self):
        return {"seen": 1, "placed": 1, "rejected": 0, "lost": 0, "phantom": 0, "rows": []}

    def audit(self):
        return {"right": 1, "wrong_bin": 0, "left": 0, "elsewhere": 0, "unseen": 0}

    def close(self):
        type(self).closed += 1


class Watcher:
    def __init__(self):
        self.seen = []

    def open(self, run):
        self.seen.append(run.root)

    def __call__(self, event):
        self.seen.append(event.kind)

    def close(self):
        self.seen.append("closed")

    def note(self, sentence):
        self.seen.append(sentence)


@pytest.fixture
def runtime(monkeypatch):
    class Runtime(PretendedRun):
        pass

    module = ModuleType("executive.runtime.run")
    module.Run = Runtime  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "executive.runtime.run", module)
    return Runtime


LOADED = SimpleNamespace(
    text="mission: sort\n",
    params={"attempts": 3},
    libraries={"library/own.yaml": "library: own\n"},
    mission=SimpleNamespace(name="sort"),
    cell_config=SimpleNamespace(model_dump=lambda mode, exclude_unset: {"cell": "overhead"}),
)


def test_leaves_a_directory_that_explains_the_run(tmp_path, runtime):
    result = recorded_run(LOADED, {}, seed=7, runs=tmp_path)
    left = tmp_path / "latest"
    names = {path.name for path in left.iterdir()}
    assert names == {
        "mission.yaml", "library", "params.yaml", "cell.yaml", "tree.json", "journal.jsonl", "world.log",
        "result.json",
    }  # fmt: skip
    assert json.loads((left / "result.json").read_text()) == result
    assert [entry["kind"] for entry in read_journal(left / "journal.jsonl")] == ["run", "decision"]
    assert result["items"] == {"seen": 1, "placed": 1, "rejected": 0, "lost": 0, "phantom": 0}
    assert runtime.closed == 1


def test_a_view_is_told_the_tree_first_and_the_end_last(tmp_path, runtime):
    view, other = Watcher(), Watcher()
    recorded_run(LOADED, {}, seed=7, runs=tmp_path, views=[view, other])
    assert view.seen == other.seen == [PretendedRun.root, "run", "decision", "closed"]


@pytest.mark.parametrize("error", [InputError("no such weights"), KeyboardInterrupt()])
def test_whatever_ends_a_run_early_view_journal_and_cell_are_closed(tmp_path, runtime, error):
    runtime.error = error
    view, other = Watcher(), Watcher()
    with pytest.raises(type(error)):
        recorded_run(LOADED, {}, seed=7, runs=tmp_path, views=[view, other])
    assert view.seen[-1] == other.seen[-1] == "closed"
    assert runtime.closed == 1
    assert len(read_journal(tmp_path / "latest" / "journal.jsonl")) == 2
