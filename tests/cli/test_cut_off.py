"""`executive sweep` in a process of its own, interrupted long before its last seed, and resumed."""

from __future__ import annotations

import json
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from executive.cli.main import main

OBJECTS = ("--set", "cell.table.objects=[1, 1]")


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
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_it_says_at_once_that_it_halts_and_then_how_far_it_came(tmp_path: Path, how: signal.Signals) -> None:
    words = ["sweep", "sort_fruit", "--seeds", "1-400", "--workers", "1", "--json", "--runs", str(tmp_path)]
    with start(*words) as sweep:
        wait_for_runs(sweep, tmp_path, 1)
        sweep.send_signal(how)
        shown, said = sweep.communicate()
    assert sweep.returncode == 130
    figures = json.loads(shown)
    assert (figures["planned_run_count"], figures["is_incomplete"]) == (400, True)
    success = figures["variants"][0]["success"]
    run_count, success_count = len(figures["runs"]), success["numerator"]
    assert 1 <= run_count == success["denominator"] < 400
    halting, summary = said.index("halting: no new runs start"), said.index(" of 400 runs; ")
    assert halting < summary
    assert f"halted after {run_count} of 400 runs; {success_count} of the {run_count} succeeded" in said


def invoke(*words: str) -> Result:
    return CliRunner().invoke(main, words)


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
