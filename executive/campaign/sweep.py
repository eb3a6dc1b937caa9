"""Sweep: runs of one mission with different seeds, in worker processes, each with a run directory."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from executive.campaign.pool import run_jobs
from executive.errors import ExecutiveError
from executive.record.audit_comparison import Audit
from executive.record.result import Result


@dataclass(frozen=True)
class SweepJob:
    """One run of a mission in a sweep.

    Attributes:
        mission: Mission file, or name of a shipped mission.
        seed: Random seed.
        overrides: Values of params of the mission and keys of the cell, as given with `--set`.
        runs_folder: Folder in which the run directory is made.
        saves_pictures: True to save the images on which decisions are based.
        scene: Scene file that changes the objects and the camera; None: no change.
    """

    mission: str
    seed: int
    overrides: Mapping[str, str]
    runs_folder: Path
    saves_pictures: bool
    scene: Path | None = None


def run_sweep(
    jobs: Sequence[SweepJob],
    *,
    workers: int = 2,
    progress: Callable[[int, int], None] = lambda *_: None,
    on_halt: Callable[[], None] = lambda: None,
) -> list[Result]:
    """Execute all jobs and return the results in the order of the jobs.

    A run whose process dies has the status `FAULT`. After Ctrl-C or SIGTERM no further run starts, current
    runs are halted, and only the results of the ended runs are returned. `workers`, `progress` and `on_halt`
    have the same meaning as in `executive.campaign.pool.run_jobs`.
    """
    results = run_jobs(jobs, run_job, _make_fault_result, workers=workers, progress=progress, on_halt=on_halt)
    return [result for result in results if result is not None]


def run_job(job: SweepJob) -> Result:
    """Execute and record one run, write the report if possible, and return the result."""
    from executive.mission.load import load_mission
    from executive.plugins import load_skills
    from executive.record.recorded_run import RecordOptions, record_run
    from executive.run.assembly import RunOptions
    from executive.view.report.page import try_write_report

    skills = load_skills()
    loaded = load_mission(job.mission, skills, job.overrides)
    options = RunOptions(job.seed, scene=job.scene)
    record_options = RecordOptions(saves_pictures=job.saves_pictures)
    result = record_run(loaded, skills, options, job.runs_folder, record_options)
    try_write_report(result.run)
    return result


def summarize_results(results: Sequence[Result], requested_count: int) -> dict[str, Any]:
    """Return the statistics of a sweep: sorted objects, disagreements, times and failures.

    The statistics contain only complete runs. `asked` is `requested_count`, and `cut_off` is True if fewer
    runs are complete.
    """
    results = [result for result in results if result.status != "HALTED"]
    audits = [result.audit for result in results if result.audit is not None]
    sorted_count = sum(audit.right for audit in audits)
    total_count = sum(audit.right + audit.wrong_bin + audit.left + audit.elsewhere for audit in audits)
    return {
        "asked": requested_count,
        "cut_off": len(results) < requested_count,
        "runs": len(results),
        "succeeded": sum(result.status == "SUCCESS" for result in results),
        "objects": {
            "right": sorted_count,
            "total": total_count,
            "share": round(sorted_count / total_count, 6) if total_count else 0.0,
            "interval_95": [round(limit, 6) for limit in compute_wilson_interval(sorted_count, total_count)],
        },
        "disagreements": [
            {"seed": result.seed, "items": asdict(result.items), "audit": asdict(audit), "run": result.run}
            for result in results
            if (audit := result.audit) is not None and not audit.agrees
        ],
        "robot_time_s": summarize_values([result.robot_time_s for result in results]),
        "robot_time_per_object_s": (
            round(sum(result.robot_time_s for result in results) / sorted_count, 3) if sorted_count else None
        ),
        "planning": {
            key: round(sum(getattr(result.planning, key) for result in results), 3)
            for key in ("motions", "ahead", "waited_s")
        },
        "wall_time_s": summarize_values([result.wall_time_s for result in results]),
        "failures": [
            {key: getattr(result, key) for key in ("seed", "status", "reason", "message", "node", "run")}
            for result in results
            if result.status != "SUCCESS"
        ],
    }


def compute_wilson_interval(successes: int, total: int) -> tuple[float, float]:
    """Return the 95 % Wilson score interval of the proportion successes / total; (0, 1) if total is 0."""
    if total == 0:
        return 0.0, 1.0
    from scipy.stats import binomtest  # Imported here, because workers do not need the import of 0.5 s.

    interval = binomtest(successes, total).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def summarize_values(values: Sequence[float]) -> dict[str, float]:
    """Return minimum (`least`), `median`, `mean` and maximum (`most`) of the values; 0 without values."""
    values = values or [0.0]
    median, mean = statistics.median(values), statistics.fmean(values)
    summary = {"least": min(values), "median": median, "mean": mean, "most": max(values)}
    return {name: round(value, 3) for name, value in summary.items()}


def _make_fault_result(job: SweepJob, error: BaseException) -> Result:
    """Return the result of a run that raised an exception or whose process died."""
    return Result(
        mission=job.mission,
        status="FAULT",
        reason="fault",
        message=str(error) if isinstance(error, ExecutiveError) else f"{type(error).__name__}: {error}",
        node="",
        seed=job.seed,
        audit=Audit(),
    )
