"""Longest control step of recorded runs, without planning, images and detection.

A control step is a tick of the tree with its events and their record, and one physics step. Wall times
contain the syncs of the journal and the delays by other processes; CPU times of the thread contain neither.

With `--wall-clock`, a fake cell runs on the wall clock: CPU times then contain all that a tick computes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from py_trees.trees import BehaviourTree

from executive.campaign.jobs import MissionUnderTest
from executive.cell.config import CellConfig
from executive.cell.devices import DriverOptions, WallClock
from executive.drivers.fake import FakeDriver
from executive.geometry import Array
from executive.record.recorded_run import RecordOptions, record_run
from executive.run.assembly import RunOptions
from executive.run.run import Run
from executive.station.border import Access
from executive.station.station import Station
from executive.testing.fake_cell import FakeCell
from tests.benchmarks.report import Figures, SilentView, describe, run_command, show_progress

MAX_STEP_TIME = 0.005
"""Limit of the wall time of a control step; on the wall clock, of the CPU time of a tick [s]."""
MAX_LATE_SHARE = 0.01
"""Largest share of the ticks on the wall clock that may be late."""
EXCLUDED_ROLES = ("planner", "plan", "camera", "image", "detector", "request")
"""Roles of the parts that plan motions, capture images and detect objects, whose times do not count."""


class WallClockDriver(FakeDriver):
    """Devices of a fake cell on the wall clock."""

    def __init__(self, config: CellConfig, options: DriverOptions) -> None:
        super().__init__(config, options, WallClock(config.clock.step))


class StepTimer(SilentView):
    """View of a run that measures its control steps.

    Args:
        excluded_roles: Roles of the parts whose times do not count.

    Attributes:
        steps: For each step: wall time and CPU time of the thread [s], without the excluded accesses.
        clock: Clock of the devices of the run.
    """

    clock: Any

    def __init__(self, excluded_roles: Collection[str] = EXCLUDED_ROLES) -> None:
        self.steps: list[Array] = []
        self._excluded_roles = excluded_roles
        self._excluded = np.zeros(2)
        self._is_excluding = False
        self._start: Array | None = None

    def open(self, run: Run) -> None:
        """Measure the time between the starts of all ticks."""
        self.clock = run.station.driver.clock
        run.station.border.interceptor = self.intercept
        run.behaviour_tree.add_pre_tick_handler(self._begin_step)

    def intercept(self, access: Access) -> Any:
        """Execute an access to the cell, and exclude its time if it plans, captures or detects."""
        # The camera captures its image within an access, whose time must not count twice.
        if access.role not in self._excluded_roles or self._is_excluding:
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


def measure(
    subject: MissionUnderTest, runs_folder: Path, count: int = 20, wall_clock: bool = False
) -> Figures:
    """Measure the control steps of `--count` runs of MISSION, which are recorded below `--runs`."""
    make_cell: Callable[..., Station] = subject.make_cell
    if wall_clock:
        make_cell = partial(FakeCell, kind=WallClockDriver)
    rows = []
    for seed in show_progress(range(subject.seed, subject.seed + count), "runs"):
        timer = StepTimer(() if wall_clock else EXCLUDED_ROLES)
        options = RunOptions(seed, subject.requests, make_cell=make_cell)
        record_run(subject.loaded, options, runs_folder, RecordOptions([timer]))
        wall_time, cpu_time = 1e3 * np.max(timer.steps, axis=0)
        row = {"seed": seed, "steps": len(timer.steps), "longest_ms": wall_time, "longest_cpu_ms": cpu_time}
        if wall_clock:
            row["late_share"] = timer.clock.late_tick_count / len(timer.steps)
        rows.append(row)
    figures = {name: max(row[name] for row in rows) for name in ("longest_ms", "longest_cpu_ms")}
    limit = 1e3 * MAX_STEP_TIME
    problems = []
    if figures["longest_cpu_ms" if wall_clock else "longest_ms"] > limit:
        problems.append(f"a control step took more than {limit:g} ms")
    if wall_clock:
        figures["late_share"] = sum(row["late_share"] for row in rows) / len(rows)
        if figures["late_share"] > MAX_LATE_SHARE:
            problems.append(f"more than {MAX_LATE_SHARE:.0%} of the ticks were late")
    return {**describe(subject), "runs": rows, **figures, "problems": problems}


def _read_clocks() -> Array:
    """Return wall time and CPU time of this thread [s]."""
    return np.array([time.perf_counter(), time.thread_time()])


if __name__ == "__main__":
    run_command(measure)
