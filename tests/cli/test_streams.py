"""Commands whose standard streams are closed, full or cut off."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.main import main
from executive.record.journal import find_run_end, read_journal

EXECUTIVE = f'"{sys.executable}" -m executive.cli.main'


def shell(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a line of bash in a folder."""
    return subprocess.run(["bash", "-c", command], cwd=folder, capture_output=True, text=True, timeout=120)


def run_with(streams: str, folder: Path, words: str = "sort_overhead --set cell.kind=fake --seed 3") -> dict:
    """Run a mission with redirected streams and return its result file and the exit code."""
    done = shell(f"{EXECUTIVE} run {words} --json --runs runs {streams}", folder)
    result = json.loads((folder / "runs/latest/result.json").read_text())
    result["exit_code"] = done.returncode
    return {key: result[key] for key in ("status", "items", "trace", "exit_code")}


@pytest.mark.slow
@pytest.mark.parametrize("streams", [">&-", "2>/dev/full", "2> >(head -3 >/dev/null)", "<&- >&- 2>&-"])
def test_a_stream_that_fails_changes_neither_run_nor_exit_code(streams: str, tmp_path: Path) -> None:
    expected = run_with(">/dev/null 2>/dev/null", tmp_path)
    assert expected["exit_code"] == 0
    assert run_with(streams, tmp_path) == expected


@pytest.mark.slow
@pytest.mark.parametrize("streams, error", [(">&-", ""), (">/dev/full", "No space left on device")])
def test_output_that_cannot_be_written_is_reported_once(streams: str, error: str, tmp_path: Path) -> None:
    done = shell(f"{EXECUTIVE} schema {streams}", tmp_path)
    assert done.returncode == 0
    assert done.stderr.count("note: ") == bool(error)
    assert error in done.stderr


@pytest.mark.slow
def test_an_error_is_an_error_although_nobody_can_read_it(tmp_path: Path) -> None:
    assert shell(f"{EXECUTIVE} run nowhere 2>&-", tmp_path).returncode == 2


@pytest.mark.slow
@pytest.mark.parametrize("ignored", [False, True])
def test_a_hangup_halts_a_run_unless_it_was_ignored_at_the_start(ignored: bool, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "executive.cli.main", "run", "sort_overhead", "--runs", str(tmp_path)]
    options = ["--set", "cell.kind=fake", "--realtime", "--quiet"]
    prefix = ["nohup"] if ignored else ["env", "--default-signal=HUP"]
    with subprocess.Popen([*prefix, *command, *options], stderr=subprocess.PIPE) as run:
        while not (journal := tmp_path / "latest/journal.jsonl").is_file() or len(journal.read_text()) < 5000:
            assert run.poll() is None
            time.sleep(0.05)
        run.send_signal(signal.SIGHUP)
        if ignored:
            time.sleep(0.3)
            assert run.poll() is None
            run.send_signal(signal.SIGTERM)
        assert run.wait(30) == 130
    end = find_run_end(read_journal(tmp_path / "latest/journal.jsonl"))
    assert end is not None and end.status == "HALTED"
    assert (
        json.loads(Path(os.path.realpath(tmp_path / "latest"), "result.json").read_text())["status"]
        == "HALTED"
    )


def test_control_characters_of_a_file_are_shown_escaped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text('mission: "\\e[2Jred"\ntree: "\\e]0;title\\a"\n')
    for words in (["check", "m.yaml"], ["check", "m.yaml", "--json"], ["run", "m.yaml"]):
        done = CliRunner().invoke(main, words)
        assert done.exit_code == 2
        assert "\\u001b]0;title\\u0007" in done.output
        assert not any(character in done.output for character in "\x1b\x07\x9b")
