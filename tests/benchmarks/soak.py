"""A mission run many times in one process: growth of memory, threads, open files and objects."""

from __future__ import annotations

import gc
import os
import shutil
import statistics
import tempfile
from collections.abc import Sequence
from pathlib import Path

from executive.campaign.jobs import MissionUnderTest
from tests.benchmarks.report import Figures, describe, record_subject, run_command, show_progress

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
    warm = samples[min(WARM_UP_RUNS, len(samples)) - 1]
    last = samples[-1]
    growth = len(samples) * _compute_slope(samples, "memory_mb")
    objects = _compute_slope(samples, "objects")
    problems = [*failed]
    if growth > MAX_GROWTH:
        problems.append(f"growth_mb is {growth:.4g}; {MAX_GROWTH:g} is allowed")
    if objects > MAX_OBJECTS_PER_RUN:
        problems.append(f"objects_per_run is {objects:.4g}; {MAX_OBJECTS_PER_RUN:g} is allowed")
    for name in ("threads", "open_files"):
        if last[name] > warm[name]:
            problems.append(f"{last[name]} {name} after the last run; {warm[name]} when warm")
    return {
        "growth_mb": growth,
        "objects_per_run": objects,
        "samples": [{"after": "warm-up", **warm}, {"after": "last run", **last}],
        "problems": problems,
    }


def _compute_slope(samples: Sequence[Figures], name: str) -> float:
    """Return the growth of a resource per run: least squares over the last three quarters of the runs."""
    values = [sample[name] for sample in samples[len(samples) // 4 :]]
    return statistics.linear_regression(range(len(values)), values).slope if len(values) > 1 else 0.0


if __name__ == "__main__":
    run_command(measure)
