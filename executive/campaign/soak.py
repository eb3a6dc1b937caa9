"""Many runs one after the other in this process: what they leave behind in it."""

from __future__ import annotations

import gc
import os
import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from executive.campaign.subject import Subject
from executive.errors import InputError
from executive.record.recorded_run import recorded_run
from executive.record.result import ledger_agrees
from executive.view.figures.soak import Sample, SoakFigures
from executive.view.terminal.summary import verdict

PROCESS = Path("/proc/self")
"""Where Linux tells what a process has."""


def soak(
    subject: Subject,
    runs: int,
    *,
    frames: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> SoakFigures:
    """Run a mission so many times, each with the next seed and a record of its own, and look what remains.

    Args:
        subject: The mission, and the first seed.
        runs: How many.
        frames: Whether the runs save the pictures behind their decisions.
        progress: Told how many runs of how many are done.

    Raises:
        InputError: The system does not tell what a process has.
    """
    if not PROCESS.is_dir():
        raise InputError(f"what a process has is read from {PROCESS}, which only Linux has; soak there")
    samples: list[Sample] = []
    failed: list[tuple[int, str]] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(subject.seed, subject.seed + runs):
            result = recorded_run(
                subject.loaded,
                subject.skills,
                seed=seed,
                runs=Path(folder),
                requests=subject.requests,
                frames=frames,
                kind=subject.kind,
            )
            if result["status"] == "HALTED":
                break
            if problem := _wrong(result):
                failed.append((seed, problem))
            shutil.rmtree(result["run"])
            samples.append(sample())
            if progress is not None:
                progress(len(samples), runs)
    return SoakFigures(subject.name, subject.cell, subject.seed, tuple(samples), tuple(failed), runs)


def sample() -> Sample:
    """Return what this process has now, what nobody can reach collected."""
    gc.collect()
    pages = int((PROCESS / "statm").read_text().split()[1])
    return Sample(
        memory=round(pages * os.sysconf("SC_PAGE_SIZE") / 1e6, 3),
        threads=len(os.listdir(PROCESS / "task")),
        handles=len(os.listdir(PROCESS / "fd")),
        objects=len(gc.get_objects()),
    )


def _wrong(result: Mapping[str, Any]) -> str:
    """Return how a run went wrong, or ""."""
    if result["status"] != "SUCCESS":
        return verdict(result)
    return "" if ledger_agrees(result) else f"the ledger says {result['items']}; the audit {result['audit']}"
