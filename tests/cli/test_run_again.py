"""`executive run --resume` and `executive replay`, by the command line."""

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


def invoke(*words: str):
    return CliRunner().invoke(main, words)


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    return tmp_path / "runs"


def killed(runs: Path, seconds: float) -> Path:
    """Begin a mission in a process of its own, and kill it once it is so far on its clock."""
    command = [sys.executable, "-m", "executive.cli.main", "run", "sort_fruit", "--seed", "4", "--realtime"]
    process = subprocess.Popen([*command, "--quiet", "--runs", str(runs)], stderr=subprocess.DEVNULL)
    journal = runs / "latest" / "journal.jsonl"
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        lines = journal.read_text().splitlines() if journal.exists() else []
        if len(lines) > 2 and json.loads(lines[-2])["clock"] > seconds:
            break
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    return (runs / "latest").resolve()


def test_a_killed_run_is_taken_up_again_and_ends(runs: Path) -> None:
    path = killed(runs, 1.0)
    assert not (path / "result.json").exists()
    done = invoke("run", "--resume", "latest", "--runs", str(runs), "--json")
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert (result["status"], result["seed"], result["run"]) == ("SUCCESS", 4, str(path))
    assert "sort_fruit.yaml --seed 4" in done.stderr
    again = invoke("replay", path.name, "--runs", str(path.parent), "--json")
    assert (again.exit_code, json.loads(again.stdout)["same"]) == (0, True)
    assert invoke("run", "--resume", str(path)).exit_code == 2


def test_while_it_goes_on_nobody_else_takes_it_up(runs: Path) -> None:
    command = [sys.executable, "-m", "executive.cli.main", "run", "sort_fruit", "--realtime", "--quiet"]
    process = subprocess.Popen([*command, "--runs", str(runs)], stderr=subprocess.DEVNULL)
    try:
        while not (runs / "latest" / "journal.jsonl").exists():
            time.sleep(0.02)
        time.sleep(0.2)
        refused = invoke("run", "--resume", "latest", "--runs", str(runs))
        assert refused.exit_code == 2
        assert str(process.pid) in refused.output
    finally:
        process.kill()
        process.wait()


def test_a_replay_says_what_is_decided_otherwise(runs: Path, tmp_path: Path) -> None:
    assert invoke("run", "sort_fruit", "--seed", "4", "--quiet", "--runs", str(runs)).exit_code == 0
    path = (runs / "latest").resolve()
    same = invoke("replay", "latest", "--runs", str(runs))
    assert same.exit_code == 0
    assert f"decisions, all as recorded ({path})" in same.stderr
    edited = path / "edited.yaml"
    edited.write_text((path / "mission.yaml").read_text().replace("prefer: surest", "prefer: nearest"))
    other = invoke("replay", str(path), "--mission", str(edited), "--json")
    assert other.exit_code == 1
    told = json.loads(other.stdout)
    assert (told["same"], told["edited"], told["recorded"]["kind"]) == (False, True, "decision")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ((), "name a MISSION, or a run to take up again with --resume RUN"),
        (
            ("sort_fruit", "--resume", "latest"),
            "--resume takes mission, seed, params and requests from the run",
        ),
        (
            ("--resume", "latest", "--seed", "3"),
            "--resume takes mission, seed, params and requests from the run",
        ),
        (("--resume", "nowhere"), '"nowhere" is no run directory'),
    ],
)
def test_what_makes_no_sense_is_refused(words: tuple[str, ...], sentence: str, tmp_path: Path) -> None:
    refused = invoke("run", *words, "--runs", str(tmp_path))
    assert refused.exit_code == 2
    assert sentence in refused.output
