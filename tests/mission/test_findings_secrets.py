"""A finding about a line never repeats a key that stands in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.behaviours import load_skills
from executive.errors import InputError
from executive.mission.load import load_mission
from executive.station.check import load_checker

MISSION = "mission: m\ncell: cells/own.yaml\nroutes: {cube: red_bin}\ntree: Detect\n"
CELL = "base: cells/overhead.yaml\ncell: own\ndetectors:\n  eye: {kind: roboflow, model_id: a/1, KEY}\n"


@pytest.mark.parametrize(
    "key",
    [
        "api_key: rf_SECRET123",
        "token: rf_SECRET123",
        "url: 'https://serverless.roboflow.com/?api_key=SECRET123'",
        "url: 'https://me:SECRET123@serverless.roboflow.com'",
    ],
)
def test_a_key_in_a_cell_file_is_refused_and_not_shown(tmp_path: Path, key: str) -> None:
    (tmp_path / "cells").mkdir()
    (tmp_path / "cells" / "own.yaml").write_text(CELL.replace("KEY", key))
    (tmp_path / "m.yaml").write_text(MISSION)
    with pytest.raises(InputError) as caught:
        load_mission(tmp_path / "m.yaml", load_skills(), find_checker=load_checker)
    assert "ROBOFLOW_API_KEY" in str(caught.value) or "url" in key
    assert "***" in str(caught.value)
    assert "SECRET123" not in str(caught.value)
