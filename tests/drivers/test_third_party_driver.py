"""Driver of a third party: one file and one entry point run a shipped mission on its devices."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from at_terminal import invoke
from click.testing import Result

from executive.cell.devices import DriverOptions
from executive.drivers.sim.driver import SimDriver
from executive.mission.cell_file import load_cell
from executive.record.journal import read_journal
from executive.station.station import Station
from executive.testing.faults import during, grip_fails
from executive.testing.run_mission import run_mission
from executive.text.files import get_shipped_folder

DRIVER = Path(__file__).with_name("lab_driver.py")
PROJECT = """\
[project]
name = "lab"
[project.entry-points."executive.drivers"]
lab = "lab_driver:LabDriver"
"""
OVERHEAD = get_shipped_folder() / "cells" / "overhead.yaml"
ON_LAB = ("sort_overhead", "--cell", "lab.yaml")


@pytest.fixture(scope="session")
def images() -> np.ndarray:
    """Images of three cubes on the table, before the first pick and after each pick."""
    config = load_cell(OVERHEAD, {"cell.table.objects": "[5, 5]"})
    with closing(SimDriver(config, DriverOptions(seed=0))) as driver:
        cubes = driver.list_objects()[:3]
        for other in driver.list_objects()[3:]:
            driver.remove_object(other)
        pictures = [driver.camera.capture().colour]
        for cube in reversed(cubes):
            driver.remove_object(cube)
            pictures.append(driver.camera.capture().colour)
    return np.stack(pictures)


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, images: np.ndarray) -> Iterator[Path]:
    """The project of an integrator; it is the working directory."""
    shutil.copy(DRIVER, tmp_path)
    np.save(tmp_path / "images.npy", images)
    (tmp_path / "pyproject.toml").write_text(PROJECT)
    (tmp_path / "lab.yaml").write_text("cell: lab\nbase: overhead.yaml\nkind: lab\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield tmp_path
    sys.modules.pop("lab_driver", None)


def test_the_driver_is_one_short_file() -> None:
    assert len(DRIVER.read_text().splitlines()) <= 120


def run_lab(*words: str) -> Result:
    return invoke("run", *ON_LAB, "--quiet", *words)


def test_its_cells_are_checked(project: Path) -> None:
    checked = invoke("check", *ON_LAB)
    assert checked.exit_code == 0, checked.output
    (project / "images.npy").unlink()
    checked = invoke("check", *ON_LAB)
    assert "lab.yaml:3" in checked.output and "has no images.npy" in checked.output


@pytest.mark.slow
def test_a_shipped_mission_sorts_all_objects_and_is_replayed(project: Path) -> None:
    done = run_lab("--json")
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert (result["status"], result["items"]["placed"], result["audit"]) == ("SUCCESS", 3, None)
    replayed = invoke("replay", "latest")
    assert "all as recorded" in replayed.output, replayed.output


@pytest.mark.slow
def test_a_failed_grip_is_repeated(project: Path) -> None:
    faults = [during("*/Grasp", grip_fails(), activations=2)]
    result = run_mission("sort_overhead", Station, cell="lab.yaml", faults=faults)
    assert result.status == "SUCCESS" and result.items["placed"] == 3
    assert result.list_failure_reasons("*/Grasp") == ["missed"]


@pytest.mark.slow
def test_a_killed_run_continues_with_the_objects_that_are_left(project: Path, images: np.ndarray) -> None:
    assert run_lab().exit_code == 0
    run = Path("runs/latest").resolve()
    lines = (run / "journal.jsonl").read_text().splitlines(keepends=True)
    kept = next(number for number, line in enumerate(lines) if '"state":"placed"' in line)
    (run / "journal.jsonl").write_text("".join(lines[: kept + 1]))
    (run / "result.json").unlink()
    np.save("images.npy", images[1:])
    resumed = invoke("run", "--resume", "latest", "--json")
    assert resumed.exit_code == 0, resumed.output
    assert json.loads(resumed.stdout)["items"]["placed"] == 3
    times = [timed.clock for timed in read_journal(run / "journal.jsonl")]
    assert times == sorted(times)


def test_a_window_is_refused(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    refused = run_lab("--gui")
    assert refused.exit_code == 2
    assert 'the driver "lab" does not know the option "gui"' in refused.output
