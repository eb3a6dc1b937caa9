"""Longest control step of recorded runs, without planning, images and detection.

A control step is a tick of the tree with its events and their record, and one physics step. Wall times
contain the syncs of the journal and the delays by other processes; CPU times of the thread contain neither.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from py_trees.trees import BehaviourTree

from executive.campaign.jobs import MissionUnderTest
from executive.geometry import Array
from executive.record.recorded_run import RecordOptions, record_run
from executive.run.assembly import RunOptions
from executive.run.run import Run
from executive.station.border import Access
from tests.benchmarks.report import Figures, SilentView, describe, run_command, show_progress

MAX_STEP_TIME = 0.005
"""Limit of the wall time of a control step [s]."""
EXCLUDED_ROLES = ("planner", "plan", "camera", "image", "detector", "request")
"""Roles of the parts that plan motions, capture images and detect objects, whose times do not count."""


class StepTimer(SilentView):
    """View of a run that measures its control steps.

    Attributes:
        steps: For each step: wall time and CPU time of the thread [s], without the excluded accesses.
    """

    def __init__(self) -> None:
        self.steps: list[Array] = []
        self._excluded = np.zeros(2)
        self._is_excluding = False
        self._start: Array | None = None

    def open(self, run: Run) -> None:
        """Measure the time between the starts of all ticks."""
        run.station.border.interceptor = self.intercept
        run.behaviour_tree.add_pre_tick_handler(self._begin_step)

    def intercept(self, access: Access) -> Any:
        """Execute an access to the cell, and exclude its time if it plans, captures or detects."""
        # The camera captures its image within an access, whose time must not count twice.
        if access.role not in EXCLUDED_ROLES or self._is_excluding:
            return access.proceed()
        start = _read_clocks()
        self._is_excluding = True
        try:
            return access.proceed()
        finally:
            self._is_excluding = False
            self._excluded += _read_clocks() - start

    def _begin_step(self, tree: BehaviourTree) -> None:
        del tree
        now = _read_clocks()
        if self._start is not None:
            self.steps.append(now - self._start - self._excluded)
        self._start = now
        self._excluded = np.zeros(2)


def measure(subject: MissionUnderTest, runs_folder: Path, count: int = 20) -> Figures:
    """Measure the control steps of `--count` runs of MISSION, which are recorded below `--runs`."""
    rows = []
    for seed in show_progress(range(subject.seed, subject.seed + count), "runs"):
        timer = StepTimer()

        options = RunOptions(seed, subject.requests, make_cell=subject.make_cell)
        record_run(subject.loaded, options, runs_folder, RecordOptions([timer]))
        wall_time, cpu_time = 1e3 * np.max(timer.steps, axis=0)
        rows.append(
            {"seed": seed, "steps": len(timer.steps), "longest_ms": wall_time, "longest_cpu_ms": cpu_time}
        )
    longest = max(row["longest_ms"] for row in rows)
    limit = 1e3 * MAX_STEP_TIME
    return {
        **describe(subject),
        "runs": rows,
        "longest_ms": longest,
        "longest_cpu_ms": max(row["longest_cpu_ms"] for row in rows),
        "problems": [f"a control step took more than {limit:g} ms"] if longest > limit else [],
    }


def _read_clocks() -> Array:
    """Return wall time and CPU time of this thread [s]."""
    return np.array([time.perf_counter(), time.thread_time()])


if __name__ == "__main__":
    run_command(measure)
