"""`executive bench`: what it prints, and where."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner, Result

from executive.campaign.tick_cost import ChangeCost, SteadyCost
from executive.cli.main import main


def invoke(*words: str) -> Result:
    return CliRunner().invoke(main, words)


@pytest.fixture
def blocks(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Stands for the measurements: how many blocks they were asked for."""
    asked = []

    def steady_costs(blocks):
        asked.append(blocks)
        return [SteadyCost("flat", 1000, ours=0.6, bare=15.432)]

    def change_costs(blocks, folder):
        assert folder.is_dir()
        asked.append(blocks)
        return [ChangeCost(10, changes=20, ours=354.56, bare=54.56)]

    monkeypatch.setattr("executive.campaign.tick_cost.steady_costs", steady_costs)
    monkeypatch.setattr("executive.campaign.tick_cost.change_costs", change_costs)
    return asked


def test_help_names_every_measurement():
    shown = invoke("bench", "--help").stdout
    assert "seal  Measure how suction cups" in shown
    assert "tick  Measure what ticks and status changes cost" in shown


def test_tick_is_a_table_on_standard_output(blocks):
    shown = invoke("bench", "tick", "--blocks", "3")
    assert shown.exit_code == 0
    assert blocks == [3, 3]
    assert [line.split() for line in shown.stdout.splitlines() if line.startswith(("flat", "20"))] == [
        ["flat", "1000", "0.60", "15.43", "0.04"],
        ["20", "10", "354.6", "54.6", "15.00"],
    ]
    assert "ours may cost 1.3 times the bare one" in shown.stdout
    assert "a recorded change may cost 20 more" in shown.stdout


def test_tick_as_json_is_one_object(blocks):
    shown = invoke("bench", "tick", "--json")
    assert json.loads(shown.stdout) == {
        "steady": [{"shape": "flat", "nodes": 1000, "ours_us": 0.6, "bare_us": 15.432, "ratio": 0.039}],
        "changes": [{"nodes": 10, "changes": 20, "ours_us": 354.56, "bare_us": 54.56, "extra_us": 15.0}],
        "most_ratio": 1.3,
        "most_extra_us": 20.0,
    }


@pytest.mark.parametrize("blocks", ["0", "many"])
def test_tick_needs_a_block_to_measure(blocks):
    shown = invoke("bench", "tick", "--blocks", blocks)
    assert shown.exit_code == 2
    assert "--blocks" in shown.stderr


def test_tick_measures_in_earnest():
    figures = json.loads(invoke("bench", "tick", "--blocks", "1", "--json").stdout)
    assert [row["nodes"] for row in figures["steady"]] == [10, 100, 1000] * 3
    assert [row["changes"] for row in figures["changes"]] == [20, 200, 2000]


def test_seal_says_what_it_wrote_and_where(monkeypatch, tmp_path):
    monkeypatch.setattr("executive.sim.seal_map.measure_map", lambda config: [()] * 3)
    monkeypatch.setattr("executive.sim.seal_map.write_map", lambda rows, out: None)
    shown = invoke("bench", "seal", "--out", str(tmp_path / "map.csv"))
    assert (shown.exit_code, shown.stdout) == (0, "")
    assert shown.stderr == f"3 rows in {tmp_path / 'map.csv'}\n"
