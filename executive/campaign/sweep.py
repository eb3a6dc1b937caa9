"""Sweep over seeds of one mission, with a process and a run directory for each run."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from executive.campaign.pool import run_jobs
from executive.errors import ExecutiveError
from executive.record.result import Audit, Result


@dataclass(frozen=True)
class Job:
    """One run of a mission.

    Attributes:
        mission: Mission file, or name of a shipped mission.
        seed: Random seed.
        overrides: Values of params of the mission and keys of the cell, as given with `--set`.
        runs: Folder of the run directories.
        frames: True to save the images that decisions are based on.
        scene: Scene file, or None.
    """

    mission: str
    seed: int
    overrides: Mapping[str, str]
    runs: Path
    frames: bool
    scene: Path | None = None


def sweep(
    jobs: Sequence[Job],
    *,
    workers: int = 2,
    progress: Callable[[int, int], None] | None = None,
    halting: Callable[[], None] | None = None,
    work: Callable[[Job], Result] | None = None,
) -> list[Result]:
    """Execute all jobs and return the results in the order of the jobs.

    A run that ends its process has the status `FAULT`. After Ctrl-C or SIGTERM no further run starts, running
    runs halt, and the results so far are returned.

    Args:
        jobs: The runs.
        workers: Number of processes.
        progress: Called with the number of finished runs and of all runs.
        halting: Called after the first signal.
        work: Executes one job, in a process of its own; None: `run_job`.
    """
    results = run_jobs(jobs, work or run_job, _fail_job, workers=workers, progress=progress, halting=halting)
    return [result for result in results if result is not None]


def run_job(job: Job) -> Result:
    """Execute one run, write its record and its report, and return its result."""
    from executive.mission.load import load_mission
    from executive.plugins import discover
    from executive.record.recorded_run import RecordOptions, record_run
    from executive.run.assembly import RunOptions
    from executive.view.report.page import try_write_report

    skills = discover()
    loaded = load_mission(job.mission, skills, job.overrides)
    options = RunOptions(job.seed, scene=job.scene)
    result = record_run(loaded, skills, options, job.runs, RecordOptions(saves_pictures=job.frames))
    # A failure to write the report does not change the result.
    try_write_report(result.run)
    return result


def summarize(results: Sequence[Result], requested: int) -> dict[str, Any]:
    """Return the figures of a sweep: correctly sorted objects, disagreements, times and failures.

    Halted runs count only as missing from the number of `requested` runs.
    """
    results = [result for result in results if result.status != "HALTED"]
    audits = [result.audit for result in results if result.audit is not None]
    right = sum(audit.right for audit in audits)
    total = sum(audit.right + audit.wrong_bin + audit.left + audit.elsewhere for audit in audits)
    low, high = wilson_interval(right, total)
    return {
        "asked": requested,
        "cut_off": len(results) < requested,
        "runs": len(results),
        "succeeded": sum(result.status == "SUCCESS" for result in results),
        "objects": {
            "right": right,
            "total": total,
            "share": round(right / total, 6) if total else 0.0,
            "interval_95": [round(low, 6), round(high, 6)],
        },
        "disagreements": [
            {"seed": result.seed, "items": asdict(result.items), "audit": asdict(audit), "run": result.run}
            for result in results
            if (audit := result.audit) is not None and not audit.agrees
        ],
        "robot_time_s": summarize_values([result.robot_time_s for result in results]),
        "robot_time_per_object_s": (
            round(sum(result.robot_time_s for result in results) / right, 3) if right else None
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


def wilson_interval(successes: int, total: int) -> tuple[float, float]:
    """Return the 95 % Wilson score interval of a proportion; (0, 1) if the total is 0."""
    if total == 0:
        return 0.0, 1.0
    from scipy.stats import binomtest  # The import takes 0.5 s, which the workers must not spend.

    interval = binomtest(successes, total).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def summarize_values(values: Sequence[float]) -> dict[str, float]:
    """Return `least, median, mean, most` of `values`; all are 0 without values."""
    functions: dict[str, Callable[[Sequence[float]], float]]
    functions = {"least": min, "median": statistics.median, "mean": statistics.fmean, "most": max}
    return {name: round(function(values), 3) if values else 0.0 for name, function in functions.items()}


def _fail_job(job: Job, error: BaseException) -> Result:
    """Return the result of a run that ended with an exception or ended its process."""
    return Result(
        mission=job.mission,
        status="FAULT",
        reason="fault",
        message=str(error) if isinstance(error, ExecutiveError) else f"{type(error).__name__}: {error}",
        node="",
        seed=job.seed,
        audit=Audit(),
    )
