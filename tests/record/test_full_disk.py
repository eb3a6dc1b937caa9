"""A disk that fills up at any moment of a run, on the command line: how it ends, and what is left."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from executive.cli.main import main
from executive.events import TargetSelected
from executive.record.journal import read_journal
from executive.record.picture_recorder import PictureRecorder
from executive.record.recorder import Recorder

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
def run(bring_one, tmp_path, monkeypatch, cells):
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
def test_wherever_the_disk_fills_up_the_run_ends_at_rest_and_says_so(run, monkeypatch, cells):
    disk = Disk(monkeypatch, RECORD)
    shown, whole = run()
    assert shown.exit_code == 0, shown.output
    kinds = [type(one.event).__name__ for one in read_journal(whole / "journal.jsonl")]
    codes = []
    while True:
        disk.room, disk.asked = len(codes), 0
        shown, left = run()
        if not disk.full:
            break
        codes.append(shown.exit_code)
        assert cells[-1].arm.at_rest
        assert "Traceback" not in shown.output
        assert "no space left on device" in shown.stderr
        assert left is None or not list(left.rglob(".*.part"))
        if shown.exit_code == 2:
            assert shown.stdout == ""
            assert left is None or not (left / "journal.jsonl").exists()
            continue
        result = json.loads(shown.stdout)
        if shown.exit_code == 0:
            # The run is over and recorded by then: only its report is missing.
            assert "note: no report was written: " in shown.stderr
            assert not (left / "report.html").exists()
            continue
        assert shown.exit_code == 3
        assert (result["status"], result["run"]) == ("FAULT", str(left))
        assert "no space left on device" in result["message"]
        # What stands in the journal is what came about, as far as it goes.
        recorded = [json.loads(line) for line in (left / "journal.jsonl").read_bytes().splitlines()]
        assert [entry["kind"] for entry in recorded] == kinds[: len(recorded)]
        assert not (left / "result.json").exists() or json.loads((left / "result.json").read_text()) == result
    # Where the run has not begun it is bad input: a place that cannot be written to.
    assert codes == sorted(codes, key=(2, 3, 0).index)
    assert (0 in codes, codes.count(2) > 5, codes.count(3) > len(kinds)) == (True, True, True)


@pytest.mark.parametrize("room", [0, 1, 300])
def test_wherever_the_world_cannot_be_kept_the_run_ends_at_rest_and_says_so(run, monkeypatch, cells, room):
    disk = Disk(monkeypatch, WORLD)
    disk.room = room
    shown, left = run()
    assert cells[-1].arm.at_rest
    assert "no space left on device" in shown.stderr
    assert "Traceback" not in shown.output
    assert shown.exit_code == (3 if room else 2)
    if room:
        assert json.loads(shown.stdout) == json.loads((left / "result.json").read_text())
        assert json.loads(shown.stdout)["message"].endswith("could not be resumed after an interruption")


def test_a_run_whose_directory_is_deleted_ends_at_rest_and_says_so(run, monkeypatch, cells):
    record = Recorder.__call__

    def steal(self, event):
        record(self, event)
        if isinstance(event.event, TargetSelected):
            shutil.rmtree(self._journal._path.parent)

    monkeypatch.setattr(Recorder, "__call__", steal)
    shown, left = run()
    assert (shown.exit_code, left) == (3, None)
    assert "another program deleted it during the run; the run stops" in json.loads(shown.stdout)["message"]
    assert "note: cannot write the result" in shown.stderr
    assert "no such file or directory; the journal in the same folder" in shown.stderr
    assert cells[-1].arm.at_rest
