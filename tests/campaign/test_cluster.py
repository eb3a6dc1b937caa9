"""Sweeps on a cluster: the files that travel to a worker, the process there, and a dask scheduler."""

from __future__ import annotations

import io
import os
import re
import shutil
import signal
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from executive.campaign.cluster import (
    FILES_KEY,
    PACKAGES_FOLDER,
    BundlePlugin,
    check_environment,
    describe_environment,
    make_bundle,
    unpack_run,
)
from executive.campaign.jobs import JobOptions, SweepJob, list_jobs, run_job
from executive.campaign.results import RunRow
from executive.campaign.sweep import create_sweep, make_settings, run_sweep
from executive.errors import InputError

FAKE = {"cell.kind": "fake", "cell.table.objects": "[1, 2]"}
SEEDS = range(6)
WAVE = '''
from executive.skill import Skill

class Wave(Skill):
    """Wait for a step."""

    def run(self, cell):
        """Wait for a step."""
        yield
'''
MISSION = "mission: wave\ncell: cells/mine.yaml\nroutes: {cube: red_bin}\ntree: Wave\n"


@pytest.fixture
def project(tmp_path: Path, missions: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project in the working directory: a skill, a mission, and a cell with a base and further files."""
    folder = tmp_path / "project"
    files = {
        "pyproject.toml": '[project]\nname = "mine"\n[project.entry-points."executive.skills"]\n'
        'Wave = "mine_wave.wave:Wave"\n',
        "mine_wave/__init__.py": "",
        "mine_wave/wave.py": WAVE,
        "wave.yaml": MISSION,
        "cells/mine.yaml": "base: bases/first.yaml\ncell: mine\nkind: fake\n# labels: 'my labels.txt'\n",
        "cells/bases/first.yaml": (missions / "cells" / "overhead.yaml").read_text(encoding="utf-8"),
        "cells/bases/arms/iiwa14.yaml": (missions / "arms" / "iiwa14.yaml").read_text(encoding="utf-8"),
        "cells/mine.measured.json": "[]",
        "cells/my labels.txt": "cube\n",
        "cells/unused.txt": "",
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [*sys.path])
    # A module of the project of the previous test would be found in that project.
    for module in ("mine_wave", "mine_wave.wave"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    return folder


def list_sweep_jobs(folder: Path, cell: str = "") -> list[SweepJob]:
    settings = make_settings("wave.yaml", range(2), {}, {}, None, False, cell)
    with closing(create_sweep(settings, folder)) as database:
        return list_jobs(database.settings, database.path.parent)


def test_all_files_of_the_runs_travel_and_no_others(project: Path) -> None:
    bundle = make_bundle(list_sweep_jobs(Path("runs")))
    names = set(zipfile.ZipFile(io.BytesIO(bundle)).namelist())
    expected = {str(file) for file in project.rglob("*.*") if file.suffix not in (".py", ".sqlite")}
    expected.remove(f"{project}/cells/unused.txt")
    assert {name for name in names if name.startswith(str(project))} == expected
    assert {f"{PACKAGES_FOLDER}/mine_wave/{name}.py" for name in ("__init__", "wave")} <= names
    assert make_bundle(list_sweep_jobs(Path("runs"))) == bundle


def test_an_absolute_path_to_a_file_is_refused(project: Path) -> None:
    jobs = list_sweep_jobs(Path("runs"))
    cell = project / "cells" / "mine.yaml"
    cell.write_text(f"{cell.read_text()}# {project}/cells/unused.txt\n")
    with pytest.raises(InputError, match=r"mine.yaml names .*unused.txt\", a path that workers may not"):
        make_bundle(jobs)


@pytest.mark.slow
def test_a_worker_runs_a_skill_of_another_package_on_another_cell(project: Path, tmp_path: Path) -> None:
    stand = tmp_path / "stand.yaml"
    stand.write_text("base: overhead.yaml\ncell: stand\nkind: fake\n")
    jobs = list_sweep_jobs(tmp_path / "runs", str(stand))
    local = run_job(jobs[0])
    plugin = BundlePlugin(make_bundle(jobs), describe_environment())
    worker = SimpleNamespace(local_directory=str(tmp_path))
    plugin.setup(worker)  # type: ignore[arg-type]
    shutil.rmtree(project / "mine_wave")
    try:
        first, second = (plugin.execute(jobs[0]) for _ in range(2))
    finally:
        plugin.teardown(worker)  # type: ignore[arg-type]
    remote = unpack_run(first)
    assert local.run.status == "SUCCESS"
    assert "cell: stand\n" in (Path(remote.run.run_directory) / "cell.yaml").read_text()
    assert (remote.run.status, remote.run.decision_hash) == (local.run.status, local.run.decision_hash)
    journals = {(Path(one.run.run_directory) / "journal.jsonl").read_bytes() for one in (local, remote)}
    assert len(journals) == 1
    # Both runs of the worker may have the name of the local run.
    assert len({local.run.run_directory, remote.run.run_directory, unpack_run(second).run.run_directory}) == 3


def test_a_worker_with_other_software_is_described() -> None:
    worker: Any = SimpleNamespace(address="tcp://there")
    here = describe_environment()
    check_environment(here, worker)
    client = {**here, "numpy": "1.0", "more": "2", FILES_KEY: "0"}
    differences = f"numpy {here['numpy']} instead of 1.0, .*{FILES_KEY} .* instead of 0, more missing instead"
    with pytest.raises(InputError, match=differences):
        check_environment(client, worker)


def start_dask(folder: Path, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "dask", *words, "--no-dashboard"]
    return subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True)


def wait_for(log: Any, pattern: str) -> str:
    """Read the log of a program up to a line that contains the pattern, and return the first group."""
    return next(match[1] for line in log if (match := re.search(pattern, line)))


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
        run_sweep(database, JobOptions(**options), cluster)
        rows = database.read_runs()
        assert [row.run_index for row in rows if row.items.placed != row.items.seen] == []
        return rows


@pytest.mark.slow
def test_a_killed_worker_costs_only_time(
    cluster: tuple[str, list[subprocess.Popen[str]]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address, workers = cluster
    monkeypatch.chdir(tmp_path)
    remote = sweep(
        tmp_path / "remote", address, on_progress=lambda *_: os.kill(workers[0].pid, signal.SIGKILL)
    )
    local = sweep(tmp_path / "local")
    assert [row.status for row in remote] == ["SUCCESS"] * len(SEEDS)
    for one, other in zip(remote, local, strict=True):
        assert replace(one, wall_time_s=other.wall_time_s, run_directory=other.run_directory) == other
        journals = [(Path(row.run_directory) / "journal.jsonl").read_bytes() for row in (one, other)]
        assert journals[0] == journals[1]
        assert str(tmp_path / "w") not in (Path(one.run_directory) / "result.json").read_text(
            encoding="utf-8"
        )


@pytest.mark.slow
def test_a_scheduler_without_workers_and_none_at_all_are_explained(tmp_path: Path) -> None:
    scheduler = start_dask(tmp_path, "scheduler", "--host", "127.0.0.1", "--port", "0")
    try:
        address = wait_for(scheduler.stderr, r"Scheduler at:\s*(tcp://\S+)")
        with pytest.raises(InputError, match="has no workers"):
            sweep(tmp_path / "runs", address)
    finally:
        scheduler.kill()
        scheduler.communicate()
    with pytest.raises(InputError, match=r"cannot be reached: .*; start it with `dask scheduler`"):
        sweep(tmp_path / "runs", address)


def test_without_the_extra_the_error_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "executive.campaign.cluster", raising=False)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match="uv sync --extra cl"):
        sweep(tmp_path, "tcp://127.0.0.1:1")
