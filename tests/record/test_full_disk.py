"""A disk that fills up at any moment of a run, on the command line: how it ends, and what is left."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from executive.cli.main import main
from executive.record.journal import read_journal
from executive.record.pictures.drawing_thread import PictureDrawer

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
    monkeypatch.setattr(PictureDrawer, "queue", lambda self, name, scene: True)

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
        if shown.exit_code == 3:
            result = json.loads(shown.stdout)
            assert (result["status"], result["run"]) == ("FAULT", str(left))
            assert read_journal(left / "journal.jsonl") is not None
    # A run that has not begun has bad input; a run that is over and recorded lacks only its report.
    assert codes == sorted(codes, key=(2, 3, 0).index)
    assert set(codes) == {0, 2, 3}


@pytest.mark.parametrize("room", [0, 300])
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
