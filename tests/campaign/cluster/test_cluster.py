"""A sweep on a dask scheduler with workers on this computer."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import pytest

from executive.campaign.pool import JobOptions
from executive.campaign.results.rows import RunRow
from executive.campaign.results.sweep_folder import create_sweep, make_settings
from executive.campaign.sweep import run_sweep
from executive.campaign.sweep_job import list_jobs
from executive.errors import InputError

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow
FAKE = {"cell.kind": "fake", "cell.table.objects": "[1, 2]"}
SEEDS = range(6)


def start_dask(folder: Path, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "dask", *words, "--no-dashboard"]
    return subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True)


def wait_for(stream: IO[str] | None, pattern: str) -> str:
    """Read the log of a program up to a line that contains the pattern, and return the first group."""
    assert stream is not None
    log = ""
    for line in stream:
        log += line
        if match := re.search(pattern, line):
            return match[1]
    raise AssertionError(log)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """Address of a scheduler, and its two workers; without a nanny, a killed worker stays dead."""
    scheduler = start_dask(tmp_path, "scheduler", "--host", "127.0.0.1", "--port", "0")
    processes = [scheduler]
    try:
        address = wait_for(scheduler.stderr, r"Scheduler at:\s*(tcp://\S+)")
        words = ("worker", address, "--nthreads", "1", "--no-nanny", "--local-directory", str(tmp_path / "w"))
        processes += [start_dask(tmp_path, *words) for _ in range(2)]
        for worker in processes[1:]:
            wait_for(worker.stderr, r"(Registered to)")
        yield address, processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def sweep(folder: Path, cluster: str | None = None, **options: Any) -> list[RunRow]:
    with closing(create_sweep(make_settings("sort_fruit", SEEDS, FAKE, {}, None, False), folder)) as database:
        jobs = list_jobs(database.settings, database.path.parent)
        run_sweep(jobs, database, JobOptions(**options), cluster)
        assert [row.run_index for row in database.read_items() if row.state != "placed"] == []
        return database.read_runs()


def test_a_killed_worker_costs_only_time(cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    address, workers = cluster
    monkeypatch.chdir(tmp_path)
    kills = iter([workers[0]])

    def kill(done: int, asked: int) -> None:
        if done >= 1 and (worker := next(kills, None)):
            os.kill(worker.pid, signal.SIGKILL)

    remote = sweep(tmp_path / "remote", cluster=address, on_progress=kill)
    assert next(kills, None) is None
    local = sweep(tmp_path / "local")

    def strip(row: RunRow) -> RunRow:
        return replace(row, wall_time_s=0.0, run_directory="")

    assert list(map(strip, remote)) == list(map(strip, local))
    assert [row.status for row in remote] == ["SUCCESS"] * len(SEEDS)
    for one, other in zip(remote, local, strict=True):
        journals = [(Path(row.run_directory) / "journal.jsonl").read_bytes() for row in (one, other)]
        assert journals[0] == journals[1]
        assert str(tmp_path / "w") not in (Path(one.run_directory) / "result.json").read_text(
            encoding="utf-8"
        )


def test_a_scheduler_without_workers_or_with_other_software_gives_an_explanation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scheduler = start_dask(tmp_path, "scheduler", "--host", "127.0.0.1", "--port", "0")
    try:
        address = wait_for(scheduler.stderr, r"Scheduler at:\s*(tcp://\S+)")
        with pytest.raises(InputError, match=r"has no workers; start one: `dask worker tcp://127"):
            sweep(tmp_path / "runs", cluster=address)
    finally:
        scheduler.kill()
        scheduler.communicate()
    with pytest.raises(InputError, match=r"cannot be reached: .*; start it with `dask scheduler`"):
        sweep(tmp_path / "runs", cluster=address)
