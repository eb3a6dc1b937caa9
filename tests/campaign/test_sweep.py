"""Many seeds and variants of one mission."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest

from executive.campaign.pool import JobOptions, run_jobs
from executive.campaign.results.database import ResultsDatabase
from executive.campaign.results.rows import RunRecord, RunRow, SweepSettings, make_record
from executive.campaign.results.tables import RUNS
from executive.campaign.sweep import (
    SweepJob,
    list_jobs,
    make_fault_record,
    make_repeat_command,
    run_job,
    run_sweep,
)
from executive.errors import InputError
from executive.mission.load import load_mission
from executive.plugins import load_skills
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.timeline.timeline import Timeline
from executive.run.assembly import RunOptions

SETTINGS = SweepSettings(
    mission="sort", mission_name="sort", cell="c.yaml", overrides={"a": "1"}, variations={}, first_seed=0,
    last_seed=3, scene=None, saves_images=False, inputs_hash="", versions={},
)  # fmt: skip


def record(job: SweepJob, **values: object) -> RunRecord:
    end = {"status": "SUCCESS", "reason": "", "message": "", "node": ""}
    return RunRecord(RunRow(run_index=job.index, seed=job.seed, variant=job.variant, **end | values))


def swept(folder: Path, work: Callable[[SweepJob], RunRecord], count: int = 4, **options) -> list[RunRow]:
    """Sweep without a mission: `work` says what comes of it."""
    jobs = list_jobs(replace(SETTINGS, last_seed=count - 1), folder)
    with (
        patch("executive.campaign.sweep.run_job", work),
        closing(ResultsDatabase(folder / "a", SETTINGS)) as database,
    ):
        run_sweep(jobs, database, JobOptions(**options))
        return database.read(RUNS)


def test_every_seed_is_run_with_every_combination() -> None:
    settings = replace(
        SETTINGS, variations={"b": ("1", "2"), "c": ("x", "y")}, last_seed=1, scene=Path("s.yaml")
    )
    jobs = list_jobs(settings, Path("folder"))
    assert [(job.index, job.seed, "".join(job.variant.values())) for job in jobs] == [
        (0, 0, "1x"), (1, 1, "1x"), (2, 0, "1y"), (3, 1, "1y"),
        (4, 0, "2x"), (5, 1, "2x"), (6, 0, "2y"), (7, 1, "2y"),
    ]  # fmt: skip
    assert make_repeat_command(settings, record(jobs[3]).run) == (
        "executive run sort --seed 1 --set a=1 --set b=1 --set c=y --scene s.yaml"
    )


def work(job: SweepJob) -> RunRecord:
    """Do a run in another process, in a way that the seed says."""
    if job.seed == 2:
        raise ValueError("seed two")
    if job.seed == 3:
        raise InputError("there is no place for seed three")
    return record(job, ticks=os.getpid(), message=job.settings.overrides["a"])


@pytest.mark.slow
def test_every_seed_is_run_once_in_another_process(tmp_path: Path) -> None:
    reported: list[tuple[int, int]] = []
    rows = swept(tmp_path, work, on_progress=lambda done, total: reported.append((done, total)))
    assert [row.seed for row in rows] == [0, 1, 2, 3]
    assert rows[0].ticks != os.getpid()
    assert rows[0].message == "1"
    assert [(row.status, row.message, row.crashes) for row in rows[2:]] == [
        ("FAULT", "ValueError: seed two", 0),
        ("FAULT", "there is no place for seed three", 0),
    ]
    assert reported == [(1, 4), (2, 4), (3, 4), (4, 4)]


def interrupt(job: SweepJob) -> RunRecord:
    """Do a run during which somebody presses Ctrl-C."""
    if job.seed == 1:
        os.kill(os.getppid(), signal.SIGINT)
        time.sleep(0.2)
        return record(job, status="HALTED")
    return record(job)


@pytest.fixture
def sigint() -> Iterator[None]:
    """Hear SIGINT: what a shell runs in the background begins with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.slow
@pytest.mark.usefixtures("sigint")
def test_after_ctrl_c_no_further_run_begins_and_halted_runs_are_not_stored(tmp_path: Path) -> None:
    reported: list[str] = []
    rows = swept(tmp_path, interrupt, workers=1, on_halt=lambda: reported.append("halting"))
    assert ([row.seed for row in rows], reported) == ([0], ["halting"])
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def die(job: SweepJob) -> RunRecord:
    """Take the process down with the run of seed 0 always, and of seed 1 the first time."""
    mark = job.runs_folder / "died"
    if job.seed == 0 or (job.seed == 1 and not mark.exists()):
        mark.touch() if job.seed == 1 else None
        os._exit(1)
    return record(job)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_a_run_that_takes_its_process_down_is_repeated_once_and_costs_no_other_run(
    workers: int, tmp_path: Path
) -> None:
    rows = swept(tmp_path, die, workers=workers)
    assert [(row.seed, row.status, row.crashes) for row in rows] == [
        (0, "FAULT", 2), (1, "SUCCESS", 1), (2, "SUCCESS", 0), (3, "SUCCESS", 0),
    ]  # fmt: skip
    assert "BrokenProcessPool" in rows[0].message


class Torn:
    """A pool whose process died before anybody looked."""

    def submit(self, *job: object) -> None:
        raise BrokenProcessPool("died")

    def shutdown(self) -> None:
        pass


def test_a_pool_found_broken_is_replaced_and_no_run_is_lost(monkeypatch, tmp_path: Path) -> None:
    pools = iter([Torn(), ThreadPoolExecutor(1)])
    monkeypatch.setattr("executive.campaign.pool.WorkerPool", lambda count: next(pools))
    monkeypatch.setattr(ResultsDatabase, "append", lambda self, record: stored.append(record.run.status))
    stored: list[str] = []
    swept(tmp_path, record, count=2, workers=1)
    assert stored == ["SUCCESS", "SUCCESS"]


def test_runs_of_a_worker_are_equal_to_single_runs(tmp_path: Path) -> None:
    variations = {"cell.table.objects": ("[1, 1]", "[2, 2]")}
    settings = replace(SETTINGS, mission="sort_fruit", overrides={}, variations=variations)
    jobs = list_jobs(settings, tmp_path)
    # The same process runs all jobs, as a worker does.
    for job in (jobs[0], jobs[5], jobs[1]):
        found = run_job(job)
        loaded = load_mission("sort_fruit", load_skills(), job.variant)
        single = record_run(loaded, RunOptions(job.seed), tmp_path / "single")
        expected = make_record(
            job.index,
            job.variant,
            single,
            Timeline.from_events(read_journal(Path(single.run) / "journal.jsonl")),
        )
        same_run = replace(
            expected.run, wall_time_s=found.run.wall_time_s, run_directory=found.run.run_directory
        )
        assert found == replace(expected, run=same_run)
        assert (
            found.run.decision_hash
            == json.loads((Path(found.run.run_directory) / "result.json").read_text())["trace"]
            != ""
        )


@pytest.mark.slow
def test_only_a_run_with_a_problem_has_a_report(tmp_path: Path) -> None:
    mission = tmp_path / "look.yaml"
    mission.write_text(
        "mission: look\ndescription: Look.\ncell: cells/overhead.yaml\n"
        "routes: {cube: red_bin}\ntree: [MoveToScan, Detect, Localize, SelectTarget]\n"
    )
    overrides = {"cell.table.objects": "[0, 0]", "cell.kind": "fake"}
    for name, has_report in (("sort_fruit", False), (str(mission), True)):
        settings = replace(SETTINGS, mission=name, overrides=overrides)
        run = run_job(list_jobs(settings, tmp_path)[0]).run
        assert (run.problem != "", (Path(run.run_directory) / "report.html").is_file()) == (
            has_report,
            has_report,
        ), run


@pytest.mark.slow
def test_simulated_runs_of_a_worker_are_equal_to_single_runs(tmp_path: Path) -> None:
    overrides = {"cell.table.objects": "[1, 1]"}
    settings = replace(SETTINGS, mission="sort_overhead", overrides=overrides, first_seed=5, last_seed=7)
    # The worker has one thread and reuses the model; this process has two threads and loads it once more.
    found = run_jobs(list_jobs(settings, tmp_path), run_job, make_fault_record, JobOptions(1))[-1]
    assert found is not None
    loaded = load_mission("sort_overhead", load_skills(), overrides)
    history = Timeline()
    single = record_run(loaded, RunOptions(7), tmp_path / "single", RecordOptions(timeline=history))
    expected = make_record(2, {}, single, history)
    same_run = replace(expected.run, wall_time_s=found.run.wall_time_s, run_directory=found.run.run_directory)
    assert found == replace(expected, run=same_run)
