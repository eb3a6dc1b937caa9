"""Differences between two missions."""

from __future__ import annotations

from executive.campaign.results.differences import compute_differences, pair_runs
from executive.campaign.results.rows import RunRow
from executive.record.result import Audit, ItemCounts


def make_run(seed: int, status: str = "SUCCESS", time: float = 10.0, placed: int = 4) -> RunRow:
    reason = "" if status == "SUCCESS" else "Grasp.missed"
    return RunRow(
        run_index=seed, seed=seed, status=status, reason=reason, message="", node="", robot_time_s=time,
        items=ItemCounts(seen=placed, placed=placed), audit=Audit(right=placed),
    )  # fmt: skip


def test_a_mission_compared_with_itself_has_no_difference() -> None:
    runs = [make_run(seed, "FAILURE" if seed % 3 == 0 else "SUCCESS", 9.7 + seed) for seed in range(20)]
    pairs = pair_runs(runs, runs)
    differences = compute_differences(pairs)
    assert [(one.difference, one.low, one.high) for one in differences] == [(0.0, 0.0, 0.0)] * 3
    assert not any(one.is_significant for one in differences)
    assert not any(pair.is_changed for pair in pairs)


def test_a_loss_has_an_interval_that_excludes_zero() -> None:
    runs_a = [make_run(seed, time=10.0 + seed % 4) for seed in range(40)]
    runs_b = [
        make_run(seed, "FAILURE" if seed % 4 == 0 else "SUCCESS", 11.0 + seed % 4, placed=3)
        for seed in range(40)
    ]
    pairs = pair_runs(runs_a, runs_b)
    success, throughput, time = compute_differences(pairs)
    assert (success.a, success.b, success.difference) == (1.0, 0.75, -0.25)
    assert success.low is not None and success.high is not None
    # The normal approximation gives -0.25 -+ 0.134.
    assert -0.42 < success.low < -0.32 and -0.16 < success.high < -0.08
    assert success.is_significant and throughput.is_significant
    # Only the seeds with two successes count, and each of them takes one second more.
    assert (time.difference, time.low, time.high) == (1.0, 1.0, 1.0)
    assert [pair.seed for pair in pairs if pair.a.status != pair.b.status] == list(range(0, 40, 4))


def test_the_outcome_consists_of_status_reason_and_audit() -> None:
    pairs = pair_runs(
        [make_run(0), make_run(1), make_run(2)], [make_run(0, time=99.0), make_run(1, placed=3)]
    )
    assert [(pair.seed, pair.is_changed) for pair in pairs] == [(0, False), (1, True)]


def test_without_enough_runs_there_is_no_interval() -> None:
    success, _, time = compute_differences(pair_runs([make_run(0)], [make_run(0, "FAILURE")]))
    assert (success.difference, success.low) == (-1.0, None)
    assert (time.a, time.difference) == (None, None)
    assert [one.difference for one in compute_differences([])] == [None] * 3
