"""Many seeds of one mission."""

from __future__ import annotations

import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from unittest.mock import patch

import pytest

from executive.campaign.sweep import (
    SweepJob,
    compute_wilson_interval,
    run_job,
    run_sweep,
    summarize_results,
    summarize_values,
)
from executive.errors import InputError
from executive.record.audit_comparison import Audit, ItemCounts
from executive.record.result import Result
from executive.record.timeline.timeline import PlanningTotals


def result(seed: int, status: str = "SUCCESS", right: int = 4, left: int = 0, **more) -> Result:
    fields = {
        "mission": "sort", "status": status, "reason": "" if status == "SUCCESS" else "Grasp.missed",
        "message": "", "node": "", "items": ItemCounts(seen=right + left, placed=right, rejected=left),
        "audit": Audit(right=right, left=left), "planning": PlanningTotals(10, 8, 0.1),
        "robot_time_s": 30.0 + seed, "wall_time_s": 6.0, "run": f"runs/{seed}",
    }  # fmt: skip
    return Result(seed=seed, **fields | more)


def swept(seeds: range, work, **options) -> list:
    """Sweep without a mission: `work` says what comes of it."""
    jobs = [SweepJob("sort", seed, {"a": "1"}, Path("runs"), False) for seed in seeds]
    with patch("executive.campaign.sweep.run_job", work):
        return run_sweep(jobs, **options)


def work(job: SweepJob) -> Result:
    """Do a run in another process, in a way that the seed says."""
    if job.seed == 3:
        raise ValueError("seed three")
    if job.seed == 4:
        raise InputError("there is no place for seed four")
    return result(job.seed, ticks=os.getpid(), unknown_labels=dict(job.overrides))


@pytest.mark.slow
def test_every_seed_is_run_once_in_another_process():
    reported = []
    results = swept(range(1, 5), work, progress=lambda done, total: reported.append((done, total)))
    assert [entry.seed for entry in results] == [1, 2, 3, 4]
    assert results[0].ticks != os.getpid()
    assert results[0].unknown_labels == {"a": "1"}
    assert (results[2].status, results[2].message) == ("FAULT", "ValueError: seed three")
    assert (results[3].status, results[3].message) == ("FAULT", "there is no place for seed four")
    assert results[2].planning == PlanningTotals()
    assert reported == [(1, 4), (2, 4), (3, 4), (4, 4)]


def interrupt(job: SweepJob) -> Result:
    """Do a run during which somebody presses Ctrl-C."""
    os.kill(os.getppid(), signal.SIGINT)
    time.sleep(0.2)
    return result(job.seed)


@pytest.fixture
def sigint():
    """Hear SIGINT: what a shell runs in the background begins with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.slow
def test_every_run_leaves_its_record_and_its_report(tmp_path):
    few = {"cell.kind": "fake", "cell.table.objects": "[1, 1]"}
    result = run_job(SweepJob("sort_fruit", 3, few, tmp_path, saves_pictures=False))
    assert result.status == "SUCCESS"
    assert (Path(result.run) / "report.html").is_file()


@pytest.mark.slow
@pytest.mark.usefixtures("sigint")
def test_after_ctrl_c_no_further_run_begins_and_the_results_so_far_are_kept():
    reported = []
    results = swept(range(9), interrupt, workers=1, on_halt=lambda: reported.append("halting"))
    assert ([entry.seed for entry in results], reported) == ([0], ["halting"])
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def die(job: SweepJob) -> Result:
    """Take the process down with the run, if the seed says so."""
    if job.seed == 0:
        os._exit(1)
    return result(job.seed)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_a_run_that_takes_its_process_down_costs_only_what_runs_beside_it(workers):
    results = swept(range(4), die, workers=workers)
    assert [entry.seed for entry in results] == [0, 1, 2, 3]
    lost = [entry for entry in results if entry.status != "SUCCESS"]
    assert lost[0].seed == 0 and len(lost) <= workers
    assert all("BrokenProcessPool" in entry.message for entry in lost)


class Torn:
    """A pool whose process died before anybody looked."""

    def submit(self, *job: object) -> None:
        raise BrokenProcessPool("died")

    def shutdown(self) -> None:
        pass


def test_a_pool_found_broken_is_replaced_and_no_run_is_lost(monkeypatch):
    pools = iter([Torn(), ThreadPoolExecutor(1)])
    monkeypatch.setattr("executive.campaign.pool.WorkerPool", lambda count: next(pools))
    results = swept(range(2), lambda job: result(job.seed), workers=1)
    assert [entry.status for entry in results] == ["SUCCESS", "SUCCESS"]


def test_the_summary_counts_objects_and_lists_what_went_wrong():
    wrong = result(2, right=3, audit=Audit(agrees=False, right=2, wrong_bin=1))
    figures = summarize_results([result(0), result(1, "FAILURE", right=3, left=1), wrong], requested_count=3)
    assert (figures["asked"], figures["cut_off"]) == (3, False)
    assert (figures["runs"], figures["succeeded"]) == (3, 2)
    assert (figures["objects"]["right"], figures["objects"]["total"]) == (9, 11)
    assert [entry["seed"] for entry in figures["disagreements"]] == [2]
    assert [(entry["seed"], entry["reason"]) for entry in figures["failures"]] == [(1, "Grasp.missed")]
    assert figures["robot_time_s"] == {"least": 30.0, "median": 31.0, "mean": 31.0, "most": 32.0}
    assert figures["robot_time_per_object_s"] == round(93.0 / 9, 3)
    assert figures["planning"] == {"motions": 30, "ahead": 24, "waited_s": 0.3}


def test_runs_that_were_halted_or_never_began_make_it_cut_off_and_count_in_nothing_else():
    whole, halted = result(0), result(1, "HALTED", right=1, left=3)
    figures = summarize_results([whole, halted], requested_count=6)
    assert (figures["asked"], figures["cut_off"]) == (6, True)
    assert summarize_results([whole], requested_count=1) == {**figures, "asked": 1, "cut_off": False}
    # Without an audit no object counts.
    figures = summarize_results([result(0, audit=None)], requested_count=1)
    assert (figures["objects"]["total"], figures["disagreements"]) == (0, [])
    assert figures["robot_time_per_object_s"] is None


@pytest.mark.parametrize(
    ("successes", "total", "low", "high"),
    # Newcombe, Statistics in Medicine 17 (1998), table I, method 3.
    [(81, 263, 0.2553, 0.3662), (0, 20, 0.0, 0.1611), (0, 0, 0.0, 1.0)],
)
def test_the_interval_is_the_published_one(successes, total, low, high):
    assert compute_wilson_interval(successes, total) == pytest.approx((low, high), abs=5e-5)


def test_the_spread_of_nothing_is_zero():
    assert summarize_values([]) == {"least": 0.0, "median": 0.0, "mean": 0.0, "most": 0.0}
