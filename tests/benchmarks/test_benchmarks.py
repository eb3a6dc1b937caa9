"""The benchmarks at their smallest sizes, and cases that are broken on purpose."""

from __future__ import annotations

import json
import math
import os
import signal
import sys
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from events import at, item_changed
from py_trees.common import Status

from executive.campaign.mission_under_test import MissionUnderTest, load_mission_under_test
from executive.cell.clock import STEP
from executive.cell.config import CellConfig
from executive.cells.fake.cell import FakeCell
from executive.events import TimedEvent
from executive.motion.braking import plan_braking
from executive.motion.joints import JointLimits, JointState
from executive.motion.point_to_point import Connector
from executive.motion.trajectory import Trajectory
from executive.record.result import Audit, ItemCounts, Result
from tests.benchmarks import (
    damaged_records,
    halts,
    journal,
    kills,
    longest_step,
    report,
    soak,
    suction_map,
    tick,
)
from tests.benchmarks.forks import ForkRunner

FAKE = {"cell.kind": "fake", "cell.table.objects": "[2, 2]"}
CHILD = os.getpid()
START = np.radians([0.0, 20.0, 0.0, -80.0, 0.0, 60.0, 0.0])


def load(mission: str = "sort_overhead", kind: Any = None, **overrides: str) -> MissionUnderTest:
    loaded = load_mission_under_test(mission, {**FAKE, **overrides}, has_oracle=False, seed=7)
    return replace(loaded, make_cell=kind or loaded.make_cell)


@pytest.fixture(scope="module")
def cell() -> CellConfig:
    return load_mission_under_test("sort_overhead", {}, has_oracle=False, seed=0).loaded.cell_config


@pytest.fixture(scope="module")
def limits(cell: CellConfig) -> JointLimits:
    return JointLimits.from_config(cell.arm.limits)


@pytest.mark.parametrize(
    ("function", "answer"),
    [
        (lambda: os.getpid() == CHILD, (False, "")),
        (lambda: 1 / 0, (None, "ZeroDivisionError: division by zero")),
        (lambda: os._exit(0), (None, "the child ended with exit code 0 and sent nothing")),
        (lambda: os.kill(os.getpid(), 9), (None, "the child ended with exit code -9 and sent nothing")),
        (lambda: lambda: 0, (None, "the child ended with exit code 1 and sent nothing")),
        (signal.pause, (None, "the child sent nothing for 1 s and was killed")),
    ],
)
def test_every_end_of_a_child_is_reported(function: Any, answer: tuple[Any, str]) -> None:
    assert ForkRunner(1.0).call(function) == answer


def test_figures_are_a_table_or_json_and_problems_an_exit_code(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    figures = {"runs": 2, "rows": [{"part": "a", "s": 0.123456}], "problems": ["bad", "bad"]}
    for words in (["--json"], []):
        monkeypatch.setattr(sys, "argv", ["benchmark", *words])
        with pytest.raises(SystemExit, match="1"):
            report.run_command(lambda: figures)
        out = capfd.readouterr().out
        if words:
            assert json.loads(out) == figures
    lines = [line.split() for line in out.splitlines()]
    for line in (["runs", "2"], ["a", "0.1235"], ["problems", "2"], ["2", "x", "bad"]):
        assert line in lines


def test_planning_images_and_detection_do_not_count_as_parts_of_a_control_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(longest_step, "EXCLUDED_ACCESSES", ("arm.", "camera.", "detector.", "request."))
    figures = longest_step.measure(load(), tmp_path, run_count=1)
    monkeypatch.setattr(longest_step, "EXCLUDED_ACCESSES", ())
    (row,), (other_row,) = figures["runs"], longest_step.measure(load(), tmp_path, run_count=1)["runs"]
    assert row["steps"] == other_row["steps"] > 100
    assert 0 < row["longest_cpu_ms"] <= row["longest_ms"] * 1.1


class Coasting(FakeCell):
    """A cell whose arm stops on contact only, else not before its motion is over."""

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        brake = self.arm.stop
        self.arm.stop = lambda: brake() if self.tool.touching else None  # type: ignore[method-assign]


class TestHalts:
    @pytest.mark.parametrize(
        "mission",
        [
            "sort_overhead",
            *(
                pytest.param(name, marks=pytest.mark.slow)
                for name in ("sort_wrist", "inspect_then_sort", "recycle", "tray_instruments")
            ),
        ],
    )
    def test_a_halted_fake_cell_is_in_order(self, mission: str) -> None:
        figures = halts.measure(load(mission), period_steps=50)
        assert (figures["problems"], figures["failed"]) == ([], 0)
        assert figures["halts"] == -(-figures["ticks"] // 50)
        assert figures["moving"] >= 8 and figures["holding"] >= 2

    @pytest.mark.slow
    def test_an_arm_that_does_not_brake_is_found(self) -> None:
        figures = halts.measure(load(kind=Coasting), period_steps=80)
        assert figures["problems"]
        assert all("rest_s is " in problem for problem in figures["problems"])

    @pytest.mark.slow
    def test_the_simulated_arm_brakes_within_its_limits(self) -> None:
        figures = halts.measure(
            load_mission_under_test("sort_overhead", {}, has_oracle=True, seed=1), period_steps=50
        )
        assert figures["problems"] == []
        assert figures["moving"] >= 20
        worst = {row["figure"]: row["value"] for row in figures["worst"]}
        # A figure of zero would not be measured.
        assert worst["rest_s"] > 0.1 and worst["jerk_ratio"] > 0.5 and worst["deviation_rad"] > 0.0

    def test_braking_is_measured(self, limits: JointLimits) -> None:
        path = Trajectory(
            [Connector(limits).connect(JointState.at_rest(START), JointState.at_rest(START + 0.8))]
        )
        stopped = 40
        times = [step * STEP for step in range(stopped + 1)]
        times += plan_braking(path, times[-1], limits).tolist()
        commands = [path.state_at(time).q for time in (*times, *[times[-1]] * 4)]
        good = halts.measure_braking(commands, stopped, path, limits)
        assert good["deviation_rad"] < 1e-7
        assert 0.5 < good["acceleration_ratio"] <= 1.0 and 0.5 < good["jerk_ratio"] <= 1.02
        astray = [*commands]
        astray[stopped + 5] = commands[stopped + 5] + np.eye(7)[2] * 1e-3
        assert halts.measure_braking(astray, stopped, path, limits)["deviation_rad"] > 8e-4
        dead = [*commands[: stopped + 1], *[commands[stopped]] * 10]
        assert halts.measure_braking(dead, stopped, path, limits)["jerk_ratio"] > 50.0

    @pytest.mark.parametrize(
        ("wrong", "count"),
        [({}, 0), ({"unseen": 0}, 0), ({"left": 2}, 1), ({"elsewhere": 0}, 1), ({"wrong_bin": 1}, 1)],
    )
    def test_a_ledger_that_disagrees_with_the_audit_is_found(self, wrong: dict[str, int], count: int) -> None:
        items = {"seen": 4, "placed": 1, "rejected": 1, "skipped": 1, "lost": 1}
        audit = {"right": 1, "wrong_bin": 0, "left": 3, "elsewhere": 1, "unseen": 1, **wrong}
        assert len(list(halts.check_ledger(items, audit))) == count
        assert list(halts.check_ledger({**items, "seen": 5}, None))


class TestKills:
    @pytest.mark.slow
    @pytest.mark.parametrize("simulated", [False, True])
    def test_a_killed_run_resumes(self, tmp_path: Path, simulated: bool) -> None:
        subject = load_mission_under_test("sort_wrist", {}, has_oracle=True, seed=7) if simulated else load()
        count = 2 if simulated else 4
        figures = kills.measure(subject, tmp_path, kills=count, changed=count // 2)
        assert (figures["problems"], figures["kills"], len(figures["ended"])) == ([], count, count)
        assert not list(tmp_path.glob("kills/[0-9]*"))

    def test_an_item_that_is_handled_twice_is_found(self) -> None:
        def entries(*states: str) -> list[TimedEvent]:
            return [at(tick, item_changed("cube-1", state)) for tick, state in enumerate(states)]

        assert kills.find_handled_twice(entries("seen", "held", "placed", "placed")) == []
        assert kills.find_handled_twice(entries("held", "placed", "held", "placed")) == [
            "cube-1 was held after it had been placed",
        ]

    def test_only_an_object_that_was_taken_away_may_be_lost(self) -> None:
        result = Result(mission="sort", seed=3, status="FAILURE", reason="lost", message="", node="")
        assert kills.check_result(result, change_made="removed cube") == []
        assert len(kills.check_result(result, change_made="moved cube")) == 1
        assert len(kills.check_result(replace(result, held_item="cube-1"), change_made="dropped cube")) == 1


class TestDamagedRecords:
    @pytest.mark.slow
    @pytest.mark.parametrize("simulated", [False, True])
    def test_a_damaged_record_is_read_replayed_resumed_and_filmed_or_refused(
        self, tmp_path: Path, simulated: bool
    ) -> None:
        subject = (
            load_mission_under_test("sort_overhead", {}, has_oracle=True, seed=7) if simulated else load()
        )
        figures = damaged_records.measure(
            subject, tmp_path, reports=12, others=6, videos=2 * simulated, truncations=6, kills=2
        )
        assert figures["problems"] == []
        assert [row["records"] for row in figures["damaged"]] == [12, 6, 6, 2 * simulated]
        assert [row["agree"] for row in figures["resumed"]] == [6, 2]
        assert list(tmp_path.iterdir()) == []

    def test_only_an_incomplete_run_may_disagree_with_the_audit(self) -> None:
        result = Result(
            mission="sort",
            seed=3,
            status="INCOMPLETE",
            reason="rejected",
            message="1 object(s) were not sorted: cube-1",
            node="",
            items=ItemCounts(seen=2, placed=1, rejected=1),
            audit=Audit(agrees=False, right=2),
        )
        assert damaged_records.find_wrong_claims(result) == []
        assert len(damaged_records.find_wrong_claims(replace(result, status="SUCCESS"))) == 1
        assert len(damaged_records.find_wrong_claims(replace(result, status="FAULT"))) == 1
        wrong = replace(result, items=ItemCounts(seen=3, placed=3))
        assert len(damaged_records.find_wrong_claims(wrong)) == 1


class TestSoak:
    def test_growth_is_found(self) -> None:
        flat = [{"memory_mb": 100.0, "threads": 4, "open_files": 6, "objects": 1000}] * 20
        assert soak.compare_samples(flat)["problems"] == []
        grown = [
            {"memory_mb": 100.0 + 3 * run, "threads": 4, "open_files": 6 + run, "objects": 1000 + 5 * run}
            for run in range(20)
        ]
        figures = soak.compare_samples(grown)
        assert (figures["growth_mb"], figures["objects_per_run"]) == pytest.approx((60.0, 5.0))
        assert [problem.split(" ")[0] for problem in figures["problems"]] == [
            "growth_mb",
            "objects_per_run",
            "25",
        ]

    @pytest.mark.slow
    def test_runs_leave_nothing_behind(self) -> None:
        figures = soak.measure(load(), runs=12)
        assert figures["problems"] == []
        assert figures["samples"][0]["memory_mb"] > 20.0

    def test_a_run_that_fails_is_a_problem(self) -> None:
        class Blind(FakeCell):
            def __init__(self, *given: Any, **options: Any) -> None:
                super().__init__(*given, **options)
                self.detector.make_answer = lambda look, true: "the server does not answer"

        (problem,) = soak.measure(load(kind=Blind), runs=1)["problems"]
        assert problem.startswith("seed 7 ended with FAILURE Detect.unavailable")


def test_every_event_of_the_journal_is_measured(tmp_path: Path) -> None:
    figures = journal.measure(load(**{"cell.table.objects": "[1, 1]"}), tmp_path)
    assert figures["events"] > 50
    assert 0 < figures["journal_s"] < figures["run_s"]
    assert figures["percent"] == pytest.approx(100 * figures["journal_s"] / figures["run_s"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("status", [Status.RUNNING, Status.SUCCESS])
def test_both_sides_tick_equal_trees(status: Status) -> None:
    skill = tick._WaitForever if status is Status.RUNNING else tick._SucceedAtOnce
    trees = tick.build_ours(31, skill), tick.build_bare(31, status)
    for _ in range(2):
        for tree in trees:
            tree.tick_once()
    ours, bare = ([node.status for node in tree.iterate()] for tree in trees)
    assert (ours, len(ours), ours[-1]) == (bare, 31, status)


def test_a_waiting_tick_costs_no_more_than_it_may() -> None:
    figures = tick.measure(blocks=3, sizes=(10, 100))
    assert [row["nodes"] for row in figures["steady tick"]] == [10, 100]
    assert all(0 < row["ratio"] <= tick.MAX_RATIO for row in figures["steady tick"])
    assert [row["changes"] for row in figures["status changes"]] == [20, 200]


def test_the_shipped_map_is_what_the_code_measures_and_the_cup_of_the_cell_seals(
    cell: CellConfig, tmp_path: Path
) -> None:
    names = "label", "cup_radius", "offset"
    shipped = {tuple(row[name] for name in names): row for row in suction_map.read_map()}
    measured = suction_map.measure_map(cell, cup_radii=[0.006, 0.010], offsets=[0.0, 0.004])
    suction_map.write_map(measured, tmp_path / "map.csv")
    assert len(suction_map.read_map(tmp_path / "map.csv")) == 3 * 2 * 2
    for row in measured:
        other = shipped[tuple(row[name] for name in names)]
        for name, tolerance in (("sealed", 0.03), ("gap_median", 1e-4), ("force_median", 0.05)):
            assert row[name] == pytest.approx(other[name], abs=tolerance), (row, other)
    radius = cell.tool.cup_radius
    for label, offset in product(("cube", "sphere"), (0.0, 0.002, 0.004)):
        assert shipped[label, radius, offset]["sealed"] == 1
    assert shipped["duck", radius, 0.002]["sealed"] > 0.85
    assert 0.3 < shipped["duck", radius, 0.006]["sealed"] < 0.8
    assert shipped["duck", 0.012, 0.0]["sealed"] == 0
    # An ejector reaches the vacuum of a perfect seal.
    assert 60e3 <= cell.tool.force / (math.pi * radius**2) <= 85e3
