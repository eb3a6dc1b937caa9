"""Two runs in one directory, and what is said to the second."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from executive.errors import InputError
from executive.record import journal as module
from executive.record.journal import Journal

HOLD = (
    "import sys; from pathlib import Path; from executive.record.journal import Journal\n"
    "journal = Journal(Path(sys.argv[1])); print('open', flush=True); sys.stdin.read()"
)


@pytest.fixture
def holder(tmp_path):
    """A process that writes the journal in `tmp_path`."""
    command = [sys.executable, "-c", HOLD, tmp_path / "journal.jsonl"]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    with process:
        assert process.stdout is not None
        process.stdout.readline()
        yield process
        process.kill()


def refusal(path: Path, **how: bool) -> str:
    with pytest.raises(InputError) as raised:
        Journal(path, **how)
    return str(raised.value)


def test_a_second_run_is_refused_with_the_process_that_writes(tmp_path, holder):
    assert refusal(tmp_path / "journal.jsonl") == (
        f'the run directory "{tmp_path}" is in use: process {holder.pid} writes its journal, and two runs '
        f'cannot share it; wait until that run has ended, or stop it with "kill {holder.pid}"'
    )


def test_where_nobody_tells_which_process_it_is_it_is_another(tmp_path, holder, monkeypatch):
    monkeypatch.setattr(module, "LOCK_LIST", tmp_path / "none")
    assert "is in use: another process writes its journal" in refusal(tmp_path / "journal.jsonl", resume=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    "line",
    ["POSIX  ADVISORY  WRITE {pid} {file}", "FLOCK  ADVISORY  WRITE {pid} 00:00:1",
     "FLOCK  ADVISORY  WRITE 0 {file}", "FLOCK  ADVISORY  WRITE -1 {file}",
     "-> FLOCK  ADVISORY  WRITE {pid} {file}"],
)  # fmt: skip
def test_a_process_that_holds_another_lock_is_not_named(tmp_path, holder, monkeypatch, line):
    monkeypatch.setattr(module, "LOCK_LIST", tmp_path / "locks")
    state = (tmp_path / "journal.jsonl").stat()
    file = f"{os.major(state.st_dev):02x}:{os.minor(state.st_dev):02x}:{state.st_ino}"
    module.LOCK_LIST.write_text(f"1: {line} 0 EOF\n\n".format(pid=holder.pid, file=file))
    assert "another process" in refusal(tmp_path / "journal.jsonl", resume=True)


def test_the_lock_is_given_up_when_the_journal_is_closed_and_not_before(tmp_path):
    path = tmp_path / "journal.jsonl"
    with closing(Journal(path)):
        assert f"process {os.getpid()} writes" in refusal(path)
    Journal(path, resume=True).close()
