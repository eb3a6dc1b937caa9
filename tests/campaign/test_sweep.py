"""Sweeps: jobs in processes of their own, and the runs that are stored."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executive.behaviours import load_skills
from executive.campaign.jobs import JobOptions, SweepJob, list_jobs, make_fault_record, run_job, run_jobs
from executive.campaign.results import ResultsDatabase, RunRecord, RunRow, SweepSettings, make_record
from executive.campaign.sweep import run_sweep
from executive.errors import InputError
from executive.mission.load import load_mission
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.timeline import Timeline
from executive.run.assembly import RunOptions
from executive.run.operator import HALT_SIGNALS, RunControl, halt_on_signals

SLOW = pytest.mark.slow
SETTINGS = SweepSettings(
    mission="sort", mission_name="sort", cell="c.yaml", overrides={"a": "1"}, variations={}, first_seed=0,
    last_seed=3, scene=None, saves_images=False, inputs_hash="", versions={},
)  # fmt: skip


@pytest.fixture
def signals() -> Iterator[None]:
    """Hear SIGINT, which is ignored in a process in the background of a shell, and SIGTERM."""
    handlers = {number: signal.signal(number, signal.default_int_handler) for number in HALT_SIGNALS}
    yield
    assert all(signal.getsignal(number) is signal.default_int_handler for number in HALT_SIGNALS)
    for number, handler in handlers.items():
        signal.signal(number, handler)


def halve(number: int) -> float:
    if number % 2:
        raise ValueError(f"{number} is odd")
    return number / 2


def describe_fault(job: object, error: BaseException) -> Any:
    return f"{job}: {error}"


def test_every_job_is_done_and_the_results_are_in_their_order() -> None:
    progress: list[tuple[int, int]] = []
    stored: list[tuple[Any, ...]] = []
    options = JobOptions(on_progress=lambda *counts: progress.append(counts))
    results = run_jobs([4, 3, 2, 2], halve, describe_fault, options, lambda *result: stored.append(result))
    assert (results, progress) == ([2.0, "3: 3 is odd", 1.0, 1.0], [(1, 4), (2, 4), (3, 4), (4, 4)])
    assert sorted(stored) == [(index, result, 0) for index, result in enumerate(results)]
    assert run_jobs([], halve, describe_fault) == []


def wait_for_halt(number: signal.Signals) -> str:
    control = RunControl()
    with halt_on_signals(control):
        os.kill(os.getppid(), number)
        while not control.is_stopped:
            time.sleep(0.01)
    return "halted in good order"


@pytest.mark.usefixtures("signals")
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=SLOW)])
def test_a_signal_halts_the_running_jobs(number: signal.Signals) -> None:
    calls: list[str] = []
    options = JobOptions(1, on_halt=lambda: calls.append("halting"))
    results = run_jobs([number] * 3, wait_for_halt, describe_fault, options)
    assert (results, calls) == (["halted in good order", None, None], ["halting"])


def ignore_halt(number: signal.Signals) -> str:
    os.kill(os.getppid(), number)
    signal.pause()
    return "never returned"


@pytest.mark.usefixtures("signals")
def test_a_second_signal_ends_the_running_jobs_at_once() -> None:
    options = JobOptions(1, on_halt=lambda: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        run_jobs([signal.SIGINT] * 3, ignore_halt, describe_fault, options)
    assert multiprocessing.active_children() == []


def end_with_parent(number: signal.Signals) -> str:
    os.kill(os.getppid(), number)
    os.kill(os.getpid(), signal.SIGTERM)
    return "never returned"


@pytest.mark.slow
@pytest.mark.usefixtures("signals")
def test_a_job_whose_process_was_ended_with_this_one_has_no_result() -> None:
    assert run_jobs([signal.SIGTERM] * 2, end_with_parent, describe_fault, JobOptions(1)) == [None, None]


def make_sweep_record(job: SweepJob, status: str = "SUCCESS", **fields: Any) -> RunRecord:
    return RunRecord(RunRow(run_index=job.index, seed=job.seed, variant=job.variant, status=status, **fields))


def store_runs(
    folder: Path, monkeypatch: pytest.MonkeyPatch, run: Callable[[SweepJob], RunRecord], **options: Any
) -> list[RunRow]:
    """Sweep without a mission: `run` makes the record of a job."""
    monkeypatch.setattr("executive.campaign.sweep.run_job", run)
    with closing(ResultsDatabase(folder / "a", SETTINGS)) as database:
        run_sweep(database, JobOptions(**options))
        return database.read_runs()


def test_every_seed_is_run_with_every_combination() -> None:
    settings = replace(
        SETTINGS, variations={"b": ("1", "2"), "c": ("x", "y")}, last_seed=1, scene=Path("s.yaml"),
        replacing_cell="depth",
    )  # fmt: skip
    jobs = list_jobs(settings, Path("folder"))
    assert [(job.index, job.seed, "".join(job.variant.values())) for job in jobs] == [
        (0, 0, "1x"), (1, 1, "1x"), (2, 0, "1y"), (3, 1, "1y"),
        (4, 0, "2x"), (5, 1, "2x"), (6, 0, "2y"), (7, 1, "2y"),
    ]  # fmt: skip
    assert settings.make_repeat_command(make_sweep_record(jobs[3]).run) == (
        "executive run sort --seed 1 --set a=1 --set b=1 --set c=y --cell depth --scene s.yaml"
    )


def run_or_die(job: SweepJob) -> RunRecord:
    """Kill the process in the run of seed 0 always, and of seed 1 the first time; seed 3 has no run."""
    mark = job.runs_folder / "died"
    if job.seed == 0 or (job.seed == 1 and not mark.exists()):
        if job.seed == 1:
            mark.touch()
        os._exit(1)
    if job.seed == 3:
        raise InputError("there is no place for seed three")
    return make_sweep_record(job, message=job.settings.overrides["a"])


@pytest.mark.slow
def test_a_run_whose_process_died_is_repeated_once_and_costs_no_other_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = store_runs(tmp_path, monkeypatch, run_or_die)
    assert [(row.seed, row.status, row.crashes) for row in rows] == [
        (0, "FAULT", 2), (1, "SUCCESS", 1), (2, "SUCCESS", 0), (3, "FAULT", 0),
    ]  # fmt: skip
    assert "BrokenProcessPool" in rows[0].message
    assert [row.message for row in rows[2:]] == ["1", "there is no place for seed three"]


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (OSError(28, os.strerror(28)), "environment"), (MemoryError(), "environment"),
        (BrokenProcessPool(), "environment"), (ValueError(), "fault"),
        (InputError("no run directory: no space left on device"), "environment"),
    ],
)  # fmt: skip
def test_the_reason_of_a_fault_says_whether_the_run_is_repeated(error: Exception, reason: str) -> None:
    assert make_fault_record(list_jobs(SETTINGS, Path())[0], error).run.reason == reason


def halt_second(job: SweepJob) -> RunRecord:
    if job.seed == 1:
        os.kill(os.getppid(), signal.SIGINT)
        time.sleep(0.2)
        return make_sweep_record(job, "HALTED")
    return make_sweep_record(job)


@pytest.mark.slow
@pytest.mark.usefixtures("signals")
def test_halted_runs_are_not_stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert [row.seed for row in store_runs(tmp_path, monkeypatch, halt_second, workers=1)] == [0]


@pytest.mark.parametrize(
    ("mission", "size"), [("kit_fasteners", "[2, 2]"), pytest.param("sort_overhead", "[1, 1]", marks=SLOW)]
)
def test_the_run_of_a_worker_is_equal_to_a_single_run(mission: str, size: str, tmp_path: Path) -> None:
    settings = replace(
        SETTINGS, mission=mission, overrides={}, variations={"cell.table.objects": ("[1, 2]", size)}
    )
    job = list_jobs(settings, tmp_path)[5]
    # The worker has one thread and has executed another job before.
    found = run_jobs([replace(job, seed=0), job], run_job, make_fault_record, JobOptions(1))[-1]
    assert found is not None
    history = Timeline()
    loaded = load_mission(mission, load_skills(), {"cell.table.objects": size})
    single = record_run(loaded, RunOptions(1), tmp_path / "single", RecordOptions(timeline=history))
    expected = make_record(5, {"cell.table.objects": size}, single, history)
    same_run = replace(expected.run, wall_time_s=found.run.wall_time_s, run_directory=found.run.run_directory)
    assert found == replace(expected, run=same_run)
    result = json.loads((Path(found.run.run_directory) / "result.json").read_text())
    assert found.run.decision_hash == result["trace"] != ""
    assert found.run.items.placed == sum(item.state == "placed" for item, _ in found.items) > 0
    assert not (Path(found.run.run_directory) / "report.html").exists()
