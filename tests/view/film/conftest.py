"""One short run on a simulated cell, filmed by many tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.mission.load import load_mission
from executive.plugins import load_skills
from executive.record.recorded_run import record_run
from executive.record.run_directory import RunDirectory
from executive.run.assembly import RunOptions
from executive.testing.oracle import make_oracle_kind
from tests.record.conftest import MISSION


@pytest.fixture(scope="session")
def filmed_run(tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    """The directory of a run that brings one object; nobody is to write into it."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "bring_one.yaml").write_text(MISSION)
    skills = load_skills()
    loaded = load_mission(folder / "bring_one.yaml", skills)
    result = record_run(loaded, RunOptions(5, make_cell=make_oracle_kind()), folder / "runs")
    return RunDirectory(Path(result.run))
