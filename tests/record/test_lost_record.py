"""What takes the record away while a run goes on: each time a sentence, and the arm at rest."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from executive.discovery import discover
from executive.errors import InputError
from executive.mission.load import load_mission
from executive.record.journal import ending_of, read_journal
from executive.record.recorded_run import recorded_run
from executive.record.recorder import Recorder
from executive.record.run_directory import RunDirectory
from executive.runtime.cells import cell_kind

SMALL = {"cell.kind": "fake", "cell.table.objects": "[1, 1]"}


class Thief:
    """A view that does something to the record as soon as the arm is about to grasp."""

    items: dict = {}  # noqa: RUF012

    def __init__(self, does):
        self._does = does
        self.notes = []

    def __call__(self, event):
        if event.kind == "status" and event.data["node"].endswith("/Grasp") and self._does:
            does, self._does = self._does, None
            does()

    def open(self, run):
        pass

    def close(self):
        pass

    def note(self, sentence):
        self.notes.append(sentence)


@pytest.fixture
def run(bring_one, tmp_path, cells):
    """Run the mission once, with something done to its directory before the grasp."""
    skills = discover()

    def once(does=None, *, frames=False):
        loaded = load_mission(bring_one, skills, SMALL, cell_kind)
        view = Thief(does)
        runs = tmp_path / "runs"
        return recorded_run(loaded, skills, seed=1, runs=runs, views=[view], frames=frames), view.notes

    return once


def test_a_journal_deleted_meanwhile_ends_the_run(run, tmp_path, cells):
    result, _ = run(lambda: (tmp_path / "runs" / "latest" / "journal.jsonl").unlink())
    assert (result["status"], result["reason"]) == ("FAULT", "fault")
    assert "it was deleted while the run went on; the run stops because it could not be" in result["message"]
    assert cells[0].arm.at_rest
    assert json.loads((tmp_path / "runs" / "latest" / "result.json").read_text()) == result


def test_pictures_that_cannot_be_written_end_nothing(run, tmp_path):
    directory = tmp_path / "runs" / "latest"

    def put_a_file_there():
        frames = directory / "frames"
        while not frames.is_file():
            # Moved and not deleted: somebody may be writing a picture into it at this moment.
            if frames.is_dir():
                frames.rename(directory / "moved")
            frames.touch()

    result, notes = run(put_a_file_there, frames=True)
    assert result["status"] == "SUCCESS"
    (note,) = notes
    assert note.startswith(("not every picture was drawn: ", "no pictures were drawn: "))
    assert ending_of(read_journal(directory / "journal.jsonl"))


def forbidden(does) -> str:
    """Return what a user who may do nothing is told."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            if os.getuid() == 0:
                os.setuid(65534)
            does()
        except InputError as error:
            os.write(writer, str(error).encode())
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as told:
        said = told.read()
    os.waitpid(child, 0)
    return said


def test_whoever_may_not_write_there_is_told(tmp_path):
    directory = RunDirectory(tmp_path / "runs" / "day" / "run")
    directory.path.mkdir(parents=True)
    directory.journal.write_text("{}\n")
    directory.journal.chmod(0o444)
    directory.path.chmod(0o555)
    inputs = {"mission": "", "params": {}, "cell": {}}
    assert forbidden(lambda: directory.save_inputs(**inputs)) == (
        f'cannot write to the run directory "{directory.path}": permission denied; '
        "name another place with --runs DIR"
    )
    assert forbidden(lambda: Recorder(directory, again=True)) == (
        f'cannot open the journal "{directory.journal}": permission denied'
    )
    assert read_journal(directory.journal) == [{}]


def limited(mission: str, size: int, *words: str) -> subprocess.CompletedProcess[str]:
    """Run the command where no file may be longer than so many bytes."""
    settings = [word for key, value in SMALL.items() for word in ("--set", f"{key}={value}")]
    return subprocess.run(
        [sys.executable, "-m", "executive.cli.main", "run", mission, "--json", *settings, *words],
        cwd=Path(mission).parent, capture_output=True, text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
    )  # fmt: skip


@pytest.mark.slow
def test_a_journal_for_which_there_is_no_more_room_ends_the_run_on_the_command_line(bring_one, tmp_path):
    shown = limited(bring_one, 6000)
    assert shown.returncode == 3
    result = json.loads(shown.stdout)
    assert result["status"] == "FAULT"
    assert "file too large; the run stops because it could not be explained afterwards" in result["message"]
    assert (
        "next        free some space on the disk of the run directory, or name another place" in shown.stderr
    )
    assert "whole traceback" not in shown.stderr
    assert "mend what is broken" not in shown.stderr
    assert "go on       executive run --resume" in shown.stderr
    assert "Traceback" not in shown.stderr
    latest = tmp_path / "runs" / "latest"
    assert json.loads((latest / "result.json").read_text()) == result
    entries = [json.loads(line) for line in (latest / "journal.jsonl").read_text().splitlines()]
    assert entries == read_journal(latest / "journal.jsonl")
    assert entries[0]["kind"] == "run"
    assert ending_of(entries) is None
