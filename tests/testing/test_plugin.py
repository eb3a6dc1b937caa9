"""The pytest plugin: its fixtures work in anybody's tests, and whoever does not ask for them pays nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

HEAVY = ("pybullet", "cv2", "py_trees", "scipy", "onnxruntime", "numpy", "pydantic")

TESTS = """\
from skills.detect import Detect


def test_a_look_sees_what_lies_there(fake_cell, run_skill):
    fake_cell.world.put("cube", 0.5, 0.0)
    result = run_skill(Detect, fake_cell)
    assert [one.label for one in result.outputs["detections"].found] == ["cube"]


def test_the_next_table_is_empty_again(fake_cell, run_skill):
    assert run_skill(Detect, fake_cell).outputs["detections"].found == ()


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


def test_it_is_registered_with_pytest() -> None:
    (entry,) = (entry for entry in entry_points(group="pytest11") if entry.name == "executive")
    assert entry.value == "executive.testing.plugin"


@pytest.mark.slow
def test_its_fixtures_work_in_a_project_that_only_installs_the_executive(tmp_path: Path) -> None:
    (tmp_path / "test_mine.py").write_text(TESTS, encoding="utf-8")
    done = python("-m", "pytest", "-p", "executive.testing.plugin", "-q", folder=tmp_path)
    assert "3 passed" in done.stdout, done.stdout + done.stderr


def test_pytest_starts_without_anything_heavy(tmp_path: Path) -> None:
    ask = f"import sys, executive.testing.plugin; print([m for m in {HEAVY} if m in sys.modules])"
    assert python("-c", ask, folder=tmp_path).stdout.strip() == "[]"


@pytest.mark.slow
def test_the_kit_itself_needs_no_simulator(tmp_path: Path) -> None:
    ask = (
        "import sys, executive.testing.run_skill, executive.testing.run_mission; "
        "from executive.testing.disturbances import *; print('pybullet' in sys.modules)"
    )
    done = python("-c", ask, folder=tmp_path)
    assert done.stdout.strip() == "False", done.stderr


def test_the_fixtures_are_the_functions_of_the_kit(run_skill: object, run_mission: object) -> None:
    from executive.testing import run_mission as missions
    from executive.testing import run_skill as skills

    assert run_skill is skills.run_skill
    assert run_mission is missions.run_mission


@pytest.mark.usefixtures("fake_cell")
def test_the_fake_cell_of_a_fixture_has_an_empty_table(fake_cell: object) -> None:
    assert fake_cell.world.objects == []  # type: ignore[attr-defined]
