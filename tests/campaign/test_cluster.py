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
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from executive.campaign.cluster import (
    FILES_KEY,
    PACKAGES_FOLDER,
    BundlePlugin,
    ReturnedRun,
    check_environment,
    describe_environment,
    list_bundle,
    make_bundle,
    pack_run,
    run_jobs_on_cluster,
    unpack_run,
)
from executive.campaign.jobs import JobOptions, SweepJob, list_jobs, run_job
from executive.campaign.results import RunRecord, RunRow
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
MISSION = "mission: wave\ncell: cells/mine.yaml\nroutes: {cube: red_bin}\ntree: Wave  # cells/unused.txt\n"


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
        "cells/mine.yaml": "base: bases/first.yaml\ncell: mine\nkind: fake\n# .env, unused.txt, ../.env\n"
        "objects: {cube: {urdf: models/cube.urdf, height: 0.05, radius: 0.0354}}\n"
        "detectors: {own: {kind: rfdetr, model_path: m.onnx, labels: my labels.txt}}\n",
        "cells/models/cube.urdf": "<robot><!-- 'cells/unused.txt' --><mesh filename='cube.obj'/></robot>",
        "cells/models/cube.obj": "# unused.txt\nmtllib cube.mtl\n",
        "cells/models/cube.mtl": "map_Kd -s 1 1 1 wood.png\n",
        "cells/models/wood.png": "",
        "cells/m.onnx": "",
        "cells/bases/first.yaml": (missions / "cells" / "overhead.yaml").read_text(encoding="utf-8"),
        "cells/bases/arms/iiwa14.yaml": (missions / "arms" / "iiwa14.yaml").read_text(encoding="utf-8"),
        "cells/mine.measured.json": "[]",
        "cells/my labels.txt": "cube\n",
        "cells/unused.txt": "",
        ".env": "",
        "mine_wave/.env": "",
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
    settings = list_sweep_jobs(Path("runs"))[0].settings
    bundle = make_bundle(settings)
    names = set(zipfile.ZipFile(io.BytesIO(bundle)).namelist())
    files = {file for file in project.rglob("*.*") if file.suffix not in (".py", ".sqlite")}
    expected = {str(file) for file in files if file.name not in ("unused.txt", ".env")}
    assert {name for name in names if name.startswith(str(project))} == expected
    packages = {name for name in names if name.startswith(f"{PACKAGES_FOLDER}/mine_wave")}
    assert packages == {f"{PACKAGES_FOLDER}/mine_wave/{name}.py" for name in ("__init__", "wave")}
    assert make_bundle(settings) == bundle


@pytest.mark.parametrize(
    "name", ["cells/m.onnx", "cells/models/cube.mtl", "cells/mine.measured.json", "mine_wave/more.txt"]
)
def test_a_link_to_a_file_outside_is_refused(name: str, project: Path) -> None:
    settings = list_sweep_jobs(Path("runs"))[0].settings
    (project / name).unlink(missing_ok=True)
    (project / name).symlink_to(project / ".env")
    with pytest.raises(InputError, match="outside"):
        list_bundle(settings)


@pytest.mark.slow
def test_a_worker_runs_a_skill_of_another_package_on_another_cell(project: Path, tmp_path: Path) -> None:
    stand = tmp_path / "stand.yaml"
    stand.write_text("base: overhead.yaml\ncell: stand\nkind: fake\n")
    jobs = list_sweep_jobs(tmp_path / "runs", str(stand))
    local = run_job(jobs[0])
    plugin = BundlePlugin(make_bundle(jobs[0].settings), describe_environment())
    worker = SimpleNamespace(local_directory=str(tmp_path))
    plugin.setup(worker)  # type: ignore[arg-type]
    shutil.rmtree(project / "mine_wave")
    try:
        first, second = (plugin.execute(jobs[0]) for _ in range(2))
    finally:
        plugin.teardown(worker)  # type: ignore[arg-type]
    remote = unpack_run(first, jobs[0])
    assert local.run.status == "SUCCESS"
    assert "cell: stand\n" in (Path(remote.run.run_directory) / "cell.yaml").read_text()
    assert (remote.run.status, remote.run.decision_hash) == (local.run.status, local.run.decision_hash)
    journals = {(Path(one.run.run_directory) / "journal.jsonl").read_bytes() for one in (local, remote)}
    assert len(journals) == 1
    # Both runs of the worker may have the name of the local run.
    again = unpack_run(second, jobs[0])
    assert len({local.run.run_directory, remote.run.run_directory, again.run.run_directory}) == 3


def make_job(runs_folder: Path) -> Any:
    return SimpleNamespace(index=0, seed=0, variant={}, runs_folder=runs_folder)


@pytest.mark.parametrize(
    ("file", "folder"),
    [("result.json", folder) for folder in ("../../day/run", "run", "../b/day/run", "a/day/run", ".", "..")]
    + [(file, "day/run") for file in ("../x.json", "/x.json", ".bashrc", "a/.b/x.json", "x.py", "a\\b.json")]
    + [(file, "day/run") for file in ("a/../../x.json", "x.json/", "x", "x.html.sh", "huge.json")],
)
def test_a_returned_run_stays_in_its_folder(
    file: str, folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.campaign.cluster.MAX_RUN_SIZE", 10)
    job = make_job(tmp_path / "a" / "runs")
    run = RunRow(run_index=0, seed=0, status="SUCCESS", run_directory=f"/root{job.runs_folder}/{folder}")
    with zipfile.ZipFile(tmp_path / "zip", "w") as archive:
        archive.writestr(file, b" " * (11 if file == "huge.json" else 5))
    with pytest.raises(InputError, match="a worker returned"):
        unpack_run(ReturnedRun("/root", RunRecord(run), (tmp_path / "zip").read_bytes()), job)
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["zip"]


def test_a_run_from_before_1980_comes_back_with_the_paths_of_this_computer(tmp_path: Path) -> None:
    job = make_job(tmp_path / "runs")
    folder = Path(f"{tmp_path}/root{job.runs_folder}/day/run")
    folder.mkdir(parents=True)
    (folder / "result.json").write_text(str(folder))
    os.utime(folder / "result.json", (0, 0))
    run = RunRow(run_index=0, seed=0, status="SUCCESS", run_directory=str(folder))
    unpacked = unpack_run(pack_run(RunRecord(run), tmp_path / "root"), job).run.run_directory
    assert (Path(unpacked) / "result.json").read_text() == unpacked == f"{job.runs_folder}/day/run"


@pytest.mark.parametrize(
    "address", ["ucx://a:1", "tls://a:1", "foo://a:1", "a", "", "tcp://a:b", "tcp://[::1"]
)
def test_an_address_without_a_known_protocol_and_port_is_refused(address: str) -> None:
    with pytest.raises(InputError, match=r"cannot be reached: (the address is not tcp|tls:// needs certi)"):
        run_jobs_on_cluster([make_job(Path())], address, JobOptions(), lambda *_: None)


def test_a_worker_with_other_software_is_described() -> None:
    worker: Any = SimpleNamespace(address="tcp://there")
    here = describe_environment()
    check_environment(here, worker)
    client = {**here, "numpy": "1.0", "more": "2", FILES_KEY: "0"}
    differences = f"numpy {here['numpy']} instead of 1.0, .*{FILES_KEY} .* instead of 0, more missing instead"
    with pytest.raises(InputError, match=differences):
        check_environment(client, worker)


@contextmanager
def running(folder: Path, pattern: str, *words: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Start a program of dask; yield it and the first group of the pattern in its log; kill it at the end."""
    command = [sys.executable, "-m", "dask", *words, "--no-dashboard"]
    process = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        log: Any = process.stderr
        yield process, next(match[1] for line in log if (match := re.search(pattern, line)))
    finally:
        process.kill()
        process.communicate()


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[str]:
    """Address of a scheduler."""
    pattern = r"Scheduler at:\s*(tcp://\S+)"
    with running(tmp_path, pattern, "scheduler", "--host", "127.0.0.1", "--port", "0") as (_, address):
        yield address


@pytest.fixture
def workers(scheduler: str, tmp_path: Path) -> Iterator[list[subprocess.Popen[str]]]:
    """Two workers of the scheduler; without a nanny, a killed worker stays dead."""
    words = ("worker", scheduler, "--nthreads", "1", "--no-nanny", "--local-directory", str(tmp_path / "w"))
    with ExitStack() as stack:
        yield [stack.enter_context(running(tmp_path, "(Registered to)", *words))[0] for _ in range(2)]


def sweep(folder: Path, cluster: str | None = None, **options: Any) -> list[RunRow]:
    with closing(create_sweep(make_settings("sort_fruit", SEEDS, FAKE, {}, None, False), folder)) as database:
        run_sweep(database, JobOptions(**options), cluster)
        rows = database.read_runs()
        assert [row.run_index for row in rows if row.items.placed != row.items.seen] == []
        return rows


@pytest.mark.slow
def test_a_killed_worker_costs_only_time(
    scheduler: str, workers: list[subprocess.Popen[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    remote = sweep(
        tmp_path / "remote", scheduler, on_progress=lambda *_: os.kill(workers[0].pid, signal.SIGKILL)
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
def test_a_scheduler_without_workers_and_none_at_all_are_explained(scheduler: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no workers"):
        sweep(tmp_path / "runs", scheduler)
    with pytest.raises(InputError, match=r"cannot be reached: .*; start it with `dask scheduler`"):
        sweep(tmp_path / "runs", "tcp://127.0.0.1:1")


def test_without_the_extra_the_error_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "executive.campaign.cluster", raising=False)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match="uv sync --extra cl"):
        sweep(tmp_path, "tcp://127.0.0.1:1")
