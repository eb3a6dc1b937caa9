"""Each benchmark at its smallest size, or its judgement of one good and one bad case."""

from __future__ import annotations

import os
import signal
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import pytest
from events import at, item_changed

from executive.campaign.jobs import MissionUnderTest, load_mission_under_test
from executive.mission.cell_file import load_cell
from executive.record.result import Audit, ItemCounts, Result
from executive.text.files import find_cell
from tests.benchmarks import (
    continuous,
    damaged_records,
    foreign_arms,
    grasps,
    halts,
    hostile_input,
    kills,
    kinematics,
    longest_step,
    mutations,
    rows,
    soak,
    suction_map,
    tick,
    wrong_sources,
    yaw,
)
from tests.benchmarks.detector_variants import list_variants
from tests.benchmarks.forks import ForkRunner
from tests.benchmarks.ground_truth import AuditedRun, FoundObject, Report, run_audited
from tests.benchmarks.outside_the_envelope import DECLARED, OVERHEAD, Done, list_cases, summarize, write_scene


def load(**overrides: str) -> MissionUnderTest:
    overrides = {"cell.kind": "fake", "cell.table.objects": "[2, 2]", **overrides}
    return load_mission_under_test("sort_overhead", overrides, has_oracle=False, seed=7)


@pytest.mark.parametrize(
    ("function", "answer"),
    [
        (lambda: 7, (7, "")),
        (lambda: 1 / 0, (None, "ZeroDivisionError: division by zero")),
        (lambda: os._exit(0), (None, "the child ended with exit code 0 and sent nothing")),
        (signal.pause, (None, "the child sent nothing for 0.3 s and was killed")),
    ],
)
def test_every_end_of_a_child_is_reported(function: Any, answer: tuple[Any, str]) -> None:
    assert ForkRunner(0.3).call(function) == answer


def test_halts_of_a_fake_cell_are_in_order_and_a_wrong_ledger_is_found() -> None:
    figures = halts.measure(load(), every=300)
    assert (figures["problems"], figures["halts"]) == ([], -(-figures["ticks"] // 300))
    items = {"seen": 4, "placed": 1, "rejected": 1, "skipped": 1, "lost": 1}
    audit = {"right": 1, "wrong_bin": 0, "left": 3, "elsewhere": 1, "unseen": 1}
    assert list(halts.check_ledger(items, audit)) == []
    assert list(halts.check_ledger(items, {**audit, "wrong_bin": 1}))


def test_an_arm_of_another_project_plans_a_motion_or_has_a_message(tmp_path: Path) -> None:
    (tmp_path / "sdf.urdf").write_text("<sdf/>")
    folders = [Path(pybullet_data.getDataPath(), "kuka_iiwa"), tmp_path]
    figures = foreign_arms.measure(folders, only=r"/(model|sdf)\.urdf")
    assert figures["problems"] == []
    results = ["works", "the model sdf.urdf is no URDF: its root is <sdf>, not <robot>"]
    assert sorted(row["result"] for row in figures["arms"]) == sorted(results)


@pytest.mark.slow
def test_killed_and_damaged_runs_are_resumed(tmp_path: Path) -> None:
    figures = kills.measure(load(), tmp_path / "kills", kills=4, changed=2)
    assert (figures["problems"], figures["kills"]) == ([], 4)
    figures = damaged_records.measure(
        load(), tmp_path, reports=12, others=6, truncations=6, kills=2, databases=4
    )
    assert (figures["problems"], [row["agree"] for row in figures["resumed"]]) == ([], [6, 2])


def test_wrong_claims_of_a_resumed_run_are_found() -> None:
    events = [at(tick, item_changed("cube-1", state)) for tick, state in enumerate(("placed", "held"))]
    assert kills.find_handled_twice(events[:1]) == []
    assert len(kills.find_handled_twice(events)) == 1
    result = Result(mission="sort", seed=3, status="FAILURE", reason="lost", message="", node="")
    assert kills.check_result(result, change_made="removed cube") == []
    assert len(kills.check_result(result, change_made="moved cube")) == 1
    counts = ItemCounts(seen=2, placed=1, rejected=1)
    result = replace(result, status="INCOMPLETE", message="not sorted: cube-1", items=counts)
    result = replace(result, audit=Audit(agrees=False, right=2))
    assert damaged_records.find_wrong_claims(result) == []
    assert len(damaged_records.find_wrong_claims(replace(result, status="SUCCESS"))) == 1


@pytest.mark.slow
def test_a_long_run_with_emptied_bins_is_measured(tmp_path: Path) -> None:
    overrides = {"cell.kind": "fake", "cell.clock.step": "0.0166666667"}
    mission = str(Path(continuous.__file__).with_suffix(".yaml"))
    subject = load_mission_under_test(mission, overrides, has_oracle=False, seed=1)
    figures = continuous.measure(subject, tmp_path, objects=30)
    # The first objects load what later objects use; the table is searched for 20 s at the end.
    assert {text.split()[0] for text in figures["problems"]} <= {"memory_kb", "tick_ratio", "journal_kb"}


def test_growth_is_found() -> None:
    flat = [{"memory_mb": 100.0, "threads": 4, "open_files": 6, "objects": 1000}] * 20
    grown = [{**flat[0], "memory_mb": 100.0 + 3 * run, "open_files": 6 + run} for run in range(20)]
    assert soak.compare_samples(flat)["problems"] == []
    assert [text.split()[0] for text in soak.compare_samples(grown)["problems"]] == ["growth_mb", "25"]


def test_control_steps_and_ticks_are_measured(tmp_path: Path) -> None:
    (row,) = longest_step.measure(load(**{"cell.table.objects": "[1, 1]"}), tmp_path, count=1)["runs"]
    assert row["steps"] > 100 and 0 < row["longest_cpu_ms"] <= row["longest_ms"] * 1.1
    assert 0 < tick.measure_ticks(10, blocks=3)["ratio"] <= tick.MAX_RATIO
    assert tick.measure_changes(10, 3, tmp_path / "ticks")["changes"] == 20


def test_solutions_of_an_arm_are_compared_with_an_exhaustive_search() -> None:
    figures = kinematics.measure(load_cell(find_cell("xarm6")), poses=2, starts=100)
    assert (figures["problems"], figures["reachable"], figures["found_share"]) == ([], 2, 1)
    expected = np.array([[1.0] * 6, [2.0] * 6])
    assert kinematics.count_found(expected, expected[1:] + 2 * np.pi) == 1


def test_yaws_in_rendered_images_are_measured() -> None:
    figures = yaw.measure(load_cell(find_cell("overhead")), images=4, seed=1, true_boxes=True)
    assert figures["problems"] == []
    assert {row["class"]: row["within 4 std %"] for row in figures["classes"]} == {"cube": 100, "duck": 100}


def load_row(**overrides: str) -> MissionUnderTest:
    return load_mission_under_test("sort_overhead", overrides, has_oracle=True, seed=1, cell="iiwa_wsg50")


def test_grasps_of_a_gripper_and_the_limit_of_its_friction_are_measured() -> None:
    cell = load_cell(find_cell("iiwa_wsg50"))
    with closing(grasps.Gantry(cell)) as gantry:
        row = grasps.measure_class(gantry, "cube", 1, np.random.default_rng(1))
    assert (row["held %"], row["limits"]) == (100, "")
    row = grasps.measure_limit(cell, "too heavy", 1.1, 1.0, 1.0)
    assert (row["predicted"], row["measured"], row["limits"]) == ("slips", "slips", "")


@pytest.mark.slow
def test_rows_of_objects_are_sorted(tmp_path: Path) -> None:
    figures = rows.measure(load_row(), tmp_path, workers=1, rows=1, objects=2, gap_mm=8)
    assert (figures["problems"], figures["gaps"][0]["placed"]) == ([], 2)


@pytest.mark.slow
@pytest.mark.parametrize(("deferrals", "placed", "named"), [(1, 3, 3), (4, 6, 0)])
def test_objects_that_block_each_other_are_named_or_pushed(tmp_path, deferrals, placed, named) -> None:
    figures = rows.measure(load_row(deferrals=str(deferrals)), tmp_path, workers=1, rows=1, gap_mm=0)
    (row,) = figures["gaps"]
    assert (row["placed"], row["neighbour named"]) == (placed, named)


def test_the_shipped_map_is_what_the_code_measures() -> None:
    cell = load_cell(find_cell("overhead"))
    names = "label", "cup_radius", "offset"
    shipped = {tuple(row[name] for name in names): row for row in suction_map.read_map()}
    for row in suction_map.measure_map(cell, cup_radii=[0.006], offsets=[0.004]):
        other = shipped[tuple(row[name] for name in names)]
        for name, tolerance in (("sealed", 0.03), ("gap_median", 1e-4), ("force_median", 0.05)):
            assert row[name] == pytest.approx(other[name], abs=tolerance), (row, other)


def test_mutations_are_found_again_in_another_file() -> None:
    source = "class A:\n    def clamp(self, low=0):\n        print(low, 2.0 < low)\n"
    drawn = list(mutations.find_mutations(Path("a.py"), source))
    assert {one.kind: one.new for one in drawn} == {
        "constant": "4.0",
        "operator": "(2.0 <= low)",
        "deleted line": "pass",
        "swapped arguments": "print(2.0 < low, low)",
    }
    moved = list(mutations.find_mutations(Path("b.py"), "x = 1\n\n" + source))
    assert [mutations.find_again(one, moved) for one in drawn] == [one for one in moved if one.function]
    assert mutations.find_again(replace(drawn[0], new="7"), moved) is None


def test_problems_of_a_command_are_found() -> None:
    good = hostile_input.CommandResult(2, "mission.yaml:1: wrong\n", "", 1.0, 100.0)
    bad = hostile_input.CommandResult(3, "Traceback \x1b[31m", "", 5.1, 301.0)
    assert hostile_input.find_problems(["check"], good) == []
    assert len(hostile_input.find_problems(["check", "--json"], bad)) == 6


@pytest.mark.slow
def test_a_small_hostile_campaign_has_no_problem() -> None:
    figures, problem = ForkRunner(300.0).call(lambda: hostile_input.measure(12, 8, 4, seed=7))
    assert (figures["problems"], problem) == ([], "")


def test_a_wrong_bin_counts_as_reported_only_if_its_item_is_doubted(tmp_path: Path) -> None:
    cases = list_cases()
    assert len(cases) == 78 and len(list_variants(load_cell(find_cell("overhead")))) == 26
    assert (write_scene(cases[0], tmp_path), write_scene(cases[2], tmp_path)) == (None, tmp_path / "002.yaml")
    placed = FoundObject("duck", "wrong_bin", "red_bin", False, ("cube-1",), (Report("cube", "placed", ""),))
    doubted = replace(placed, reports=(Report("cube", "rejected", "looks disagree"),))
    runs = [AuditedRun(OVERHEAD, 1, "INCOMPLETE", "", (one,), 10.0) for one in (placed, doubted)]
    assert [len(run.unreported) for run in runs] == [1, 0]
    figures = summarize([Done(case, run) for case, run in zip(cases[1:3], runs, strict=True)])
    assert [row["group"] for row in figures["groups"]] == [DECLARED, cases[2].group, "total outside"]
    assert len(figures["wrong bins"]) == 2


@pytest.mark.slow
def test_a_run_is_audited_object_by_object_or_hung(tmp_path: Path) -> None:
    run = run_audited(OVERHEAD, 1, tmp_path)
    assert run.status == "SUCCESS" and run.right == len(run.known) > 2 and run.unreported == []
    assert run_audited(OVERHEAD, 1, tmp_path, wall_time_limit=0.5).status == "HUNG"


def test_success_is_silent_if_a_bin_contains_something_else_than_its_items() -> None:
    case = next(wrong_sources.list_cases())
    found = FoundObject("cube", "right", "red_bin", False, (), true_place="blue_bin", was_carried=True)
    items = (Report("cube", "placed", "", "red_bin"),)
    done = wrong_sources.Done(case, AuditedRun(OVERHEAD, 1, "SUCCESS", "", (found,), 2.0, items=items))
    assert done.silence.count(";") == 1 and done.problem.startswith("silent: cube in blue_bin")
    assert replace(done, run=replace(done.run, status="INCOMPLETE")).problem == ""
