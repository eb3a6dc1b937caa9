"""The journal's share of the wall time of a run."""

from __future__ import annotations

import tempfile
import time
from contextlib import closing
from pathlib import Path

from executive.campaign.mission_under_test import MissionUnderTest
from executive.cli.options import runs_option
from executive.events import Event
from executive.record.recorder import Recorder
from executive.record.run_directory import RunDirectory
from executive.run.assembly import RunOptions, assemble
from tests.benchmarks.report import Figures, describe, run_mission_command

MAX_PERCENT = 3.0
"""Limit of the journal's share of the wall time of a simulated run."""


def measure(subject: MissionUnderTest, runs_folder: Path) -> Figures:
    """Measure the journal's share of a run of MISSION; the record is made below `--runs` and removed."""
    runs_folder.mkdir(parents=True, exist_ok=True)
    times: list[float] = []
    began = time.perf_counter()
    options = RunOptions(subject.seed, subject.requests, make_cell=subject.make_cell)
    run = assemble(subject.loaded, options)
    with closing(run), tempfile.TemporaryDirectory(prefix=".journal-", dir=runs_folder) as folder:
        with closing(Recorder(RunDirectory(Path(folder)), saves_pictures=False)) as recorder:

            def record(event: Event) -> None:
                received = time.perf_counter()
                recorder(event)
                times.append(time.perf_counter() - received)

            run.add_observer(record)
            run.execute()
        wall = time.perf_counter() - began
    return {
        **describe(subject),
        "events": len(times),
        "journal_s": sum(times),
        "run_s": wall,
        "percent": 100 * sum(times) / wall,
        "allowed_percent": MAX_PERCENT,
    }


if __name__ == "__main__":
    run_mission_command(measure, runs_option)
