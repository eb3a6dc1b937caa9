"""`executive sweep` in a process of its own, interrupted long before its last seed, and resumed."""

from __future__ import annotations

import json
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest
from at_terminal import invoke

OBJECTS = ("--set", "cell.kind=fake", "--set", "cell.table.objects=[1, 1]")


def start(*words: str) -> subprocess.Popen[str]:
    # What a shell runs in the background begins with SIGINT ignored, and so does what this test starts there.
    listening = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    command = [sys.executable, "-c", f"{listening}; from executive.cli.main import main; main()", *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def count_stored(folder: Path) -> int:
    """Return the number of stored runs of the only sweep in a folder."""
    files = list(folder.glob("*/*_sweep_*/results.sqlite"))
    if not files or not files[0].stat().st_size:
        return 0
    with closing(sqlite3.connect(files[0])) as connection:
        return connection.execute("SELECT COUNT(*) FROM runs").fetchone()[0]


def wait_for_runs(sweep: subprocess.Popen[str], folder: Path, count: int) -> None:
    while count_stored(folder) < count:
        assert sweep.poll() is None
        time.sleep(0.02)


@pytest.mark.slow
def test_a_killed_sweep_resumes_with_the_missing_runs_only(tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    with start("sweep", "sort_fruit", *OBJECTS, "--seeds", "0:12", "--runs", str(runs)) as sweep:
        wait_for_runs(sweep, runs, 3)
        sweep.kill()
        sweep.communicate()
    (database,) = runs.glob("*/*_sweep_*/results.sqlite")
    with closing(sqlite3.connect(database)) as connection:
        stored = connection.execute("SELECT * FROM runs ORDER BY run_index").fetchall()
    assert 3 <= len(stored) < 12
    resumed = invoke("sweep", "--resume", str(database.parent), "--json")
    assert resumed.exit_code == 0, resumed.stderr
    figures = json.loads(resumed.stdout)
    assert [run["seed"] for run in figures["runs"]] == list(range(12))
    with closing(sqlite3.connect(database)) as connection:
        rows = connection.execute("SELECT * FROM runs ORDER BY run_index").fetchall()
    assert set(stored) <= set(rows), "no stored run was run again"
    again = json.loads(
        invoke("sweep", "sort_fruit", *OBJECTS, "--seeds", "0:12", "--json", "--runs", str(runs)).stdout
    )
    names = ("seed", "status", "items", "audit", "robot_time_s", "ticks", "decision_hash", "planning")
    assert [[run[name] for name in names] for run in figures["runs"]] == [
        [run[name] for name in names] for run in again["runs"]
    ]
    assert invoke("sweep", "--resume", str(database)).exit_code == 0, "nothing is missing"
