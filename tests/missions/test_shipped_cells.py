"""Every cell that is shipped can be worked in, and says what it stands for."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.cell.config import CellConfig
from executive.mission.cell_file import load_cell
from executive.perception.detectors.envelope import find_envelopes
from executive.station.check import load_checker
from executive.testing.fake_cell import FakeCell

CELLS = sorted((Path(__file__).parents[2] / "missions" / "cells").glob("*.yaml"))


@pytest.fixture(params=CELLS, ids=lambda path: path.stem)
def path(request: pytest.FixtureRequest) -> Path:
    return request.param


@pytest.fixture
def config(path: Path) -> CellConfig:
    return load_cell(path)


def test_it_has_the_name_of_its_file_and_says_what_it_stands_for(path: Path, config: CellConfig) -> None:
    assert config.cell == path.stem
    assert config.description
    assert path.read_text().startswith("# ")


def test_its_kind_finds_nothing_wrong_with_it(path: Path, config: CellConfig) -> None:
    assert list(load_checker(config.kind).check(config, path.parent)) == []


def test_the_most_objects_that_it_asks_for_find_room(config: CellConfig) -> None:
    most = config.table.objects[1]
    crowded = config.model_copy(update={"table": config.table.model_copy(update={"objects": (most, most)})})
    assert len(FakeCell(crowded).world.objects) == most


def test_every_shipped_detector_is_measured_but_those_behind_a_server(missions: Path) -> None:
    folder = missions / "cells"
    unmeasured = {
        (file.stem, name)
        for file in sorted(folder.glob("*.yaml"))
        for name, (error_rates, _) in find_envelopes(load_cell(file), folder, [folder]).items()
        if error_rates.assumption_reason
    }
    assert unmeasured == {("hosted", "server"), ("roboflow", "server")}
