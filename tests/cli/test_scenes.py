"""`--scene FILE` of `executive run` and `executive sweep`, and the commands that use a recorded scene."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from at_terminal import invoke

from executive.record.run_directory import RunDirectory, find_recorded_options


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A scene with one object."""
    path = tmp_path / "one.yaml"
    path.write_text("# one\nscene: one object\ntable: {objects: [1, 1]}\n")
    return path


@pytest.fixture
def sort(tmp_path: Path) -> str:
    """A mission on a simulated cell that ends after a moment."""
    path = tmp_path / "wait.yaml"
    path.write_text("mission: wait\ncell: cells/overhead.yaml\ntree: {Wait: {seconds: 0.1}}\n")
    return str(path)


def run_json(*words: str, runs: Path) -> dict[str, Any]:
    done = invoke("run", *words, "--runs", str(runs), "--json")
    assert done.exit_code == 0, done.output
    result: dict[str, Any] = json.loads(done.stdout)
    return result | {"said": done.stderr}


@pytest.mark.slow
def test_the_run_directory_has_a_copy_from_which_the_run_is_repeated_and_replayed(
    sort: str, scene: Path, tmp_path: Path
) -> None:
    runs = tmp_path / "runs"
    result = run_json(sort, "--scene", str(scene), runs=runs)
    directory = RunDirectory(Path(result["run"]))
    copy = directory.path / "scene.yaml"
    assert copy.read_text() == scene.read_text()
    assert result["audit"]["left"] == 1
    repeat = f"executive run {sort} --seed 0 --scene {copy}"
    assert repeat in result["said"]
    assert repeat in directory.report.read_text()
    assert "one object" not in directory.journal.read_text()
    assert scene.name not in directory.journal.read_text()
    assert invoke("replay", "latest", "--runs", str(runs)).exit_code == 0
    again = run_json(sort, "--scene", str(copy), runs=runs)
    assert (again["trace"], again["audit"]) == (result["trace"], result["audit"])
    plain = run_json(sort, runs=runs)
    assert (find_recorded_options(Path(plain["run"])), "--scene" in plain["said"]) == ({}, False)
    assert plain["audit"]["left"] > 1


@pytest.mark.slow
def test_a_sweep_runs_every_seed_in_the_scene(sort: str, scene: Path, tmp_path: Path) -> None:
    words = ("--seeds", "1-2", "--workers", "1", "--scene", str(scene), "--runs", str(tmp_path), "--json")
    done = invoke("sweep", sort, *words)
    assert [each["audit"]["left"] for each in json.loads(done.stdout)["runs"]] == [1, 1]


@pytest.mark.parametrize("command", ["run kit_fasteners", "sweep kit_fasteners --seeds 0-3"])
def test_a_cell_that_is_not_simulated_takes_no_scene(command: str, scene: Path, tmp_path: Path) -> None:
    refused = invoke(*command.split(), "--scene", str(scene), "--runs", str(tmp_path / "runs"))
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert refused.stderr == (
        'the driver "fake" does not know the option "scene"; it knows: none; '
        "omit --scene, or use a cell with another driver\n"
    )
    assert not (tmp_path / "runs").exists()
