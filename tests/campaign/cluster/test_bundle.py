"""Files that travel to a worker, and the process there."""

from __future__ import annotations

import io
import shutil
import sys
import zipfile
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import pytest

from executive.campaign.cluster.bundle import PACKAGES_FOLDER, make_bundle
from executive.campaign.cluster.cluster import run_jobs_on_cluster
from executive.campaign.cluster.environment import FILES_KEY, describe_differences, describe_environment
from executive.campaign.cluster.returned_run import unpack_run
from executive.campaign.pool import JobOptions
from executive.campaign.results.sweep_folder import create_sweep, make_settings
from executive.campaign.sweep_job import SweepJob, list_jobs, run_job
from executive.errors import InputError

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
        "cells/mine.yaml": "base: bases/first.yaml\ncell: mine\nkind: fake\n",
        "cells/bases/first.yaml": (missions / "cells" / "overhead.yaml").read_text(encoding="utf-8"),
        "cells/mine.measured.json": "[]",
        "cells/my labels.txt": "cube\n",
        "cells/unused.txt": "",
    }
    files["cells/mine.yaml"] += "# labels: 'my labels.txt'\n"
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [*sys.path])
    # A module of the project of the previous test would be found in that project.
    for module in ("mine_wave", "mine_wave.wave"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    return folder


def list_sweep_jobs(folder: Path) -> list[SweepJob]:
    with closing(create_sweep(make_settings("wave.yaml", range(2), {}, {}, None, False), folder)) as database:
        return list_jobs(database.settings, database.path.parent)


def test_all_files_of_the_runs_travel_and_no_others(project: Path) -> None:
    bundle = make_bundle(list_sweep_jobs(Path("runs")))
    names = set(zipfile.ZipFile(io.BytesIO(bundle)).namelist())
    expected = ("wave.yaml", "pyproject.toml", "cells/mine.yaml", "cells/bases/first.yaml")
    expected += ("cells/mine.measured.json", "cells/my labels.txt")
    assert {f"{project}/{name}" for name in expected} <= names
    assert {f"{PACKAGES_FOLDER}/mine_wave/{name}.py" for name in ("__init__", "wave")} <= names
    assert f"{project}/cells/unused.txt" not in names
    assert make_bundle(list_sweep_jobs(Path("runs"))) == bundle


def test_an_absolute_path_to_a_file_is_refused(project: Path) -> None:
    jobs = list_sweep_jobs(Path("runs"))
    cell = project / "cells" / "mine.yaml"
    cell.write_text(f"{cell.read_text()}# {project}/cells/unused.txt\n")
    with pytest.raises(InputError, match=r"mine.yaml names .*unused.txt\", a path that workers may not"):
        make_bundle(jobs)


@pytest.mark.slow
@pytest.mark.parametrize("is_absolute", [False, True])
def test_a_worker_runs_a_skill_of_another_package(project: Path, tmp_path: Path, is_absolute: bool) -> None:
    pytest.importorskip("distributed")
    from executive.campaign.cluster.worker import BundlePlugin

    jobs = list_sweep_jobs(tmp_path / "runs" if is_absolute else Path("runs"))
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
    assert (remote.run.status, remote.run.decision_hash) == (local.run.status, local.run.decision_hash)
    journals = {(Path(one.run.run_directory) / "journal.jsonl").read_bytes() for one in (local, remote)}
    assert len(journals) == 1
    # Both runs of the worker may have the name of the local run.
    assert len({local.run.run_directory, remote.run.run_directory, unpack_run(second).run.run_directory}) == 3


def test_a_worker_with_other_software_is_described() -> None:
    here = describe_environment()
    assert describe_differences(here, dict(here)) == ""
    there = {**here, "numpy": "1.0", FILES_KEY: "0"}
    del there["scipy"]
    text = describe_differences(here, there)
    assert text.split(", ")[0] == f"numpy 1.0 instead of {here['numpy']}"
    assert f"scipy missing instead of {here['scipy']}" in text and f"{FILES_KEY} 0 instead of" in text


def test_without_the_extra_the_error_names_it() -> None:
    with patch.dict(sys.modules, {"distributed": None}), pytest.raises(InputError) as caught:
        run_jobs_on_cluster([], "tcp://127.0.0.1:1", JobOptions(), lambda *_: None)
    assert '--cluster needs the packages of the extra "cluster"' in str(caught.value)
    assert "uv sync --extra cluster" in str(caught.value)
