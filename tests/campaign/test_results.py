"""Results of sweeps: rows, database, summaries, differences, requirements and the JUnit report."""

from __future__ import annotations

import sqlite3
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any
from xml.etree import ElementTree

import pytest

from executive.campaign.results import (
    FILE_NAME,
    ResultsDatabase,
    RunRecord,
    RunRow,
    SkillRow,
    SweepSettings,
    make_record,
)
from executive.campaign.sweep import make_settings, open_sweep
from executive.campaign.sweep_reports import describe_unmet_conditions, parse_requirement, write_junit
from executive.campaign.sweep_summary import (
    Estimate,
    FailureGroup,
    SkillSummary,
    SummaryStatistics,
    SweepResults,
    compute_differences,
    estimate_proportion,
    estimate_ratio,
    pair_runs,
    summarize_runs,
)
from executive.errors import InputError
from executive.events import ItemChanged, NodeEnded, NodeStarted, RunEnded, TargetSelected, TimedEvent
from executive.record.result import Audit, ItemCounts, Result
from executive.record.timeline import PlanningTotals, Timeline
from tests.benchmarks.damaged_records import damage_database

SETTINGS = SweepSettings(
    mission="sort.yaml", mission_name="sort", cell="cells/fruit.yaml", overrides={"attempts": "3"},
    variations={"speed": ("1", "2")}, first_seed=0, last_seed=9, scene=Path("s.yaml"), saves_images=True,
    inputs_hash="abc", versions={"python": "3.11"},
)  # fmt: skip
RUN = RunRow(
    run_index=3, seed=3, variant={"speed": "1"}, status="FAILURE", reason="Grasp.missed",
    message="no “seal”", node="tree/Grasp", items=ItemCounts(seen=2, placed=1, lost=1),
    audit=Audit(agrees=False, right=1), planning=PlanningTotals(4, 2, 0.1), ticks=70, robot_time_s=0.1 + 0.2,
    wall_time_s=1.5, decision_hash="f00", run_directory="runs/x", crashes=1,
)  # fmt: skip
ITEM = ItemChanged("cube-1", "cube", "lost", (0.5, 0.0, 0.0), 1, 2, "", "")
SKILL = SkillRow(run_index=3, skill="Grasp", activations=3, failed_activations=2, robot_time_s=2 / 3)
RECORD = RunRecord(RUN, ((ITEM, 1 / 3),), (SKILL,))


def make_run(seed: int, status: str = "SUCCESS", right: int = 4, left: int = 0, **fields: Any) -> RunRow:
    defaults = {
        "run_index": seed, "seed": seed, "status": status,
        "reason": "" if status == "SUCCESS" else "Grasp.missed",
        "items": ItemCounts(seen=right + left, placed=right, rejected=left),
        "audit": Audit(right=right, left=left), "planning": PlanningTotals(10, 8, 0.1),
        "robot_time_s": 30.0 + seed, "wall_time_s": 2.5, "run_directory": f"runs/{seed}",
    }  # fmt: skip
    return RunRow(**defaults | fields)


def repeat(seed: int) -> str:
    return f"executive run sort.yaml --seed {seed} --set attempts=3 --scene s.yaml"


def make_results(*runs: RunRow) -> SweepResults:
    return SweepResults("", SETTINGS, runs, summarize_runs(runs, [], SETTINGS))


def test_an_item_takes_the_time_from_its_selections_to_its_end() -> None:
    def change(item: str, state: str, bin: str = "", attempts: int = 0) -> ItemChanged:
        return ItemChanged(item, item[:-2], state, (0.5, 0.0, 0.0), 1, attempts, bin, "")

    events = (
        (0.0, change("cube-1", "seen")),
        (0.0, change("duck-1", "seen")),
        (1.0, TargetSelected("cube-1", "cube", 1, "left")),
        (2.0, TargetSelected("duck-1", "duck", 1, "right")),
        (5.0, change("duck-1", "placed", "right")),
        (6.0, TargetSelected("cube-1", "cube", 1, "left")),
        (6.0, NodeStarted("tree/Grasp", "Grasp")),
        (6.1, NodeEnded("tree/Grasp", "FAILURE", "Grasp", reason="missed")),
        (6.2, NodeStarted("tree/again:Grasp", "Grasp")),
        (6.4, NodeEnded("tree/again:Grasp", "SUCCESS", "Grasp")),
        (8.0, change("cube-1", "rejected", attempts=3)),
        (9.0, RunEnded("INCOMPLETE", "", "", "", False, "", 9, 9.0)),
    )
    timeline = Timeline.from_events(TimedEvent(round(clock * 240), clock, event) for clock, event in events)
    result = Result(
        mission="sort", status="SUCCESS", reason="", message="", node="", seed=7, robot_time_s=1 / 3
    )
    record = make_record(4, {"a": "1"}, result, timeline)
    assert (record.run.run_index, record.run.seed, record.run.variant) == (4, 7, {"a": "1"})
    assert record.run.robot_time_s == 0.333333
    assert record.items == (
        (change("cube-1", "rejected", attempts=3), 3.0),
        (change("duck-1", "placed", "right"), 3.0),
    )
    grasp = SkillRow(run_index=4, skill="Grasp", activations=2, failed_activations=1, robot_time_s=0.3)
    assert record.skills == (grasp,)


def test_all_rows_are_read_as_they_were_stored(tmp_path: Path) -> None:
    plain = RunRow(run_index=0, seed=0, variant={"speed": "1"}, status="SUCCESS")
    with closing(ResultsDatabase(tmp_path / FILE_NAME, SETTINGS)) as database:
        database.append(RECORD)
        database.append(RunRecord(plain))
        # Another process can read the stored runs.
        with closing(ResultsDatabase(tmp_path / FILE_NAME)) as reader:
            assert reader.settings == SETTINGS
            assert reader.read_runs() == [plain, RUN]
            assert reader.read_skills() == [SKILL]
    assert [path.name for path in tmp_path.iterdir()] == ["results.sqlite"], "one file contains everything"
    with closing(sqlite3.connect(tmp_path / "results.sqlite")) as connection:
        (schema,) = connection.execute("SELECT sql FROM sqlite_master WHERE name = 'runs'").fetchone()
        query = "SELECT items_placed, audit_right, planning_waited_s FROM runs WHERE audit_agrees = 0"
        assert connection.execute(query).fetchall() == [(1, 1, 0.1)]
        assert connection.execute("SELECT * FROM items").fetchall() == [
            (3, "cube-1", "cube", "lost", "", 2, 1 / 3)
        ]
    assert "robot_time_s REAL, -- Duration on the run clock" in schema


def test_a_run_is_stored_completely_or_not_at_all(tmp_path: Path) -> None:
    with closing(ResultsDatabase(tmp_path / "a", SETTINGS)) as database:
        with pytest.raises(InputError, match=r"UNIQUE.* skills\.run_index, skills\.skill"):
            database.append(replace(RECORD, skills=(SKILL, SKILL)))
        assert (database.read_runs(), database.read_skills()) == ([], [])
        database.append(RECORD)
        with pytest.raises(InputError, match=r"UNIQUE constraint failed: runs\.run_index"):
            database.append(RECORD)


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "there is no file"), ("text " * 99, "file is not a database"), ("", "has schema version 0")],
)
def test_another_file_is_refused(content: str | None, message: str, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / "file").write_text(content)
    with pytest.raises(InputError, match=message):
        ResultsDatabase(tmp_path / "file")


@pytest.mark.parametrize(
    "seed", [*range(8), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(8, 40))]
)
def test_a_damaged_database_is_read_or_refused(seed: int, tmp_path: Path) -> None:
    with closing(ResultsDatabase(tmp_path / FILE_NAME, SETTINGS)) as database:
        database.append(RECORD)
    damage_database(Random(seed), tmp_path / FILE_NAME)
    with suppress(InputError), closing(ResultsDatabase(tmp_path / FILE_NAME)) as database:
        make_results(*database.read_runs())
        database.read_skills()


@pytest.mark.parametrize(
    "changes", [{"last_seed": 2**32 - 2}, {"variations": {name: tuple("abcdefghij") for name in "xyz"}}]
)
def test_a_sweep_of_too_many_runs_or_variants_is_refused_at_once(changes: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"a sweep has 1 to 50000 runs of at most 500 variants"):
        replace(SETTINGS, **changes)


@pytest.fixture(scope="module")
def settings() -> SweepSettings:
    return make_settings("sort_fruit", range(2), {"cell.kind": "fake"}, {}, None, False)


def test_a_sweep_is_resumed_by_one_process_and_only_with_its_inputs(
    tmp_path: Path, settings: SweepSettings
) -> None:
    with (
        closing(ResultsDatabase(tmp_path / FILE_NAME, settings)),
        pytest.raises(InputError, match="another process executes the sweep"),
    ):
        open_sweep(tmp_path)
    open_sweep(tmp_path).close()
    (tmp_path / "changed").mkdir()
    ResultsDatabase(tmp_path / "changed" / FILE_NAME, replace(settings, inputs_hash="other")).close()
    with pytest.raises(InputError, match=r"changed after the sweep .*/changed\" began"):
        open_sweep(tmp_path / "changed")


def test_the_summary_counts_objects_and_groups_problems() -> None:
    wrong = make_run(2, right=3, audit=Audit(agrees=False, right=2, wrong_bin=1))
    fault = make_run(4, "FAULT", crashes=2)
    runs = [make_run(0), make_run(1, "FAILURE", right=3, left=1), wrong, make_run(3, "FAILURE"), fault]
    (summary,) = summarize_runs(runs, [], SETTINGS)
    assert [
        (share.numerator, share.denominator, share.value)
        for share in (summary.success, summary.correct_objects, summary.agreement)
    ] == [(2, 5, 0.4), (17, 19, 17 / 19), (4, 5, 0.8)]
    assert summary.objects_per_hour.value == pytest.approx(18 * 3600 / 160)
    assert summary.robot_time_s == SummaryStatistics(30.0, 32.0, 32.0, 34.0)
    assert summary.planning == PlanningTotals(50, 40, pytest.approx(0.5))
    message = summary.failure_groups[1].message
    assert message.startswith("THE AUDIT DISAGREES: 1 in a wrong bin")
    assert summary.failure_groups == (
        FailureGroup("FAILURE", "Grasp.missed", "", (1, 3), "", "runs/1", repeat(1)),
        FailureGroup("SUCCESS", "disagreement", "", (2,), message, "runs/2", repeat(2)),
        FailureGroup("FAULT", "Grasp.missed", "", (4,), "", "runs/4", repeat(4)),
    )


def test_variants_and_their_skills_are_separate() -> None:
    runs = [make_run(seed, variant={"a": "1"}) for seed in range(2)]
    runs.append(make_run(2, variant={"a": "2"}, audit=None))
    skills = [
        SkillRow(run_index=job, skill=name, activations=2, failed_activations=job, robot_time_s=time)
        for job, name, time in ((0, "Grasp", 1.0), (0, "Transit", 5.0), (1, "Grasp", 2.0), (2, "Grasp", 7.0))
    ]
    first, second = summarize_runs(runs, skills, SETTINGS)
    assert (first.variant, second.variant) == ({"a": "1"}, {"a": "2"})
    assert first.skills == (SkillSummary("Transit", 2, 0, 2.5), SkillSummary("Grasp", 4, 1, 1.5))
    assert second.skills == (SkillSummary("Grasp", 2, 2, 7.0),)
    # Without ground truth no object counts.
    assert (second.correct_objects, second.agreement) == (Estimate(0, 0), Estimate(0, 0))


@pytest.mark.parametrize(
    ("successes", "total", "low", "high"),
    # Newcombe, Statistics in Medicine 17 (1998), table I, method 3.
    [(81, 263, 0.2553, 0.3662), (0, 20, 0.0, 0.1611)],
)
def test_the_interval_of_a_proportion_is_the_published_one(
    successes: int, total: int, low: float, high: float
) -> None:
    estimate = estimate_proportion(successes, total)
    assert (estimate.low, estimate.high) == pytest.approx((low, high), abs=5e-5)
    assert estimate.value == successes / total


def test_the_interval_of_a_ratio_is_that_of_its_standard_error() -> None:
    tops = [float(4 + number % 3) for number in range(50)]
    bottoms = [9.0 + number % 4 for number in range(50)]
    estimate = estimate_ratio(tops, bottoms)
    assert estimate == estimate_ratio(tops, bottoms)
    assert estimate.value is not None and estimate.low is not None and estimate.high is not None
    # Standard error of a ratio estimate (Cochran, Sampling Techniques, equation 2.39).
    assert estimate.low < estimate.value < estimate.high
    residuals = [top - estimate.value * bottom for top, bottom in zip(tops, bottoms, strict=True)]
    error = sum(one**2 for one in residuals) ** 0.5 / sum(bottoms)
    assert estimate.high - estimate.low == pytest.approx(2 * 1.96 * error, rel=0.1)
    assert (estimate_ratio([2.0], [4.0]), estimate_ratio([], [])) == (Estimate(2.0, 4.0, 0.5), Estimate(0, 0))


def test_a_loss_has_an_interval_that_excludes_zero() -> None:
    runs_a = [make_run(seed, robot_time_s=10.0 + seed % 4) for seed in range(40)]
    runs_b = [
        make_run(seed, "SUCCESS" if seed % 4 else "FAILURE", right=3, robot_time_s=11.0 + seed % 4)
        for seed in range(40)
    ]
    success, throughput, time = compute_differences(pair_runs(runs_a, runs_b))
    assert (success.a, success.b, success.difference) == (1.0, 0.75, -0.25)
    assert success.low is not None and success.high is not None
    # The normal approximation gives -0.25 -+ 0.134.
    assert -0.42 < success.low < -0.32 and -0.16 < success.high < -0.08
    assert success.is_significant and throughput.is_significant
    # Only the seeds with two successes count, and each of them takes one second more.
    assert (time.difference, time.low, time.high) == (1.0, 1.0, 1.0)


def test_one_pair_has_no_interval_and_other_seeds_are_omitted() -> None:
    pairs = pair_runs(
        [make_run(0), make_run(1), make_run(2)], [make_run(0, robot_time_s=99.0), make_run(1, right=3)]
    )
    assert [(pair.seed, pair.is_changed) for pair in pairs] == [(0, False), (1, True)]
    success, _, time = compute_differences(pair_runs([make_run(0)], [make_run(0, "FAILURE")]))
    assert (success.difference, success.low, success.is_significant) == (-1.0, None, False)
    assert (time.a, time.difference) == (None, None)


def find_unmet(text: str, *runs: RunRow) -> list[str]:
    return describe_unmet_conditions(parse_requirement(text), make_results(*runs))


@pytest.mark.parametrize(
    ("text", "unmet"),
    [
        ("success >= 1.0 and p95(robot_time_s)<40", []),
        ("median(robot_time_s)<35 and max(ticks)<1", ["median(robot_time_s)<35 is not met: the value is 35"]),
        ("mean(robot_time_s)>35", ["mean(robot_time_s)>35 is not met: the value is 35"]),
        ("objects_per_hour>1e4", ["objects_per_hour>10000 is not met: the value is 411.429"]),
        ("agreement>0.5", ["agreement>0.5 is not met: no run has a value"]),
        ("max(audit_wrong_bin)<1", ["max(audit_wrong_bin)<1 is not met: no run has a value"]),
    ],
)  # fmt: skip
def test_each_condition_is_met_or_explained(text: str, unmet: list[str]) -> None:
    assert find_unmet(text, *(make_run(seed, audit=None) for seed in range(1, 10))) == unmet


def test_every_variant_must_meet_the_requirement() -> None:
    runs = (make_run(1, variant={"v": "a"}), make_run(2, "FAILURE", variant={"v": "b"}))
    assert find_unmet("success>0.5", *runs) == ["success>0.5 is not met with v=b: the value is 0"]
    assert find_unmet("success>0.5") == ["no run has ended"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is no comparison of a metric with a number; write for example"),
        ("success=1", "is no comparison"),
        (
            "speed>1",
            r'there is no metric "speed"; the metrics are success, agreement, objects_per_hour, mean\(',
        ),
        ("success>1 and " * 999, "has 13986 characters; the maximum is"),
        ("p98(ticks)>1", r"p95\(COLUMN\), p99\(COLUMN\), max\(COLUMN\)$"),
        ("p95(seed)>1", "is no numeric column of the runs; these are ticks, robot_time_s, .*items_seen"),
    ],
)
def test_another_text_is_refused_with_the_allowed_names(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_requirement(text)


def test_each_run_is_a_test_case_of_the_junit_report(tmp_path: Path) -> None:
    runs = [
        make_run(0),
        make_run(1, "FAILURE", message="no <seal> \x1b on “cube-1”", node="tree/Grasp"),
        make_run(2, "FAULT", reason="fault", message="it broke"),
        make_run(3, audit=Audit(agrees=False, wrong_bin=1), variant={"speed": "1"}),
    ]
    write_junit(tmp_path / "junit.xml", make_results(*runs))
    root = ElementTree.parse(tmp_path / "junit.xml").getroot()
    (suite,) = root
    assert (root.tag, suite.tag, suite.get("name")) == ("testsuites", "testsuite", "executive sweep sort")
    assert [suite.get(name) for name in ("tests", "failures", "errors", "time")] == ["4", "2", "1", "10.000"]
    assert {(case.tag, case.get("classname"), case.get("time")) for case in suite} == {
        ("testcase", "sort", "2.500")
    }
    assert [case.get("name") for case in suite] == ["seed 0", "seed 1", "seed 2", "seed 3 speed=1"]
    assert [case.findtext("system-out") for case in suite] == list(map(SETTINGS.make_repeat_command, runs))
    problems = [case[0] for case in suite if len(case) > 1]
    assert [(one.tag, one.get("type")) for one in problems] == [
        ("failure", "Grasp.missed"), ("error", "fault"), ("failure", "disagreement"),
    ]  # fmt: skip
    assert problems[0].text == "FAILURE Grasp.missed tree/Grasp\nno <seal> � on “cube-1”\nruns/1"
    assert str(problems[2].get("message")).startswith("THE AUDIT DISAGREES: 1 in a wrong bin")
