"""A mission run many times in one process: growth of memory, threads, open files and objects."""

from __future__ import annotations

import gc
import os
import shutil
import statistics
import tempfile
from collections.abc import Sequence
from pathlib import Path

import click

from executive.campaign.mission_under_test import MissionUnderTest
from executive.errors import InputError
from tests.benchmarks.report import Figures, describe, record_subject, run_mission_command, show_progress

PROCESS = Path("/proc/self")
"""Folder in which Linux lists the resources of this process."""
WARM_UP_RUNS = 5
"""Number of warm-up runs, after which a run loads nothing more."""
MAX_GROWTH = 20.0
"""Limit of the growth of the memory over all runs [MB]; a thousand simulated runs may add 0.02 MB each."""
MAX_OBJECTS_PER_RUN = 2.0
"""Limit of the Python objects that a run leaves behind, including its sample."""


def measure(subject: MissionUnderTest, runs: int = 100) -> Figures:
    """Record many runs of MISSION with consecutive seeds in one process, and compare its resources."""
    if not PROCESS.is_dir():
        raise InputError(f"resources of a process are read from {PROCESS}, which only Linux has; use Linux")
    samples: list[Figures] = []
    failed: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in show_progress(range(subject.seed, subject.seed + runs), "run"):
            result, problem = record_subject(subject, seed, Path(folder))
            failed += [problem] if problem else []
            shutil.rmtree(result["run"])
            samples.append(take_sample())
    return {**describe(subject), "runs": runs, **compare_samples(samples, failed)}


def take_sample() -> Figures:
    """Return the resources of this process after a garbage collection."""
    gc.collect()
    pages = int((PROCESS / "statm").read_text().split()[1])
    return {
        "memory_mb": round(pages * os.sysconf("SC_PAGE_SIZE") / 1e6, 3),
        "threads": len(os.listdir(PROCESS / "task")),
        "open_files": len(os.listdir(PROCESS / "fd")),
        "objects": len(gc.get_objects()),
    }


def compare_samples(samples: Sequence[Figures], failed: Sequence[str] = ()) -> Figures:
    """Return how much the resources grew over the samples, and every limit that was exceeded."""
    warm, last = samples[min(WARM_UP_RUNS, len(samples)) - 1], samples[-1]
    figures = {
        "growth_mb": len(samples) * _slope(samples, "memory_mb"),
        "objects_per_run": _slope(samples, "objects"),
    }
    problems = [
        f"{name} is {figures[name]:.4g}; {limit:.3g} is allowed"
        for name, limit in (("growth_mb", MAX_GROWTH), ("objects_per_run", MAX_OBJECTS_PER_RUN))
        if figures[name] > limit
    ] + [
        f"{last[name]} {name} after the last run; {warm[name]} when warm"
        for name in ("threads", "open_files")
        if last[name] > warm[name]
    ]
    return {
        **figures,
        "samples": [{"after": "warm-up", **warm}, {"after": "last run", **last}],
        "problems": [*problems, *failed],
    }


def _slope(samples: Sequence[Figures], name: str) -> float:
    """Return the growth of a resource per run: least squares over the last three quarters of the runs."""
    values = [sample[name] for sample in samples[len(samples) // 4 :]]
    return statistics.linear_regression(range(len(values)), values).slope if len(values) > 1 else 0.0


if __name__ == "__main__":
    run_mission_command(
        measure,
        click.option(
            "--runs", type=click.IntRange(min=1), default=100, show_default=True, help="Number of runs."
        ),
    )
