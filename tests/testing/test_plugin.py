"""The pytest plugin: its fixtures work in anybody's tests, and whoever does not ask for them pays nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from executive.cells.fake.cell import FakeCell
from executive.testing import run_mission as missions
from executive.testing import run_skill as skills

HEAVY = ("pybullet", "cv2", "py_trees", "scipy", "onnxruntime", "numpy", "pydantic")

TESTS = """\
from skills.detect import Detect


def test_a_look_sees_what_lies_there(fake_cell, run_skill):
    fake_cell.world.put("cube", 0.5, 0.0)
    result = run_skill(Detect, fake_cell)
    assert [one.label for one in result.outputs["detections"].confident] == ["cube"]


def test_the_next_table_is_empty_again(fake_cell, run_skill):
    assert run_skill(Detect, fake_cell).outputs["detections"].confident == ()


def test_a_mission_runs(run_mission):
    assert run_mission("sort_overhead").status == "SUCCESS"
"""


def python(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run Python with nothing loaded into pytest but what is named."""
    return subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
    )


@pytest.mark.slow
def test_its_fixtures_work_in_a_project_that_only_installs_the_executive(tmp_path: Path) -> None:
    (entry,) = (entry for entry in entry_points(group="pytest11") if entry.name == "executive")
    (tmp_path / "test_mine.py").write_text(TESTS, encoding="utf-8")
    done = python("-m", "pytest", "-p", entry.value, "-q", folder=tmp_path)
    assert "3 passed" in done.stdout, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("imports", "packages"),
    [
        ("import executive.testing.plugin", HEAVY),
        pytest.param(
            "import executive.testing.run_mission; from executive.testing.faults import *",
            ("pybullet",),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_pytest_starts_without_anything_heavy_and_the_kit_without_a_simulator(
    imports: str, packages: tuple[str, ...], tmp_path: Path
) -> None:
    ask = f"import sys; {imports}; print([m for m in {packages} if m in sys.modules])"
    done = python("-c", ask, folder=tmp_path)
    assert done.stdout.strip() == "[]", done.stderr


def test_the_fixtures_are_the_functions_of_the_kit_and_an_empty_cell(
    run_skill: object, run_mission: object, fake_cell: FakeCell
) -> None:
    assert (run_skill, run_mission) == (skills.run_skill, missions.run_mission)
    assert fake_cell.world.objects == []
