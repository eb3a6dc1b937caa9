"""Recorded runs on the fake cell, each made once; a test that changes one takes a copy."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from executive.behaviours import load_skills
from executive.mission.load import load_mission
from executive.record.recorded_run import record_run
from executive.record.run_directory import find_run
from executive.run.assembly import RunOptions
from executive.testing.fake_cell import FakeCell
from tests.cut_off import Cut

MISSION = """\
mission: trial
description: A test's.
cell: cells/overhead.yaml
params: {attempts: 2, note: größer}
routes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}
tree:
  - MoveToScan
  - Detect
  - Localize
  - SelectTarget
  - retry:
      attempts: $attempts
      on: [Grasp.missed]
      recover: [Detect, Localize, {SelectTarget: {same: $item}}]
      do: [Approach, Grasp, Transit, Release]
"""


class Leaky(FakeCell):
    """A cell whose cup seals nothing."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.tool.can_hold = lambda: False


class Doomed(FakeCell):
    """A cell whose run is killed while it carries."""

    def advance(self) -> None:
        super().advance()
        if self.tick_count == 250:
            raise Cut


def recorded(folder: Path, kind: Callable[..., FakeCell]) -> Path:
    """Run the mission with two objects, and return its run directory."""
    file = folder / "trial.yaml"
    file.write_text(MISSION)
    loaded = load_mission(file, load_skills(), {"cell.kind": "fake", "cell.table.objects": "[2, 2]"})
    with contextlib.suppress(Cut):
        record_run(loaded, RunOptions(3, (), make_cell=kind), folder / "my runs")
    return find_run("latest", folder / "my runs")


@pytest.fixture(scope="session")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that succeeded: one object is in its bin, the other was never asked for."""
    return recorded(tmp_path_factory.mktemp("done"), FakeCell)


@pytest.fixture(scope="session")
def failed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that gave up after two attempts."""
    return recorded(tmp_path_factory.mktemp("failed"), Leaky)


@pytest.fixture(scope="session")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that was killed with an object on the tool."""
    return recorded(tmp_path_factory.mktemp("killed"), Doomed)


@pytest.fixture
def copy(tmp_path: Path) -> Callable[[Path], Path]:
    """Copies a run directory, for a test to change it."""
    return lambda run: Path(shutil.copytree(run, tmp_path / "copy"))
