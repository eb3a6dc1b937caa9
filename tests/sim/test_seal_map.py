from __future__ import annotations

import math
from pathlib import Path

import pytest

from executive.cell_config import CellConfig
from executive.mission.parse.cell_file import load_cell
from executive.sim.seal_map import Row, measure_map, read_map, write_map

CELLS = Path(__file__).parents[2] / "missions" / "cells"


def cell(name: str = "overhead") -> CellConfig:
    return load_cell(CELLS / f"{name}.yaml")


def rows_by_key(rows: list[Row]) -> dict[tuple[str, float, float], Row]:
    return {(row.label, row.cup_radius, row.offset): row for row in rows}


def test_the_shipped_map_is_what_the_code_measures() -> None:
    shipped = rows_by_key(read_map())
    measured = measure_map(cell(), cup_radii=[0.006, 0.010], offsets=[0.0, 0.004])
    assert len(measured) == 3 * 2 * 2
    for row in measured:
        expected = shipped[row.label, row.cup_radius, row.offset]
        hint = (
            f"{row} differs from the shipped {expected}: run `executive bench seal` and look at what changed"
        )
        assert row.placements == expected.placements, hint
        assert row.sealed == pytest.approx(expected.sealed, abs=0.03), hint
        assert row.gap_median == pytest.approx(expected.gap_median, abs=1e-4), hint
        assert row.tilt_median == pytest.approx(expected.tilt_median, abs=0.02), hint
        assert row.force_median == pytest.approx(expected.force_median, abs=0.05), hint


@pytest.mark.parametrize("label", ["cube", "sphere"])
@pytest.mark.parametrize("offset", [0.0, 0.002, 0.004])
def test_cube_and_sphere_seal_wherever_localization_puts_the_cup(label: str, offset: float) -> None:
    tool = cell().tool
    row = rows_by_key(read_map())[label, tool.cup_radius, offset]
    assert row.sealed == 1
    assert row.force_p10 > 2 * 1.4, "a transit at full speed pulls with 1.4 N: a good seal bears twice that"


def test_the_duck_mostly_seals_at_two_millimetres_and_often_not_at_six() -> None:
    rows, radius = rows_by_key(read_map()), cell().tool.cup_radius
    assert rows["duck", radius, 0.002].sealed > 0.85
    assert 0.3 < rows["duck", radius, 0.006].sealed < 0.8


def test_a_wide_cup_finds_no_place_on_the_duck() -> None:
    rows = rows_by_key(read_map())
    assert max(row.sealed for key, row in rows.items() if key[:2] == ("duck", 0.012)) == 0


def test_the_force_of_a_perfect_seal_is_a_vacuum_an_ejector_reaches() -> None:
    tool = cell().tool
    assert 60e3 <= tool.force / (math.pi * tool.cup_radius**2) <= 85e3


def test_every_shipped_cell_has_the_same_tool() -> None:
    assert cell("wrist").tool == cell("overhead").tool


def test_a_map_survives_its_file(tmp_path: Path) -> None:
    rows = [Row("duck", 0.006, 0.002, 96, 0.001, 0.002, math.inf, 0.1, 0.2, 0.3, 0.5, 0.0, 1.25, 3.0)]
    write_map(rows, tmp_path / "map.csv")
    assert read_map(tmp_path / "map.csv") == rows
