"""`executive bench`: what it prints, and where."""

from __future__ import annotations

import json
from types import SimpleNamespace

import pytest
from click.testing import CliRunner, Result

from executive.campaign.tick_cost import ChangeCost, SteadyCost
from executive.cli.main import main
from executive.view.figures.halt import Halt, HaltFigures
from executive.view.figures.motion import ExecutionFigures, MethodFigures, MotionFigures, PlanningFigures
from executive.view.figures.soak import Sample, SoakFigures


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
    shown = " ".join(invoke("bench", "--help").stdout.split())
    assert "seal Measure how suction cups" in shown
    assert "tick Measure what ticks and status changes cost" in shown
    assert "motion Measure how fast the arm of CELL moves" in shown
    assert "halts Halt MISSION at moments all over one run" in shown
    assert "kills Kill MISSION at random moments" in shown
    assert "soak Run MISSION again and again in one process" in shown


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


@pytest.fixture
def motions(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str, int, int]]:
    """Stands for the bench of motion: what was asked for, of which cell, how many pairs, of which seed."""
    asked = []

    def method(name: str, time: float) -> MethodFigures:
        return MethodFigures(name, time, (1.0, 1.0, 1.0))

    def measure(config, pairs, seed, progress):
        asked.append(("measure", config.cell, pairs, seed))
        return MotionFigures(
            cell=config.cell, pairs=pairs, seed=seed, margin=0.005, article=method("article", 6.5),
            article_cycle=7.25, stopping=method("stops at vias", 3.0), toppra=method("TOPP-RA", 2.0),
            floor=method("floor", 1.5), free_floor=1.4, ours=method("ours", 1.8), nearest="the tool - a cube",
            planning=PlanningFigures(2 * pairs, 20.0, 60.0, 0.9, 1.0, ()),
        )  # fmt: skip

    def execute(config, pairs, seed, progress):
        asked.append(("execute", config.cell, pairs, seed))
        return ExecutionFigures(pairs, 0.006, "the tool - a cube", (), 0.0002, 0, 0, 1e-6, 1.9, ())

    monkeypatch.setattr("executive.campaign.motion_trial.measure", measure)
    monkeypatch.setattr("executive.campaign.motion_execution.execute", execute)
    return asked


def test_motion_is_a_table_on_standard_output(motions):
    shown = invoke("bench", "motion")
    assert shown.exit_code == 0
    assert motions == [("measure", "overhead", 200, 0)]
    assert "overhead: 200 random pairs, seed 0" in shown.stdout
    assert ["ours", "1.800", "0.28", "1.20", "1.00", "1.00", "1.00"] in [
        line.split() for line in shown.stdout.splitlines()
    ]


def test_motion_executes_pairs_where_asked_to(motions):
    shown = invoke("bench", "motion", "wrist", "--pairs", "3", "--execute", "2", "--seed", "7", "--json")
    assert motions == [("measure", "wrist", 3, 7), ("execute", "wrist", 2, 7)]
    figures = json.loads(shown.stdout)
    assert (figures["pairs"], figures["execution"]["pairs"]) == (3, 2)


def test_motion_of_a_cell_that_is_not_there_names_those_that_are():
    shown = invoke("bench", "motion", "overhad")
    assert shown.exit_code == 2
    assert 'there is no cell file "overhad"' in shown.stderr
    assert "overhead" in shown.stderr


@pytest.fixture
def campaigns(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Stands for the campaigns: what they were asked for, and what they say went wrong."""
    told = SimpleNamespace(asked=[], problems=(), done=2)

    def halt_everywhere(subject, *, every, points, progress):
        told.asked.append((subject.name, subject.cell, subject.kind is None, subject.seed, every, points))
        halts = tuple(Halt(tick, tick / 240, problems=told.problems) for tick in range(told.done))
        return HaltFigures(subject.name, subject.cell, subject.seed, 2400, halts, 2)

    def soak(subject, runs, *, frames, progress):
        told.asked.append((subject.name, subject.cell, subject.kind is None, subject.seed, runs, frames))
        samples = tuple(Sample(100.0, 4, 6, 1000) for _ in range(told.done))
        failed = tuple((subject.seed, problem) for problem in told.problems)
        return SoakFigures(subject.name, subject.cell, subject.seed, samples, failed, 2)

    monkeypatch.setattr("executive.campaign.halts.halt_everywhere", halt_everywhere)
    monkeypatch.setattr("executive.campaign.soak.soak", soak)
    return told


def test_halts_are_every_tenth_step_of_a_simulated_cell_and_every_step_of_another(campaigns):
    shown = invoke("bench", "halts", "sort_overhead", "--seed", "4")
    assert invoke("bench", "halts", "sort_overhead", "--set", "cell.kind=fake").exit_code == 0
    assert invoke("bench", "halts", "sort_fruit", "--every", "7", "--points", "3").exit_code == 0
    assert shown.exit_code == 0
    assert shown.stdout.startswith("sort_overhead (sim), seed 4: halted at 2 moments of a run of 2400 ticks")
    assert campaigns.asked == [
        ("sort_overhead", "sim", True, 4, 10, None),
        ("sort_overhead", "fake", True, 0, 1, None),
        ("sort_fruit", "fake", True, 0, 7, 3),
    ]


def test_an_oracle_is_for_simulated_cells(campaigns):
    assert invoke("bench", "soak", "sort_wrist", "--oracle", "--runs", "2").exit_code == 0
    assert campaigns.asked == [("sort_wrist", "sim, detections from the truth", False, 0, 2, False)]
    shown = invoke("bench", "halts", "sort_fruit", "--oracle")
    assert shown.exit_code == 2
    assert "--oracle is for simulated cells, that of sort_fruit is of kind fake; leave it out" in shown.stderr


@pytest.mark.parametrize("words", [("halts", "sort_fruit"), ("soak", "sort_fruit", "--runs", "2")])
def test_a_campaign_in_which_something_went_wrong_has_exit_code_1(campaigns, words):
    campaigns.problems = ("it took 0.6 s to rest",)
    shown = invoke("bench", *words)
    assert shown.exit_code == 1
    assert "it took 0.6 s to rest" in shown.stdout


@pytest.mark.parametrize("words", [("halts", "sort_fruit"), ("soak", "sort_fruit", "--runs", "2")])
def test_a_campaign_that_was_ended_early_has_exit_code_130(campaigns, words):
    campaigns.done = 1
    shown = invoke("bench", *words)
    assert shown.exit_code == 130
    assert "ended by the user" in shown.stdout


def test_campaigns_as_json_are_one_object(campaigns):
    halts = json.loads(invoke("bench", "halts", "sort_fruit", "--json").stdout)
    soaked = json.loads(invoke("bench", "soak", "sort_fruit", "--runs", "2", "--frames", "--json").stdout)
    assert (halts["mission"], halts["points"], halts["failed"]) == ("sort_fruit", 2, [])
    assert (soaked["mission"], soaked["runs"], soaked["slope_mb"]) == ("sort_fruit", 2, 0.0)
    assert campaigns.asked[1][-1] is True


def test_halts_are_tried_in_earnest():
    shown = invoke("bench", "halts", "sort_overhead", "--set", "cell.kind=fake", "--points", "2")
    assert shown.exit_code == 0, shown.output
    assert "halted at 2 moments" in shown.stdout
    assert "the mission was run again after 2" in shown.stdout
