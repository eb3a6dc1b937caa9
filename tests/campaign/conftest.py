"""The shipped overhead cell, for campaigns that need one."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.cell_config import CellConfig
from executive.mission.parse.cell_file import load_cell


@pytest.fixture(scope="session")
def overhead(missions: Path) -> CellConfig:
    return load_cell(missions / "cells" / "overhead.yaml")
