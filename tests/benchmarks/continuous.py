"""A long run with objects that arrive, and with emptied bins: books, memory, tick time, sizes, replay."""

from __future__ import annotations

import math
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np

from executive.behaviours import load_skills
from executive.campaign.jobs import MissionUnderTest
from executive.drivers.fake import FakeDriver
from executive.drivers.fake_world import list_grid_points
from executive.geometry import Pose
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.replayed_run import replay_run
from executive.run.assembly import RunOptions
from executive.run.run import Run
from executive.view.report import write_report
from tests.benchmarks.report import Figures, SilentView, describe, run_command
from tests.benchmarks.soak import take_sample

MAX_OBJECTS_IN_BIN = 6
"""Number of objects with which a bin is emptied; more would pile up to the path of the arm."""
MAX_OBJECTS_ON_TABLE = 4
"""Number of objects, except the rejected ones, with which no further object arrives."""
PERIOD = 64
"""Number of control steps between two arrivals, and between two measured control steps."""
MIN_DISTANCE = 0.15
"""Minimum distance of an arriving object from all others and from the arm [m]."""
LIMITS = {"memory_kb": 2.0, "tick_ratio": 1.1, "journal_kb": 30.0, "report_mb": 20.0, "rejected": 0.01}
"""Limits: growth of the memory and size of the journal per object; median CPU time of a control step during
the last tenth of the run, relative to the first; size of the report; rejected fraction of the objects."""


class Supply(SilentView):
    """Puts objects on the table of a running cell, empties its bins, and measures memory and tick times."""

    def __init__(self, subject: MissionUnderTest, objects: int) -> None:
        self._config = subject.loaded.cell_config
        self._random = np.random.default_rng(subject.seed)
        self._missing_count = objects
        self._part_size = objects / 10
        self._start_time = 0.0
        self.samples: list[Figures] = []
        self.tick_times: list[list[float]] = [[]]

    def open(self, run: Run) -> None:
        """Supply the cell of a run."""
        self._run = run
        self._driver: Any = run.station.driver
        self._missing_count -= len(self._driver.list_objects())
        run.station.tick_callbacks.append(self._advance)

    def _advance(self) -> None:
        phase = self._run.tick % PERIOD
        if phase == 1:
            self.tick_times[-1].append(1e3 * (time.thread_time() - self._start_time))
        elif phase == 2:
            self._supply()
        self._start_time = time.thread_time()

    def _supply(self) -> None:
        """Empty full bins, take a sample after each tenth of the objects, and let an object arrive."""
        driver = self._driver
        ledger = self._run.station.ledger
        bins = self._run.cell.bins
        for name in bins:
            if ledger.count_objects_in(name) >= MAX_OBJECTS_IN_BIN:
                self._run.control.empty_bins(name)
        if ledger.count_items("placed") >= self._part_size * len(self.tick_times):
            self.samples.append(take_sample())
            self.tick_times.append([])
        positions = [each.position for each in driver.list_objects()]
        on_table = [each for each in positions if not any(bin.contains(each, 0.05) for bin in bins.values())]
        points = list_grid_points(self._config)
        x, y = points[self._random.integers(len(points))]
        occupied = [*on_table, self._run.station.unrecorded_cell.arm.tool_pose.position]
        is_free = all(math.dist((x, y), other[:2]) > MIN_DISTANCE for other in occupied)
        max_count = MAX_OBJECTS_ON_TABLE + ledger.count_items("rejected")
        if not (self._missing_count and is_free and len(on_table) < max_count):
            return
        self._missing_count -= 1
        label = str(self._random.choice(list(self._config.objects)))
        if isinstance(driver, FakeDriver):
            driver.world.put(label, x, y)
        else:
            section = self._config.objects[label]
            X_WO = Pose.of((x, y, section.height / 2))
            driver.world.place_object(driver.world.add_object(label, X_WO, section.colours[0]), X_WO)


def measure(subject: MissionUnderTest, runs_folder: Path, objects: int = 2000) -> Figures:
    """Record one run of MISSION in which OBJECTS objects arrive, replay it, and write its report."""
    supply = Supply(subject, objects)
    options = RunOptions(subject.seed, make_cell=subject.make_cell, has_keyboard=False)
    result = record_run(subject.loaded, options, runs_folder, RecordOptions([supply]))
    path = Path(result.run)
    ticks = [statistics.median(part) for part in supply.tick_times if part]
    figures = {
        "memory_kb": 1e3 * (supply.samples[-1]["memory_mb"] - supply.samples[0]["memory_mb"]) / objects,
        "tick_ratio": ticks[len(supply.samples) - 1] / ticks[0],
        "journal_kb": (path / "journal.jsonl").stat().st_size / 1e3 / objects,
        "report_mb": write_report(path).stat().st_size / 1e6,
        "rejected": result.items.rejected / objects,
    }
    problems = [
        f"{name} is {figures[name]:.3g}; {LIMITS[name]:g} is allowed"
        for name in LIMITS
        if figures[name] > LIMITS[name]
    ]
    if result.disagreement or not result.items.seen == objects == result.items.placed + result.items.rejected:
        problems.append(f"{result.status} {result.message}: {result.items}, {result.audit}")
    replay = replay_run(path, read_journal(path / "journal.jsonl"), load_skills())
    problems += filter(None, [replay.difference])
    samples = [{"tick_ms": tick, **sample} for tick, sample in zip(ticks, supply.samples, strict=False)]
    about = {**describe(subject), "run": str(path), "wall_time_s": result.wall_time_s}
    return {**about, **figures, "samples": samples, "problems": problems}


if __name__ == "__main__":
    run_command(measure)
