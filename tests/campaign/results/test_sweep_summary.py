"""Statistics of the runs of a sweep, and their confidence intervals."""

from __future__ import annotations

import pytest

from executive.campaign.results.intervals import Estimate, estimate_proportion, estimate_ratio
from executive.campaign.results.rows import RunRow, SkillRow
from executive.campaign.results.sweep_summary import (
    FailureGroup,
    SkillSummary,
    SummaryStatistics,
    summarize_runs,
)
from executive.record.result import Audit, ItemCounts
from executive.record.timeline.timeline import PlanningTotals


def run(seed: int, status: str = "SUCCESS", right: int = 4, left: int = 0, **more: object) -> RunRow:
    fields = {
        "run_index": seed, "seed": seed, "status": status,
        "reason": "" if status == "SUCCESS" else "Grasp.missed", "message": "", "node": "",
        "items": ItemCounts(seen=right + left, placed=right, rejected=left),
        "audit": Audit(right=right, left=left), "planning": PlanningTotals(10, 8, 0.1),
        "robot_time_s": 30.0 + seed, "wall_time_s": 6.0, "run_directory": f"runs/{seed}",
    }  # fmt: skip
    return RunRow(**fields | more)


def repeat(run: RunRow) -> str:
    return f"repeat {run.seed}"


def test_the_summary_counts_objects_and_groups_problems() -> None:
    wrong = run(2, right=3, audit=Audit(agrees=False, right=2, wrong_bin=1))
    runs = [run(0), run(1, "FAILURE", right=3, left=1), wrong, run(3, "FAILURE"), run(4, "FAULT", crashes=2)]
    (summary,) = summarize_runs(runs, [], repeat)
    assert [
        (share.numerator, share.denominator, share.value)
        for share in (summary.success, summary.correct_objects, summary.agreement)
    ] == [(2, 5, 0.4), (17, 19, 17 / 19), (4, 5, 0.8)]
    assert summary.objects_per_hour.value == pytest.approx(18 * 3600 / 160)
    assert summary.robot_time_s == SummaryStatistics(30.0, 32.0, 32.0, 34.0)
    assert summary.planning == PlanningTotals(50, 40, pytest.approx(0.5))
    assert summary.failure_groups == (
        FailureGroup("FAILURE", "Grasp.missed", "", (1, 3), "", "runs/1", "repeat 1"),
        FailureGroup(
            "SUCCESS", "disagreement", "", (2,),
            "THE AUDIT DISAGREES: 1 in a wrong bin; the audit found 2 in their bins, 0 on the table and 0 "
            "elsewhere; the executive reports 3 placed, 0 rejected, 0 skipped and 0 lost",
            "runs/2", "repeat 2",
        ),
        FailureGroup("FAULT", "Grasp.missed", "", (4,), "", "runs/4", "repeat 4"),
    )  # fmt: skip


def test_variants_and_their_skills_are_separate() -> None:
    runs = [run(0, variant={"a": "1"}), run(1, variant={"a": "1"}), run(2, variant={"a": "2"}, audit=None)]
    skills = [
        SkillRow(run_index=job, skill=name, activations=2, failed_activations=job, robot_time_s=time)
        for job, name, time in ((0, "Grasp", 1.0), (0, "Transit", 5.0), (1, "Grasp", 2.0), (2, "Grasp", 7.0))
    ]
    first, second = summarize_runs(runs, skills, repeat)
    assert (first.variant, second.variant) == ({"a": "1"}, {"a": "2"})
    assert first.skills == (SkillSummary("Transit", 2, 0, 2.5), SkillSummary("Grasp", 4, 1, 1.5))
    assert second.skills == (SkillSummary("Grasp", 2, 2, 7.0),)
    # Without ground truth no object counts.
    assert (second.correct_objects, second.agreement) == (Estimate(0, 0), Estimate(0, 0))
    assert summarize_runs([], [], repeat) == []


@pytest.mark.parametrize(
    ("successes", "total", "low", "high"),
    # Newcombe, Statistics in Medicine 17 (1998), table I, method 3.
    [(81, 263, 0.2553, 0.3662), (0, 20, 0.0, 0.1611)],
)
def test_the_interval_of_a_share_is_the_published_one(
    successes: int, total: int, low: float, high: float
) -> None:
    estimate = estimate_proportion(successes, total)
    assert (estimate.low, estimate.high) == pytest.approx((low, high), abs=5e-5)
    assert estimate.value == successes / total


def test_the_interval_of_a_ratio_contains_the_ratio_and_can_be_repeated() -> None:
    tops, bottoms = (
        [float(4 + number % 3) for number in range(50)],
        [9.0 + number % 4 for number in range(50)],
    )
    estimate = estimate_ratio(tops, bottoms)
    assert estimate == estimate_ratio(tops, bottoms)
    assert estimate.value is not None and estimate.low is not None and estimate.high is not None
    # Standard error of a ratio estimate (Cochran, Sampling Techniques, equation 2.39).
    assert estimate.low < estimate.value < estimate.high
    residuals = [top - estimate.value * bottom for top, bottom in zip(tops, bottoms, strict=True)]
    error = sum(one**2 for one in residuals) ** 0.5 / sum(bottoms)
    assert estimate.high - estimate.low == pytest.approx(2 * 1.96 * error, rel=0.1)
    assert estimate_ratio([2.0, 2.0], [4.0, 4.0]) == Estimate(4.0, 8.0, 0.5, 0.5, 0.5)
    assert (estimate_ratio([2.0], [4.0]), estimate_ratio([], [])) == (Estimate(2.0, 4.0, 0.5), Estimate(0, 0))
