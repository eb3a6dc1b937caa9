"""The share of the wall time of a run in which the tick loop waits for the record."""

from __future__ import annotations

import tempfile
import time
from contextlib import closing
from pathlib import Path

from executive.campaign.jobs import MissionUnderTest
from executive.events import TimedEvent
from executive.record.journal import Recorder
from executive.record.run_directory import RunDirectory
from executive.run.assembly import RunOptions, assemble
from tests.benchmarks.report import Figures, describe, run_command


def measure(subject: MissionUnderTest, runs_folder: Path) -> Figures:
    """Measure the journal's share of a run of MISSION; the record is made below `--runs` and removed."""
    runs_folder.mkdir(parents=True, exist_ok=True)
    times: list[float] = []
    began = time.perf_counter()
    run = assemble(subject.loaded, RunOptions(subject.seed, subject.requests, make_cell=subject.make_cell))
    with closing(run), tempfile.TemporaryDirectory(prefix=".journal-", dir=runs_folder) as folder:
        with closing(Recorder(RunDirectory(Path(folder)), saves_pictures=False)) as recorder:

            def record(timed: TimedEvent) -> None:
                received = time.perf_counter()
                recorder(timed)
                times.append(time.perf_counter() - received)

            run.add_observer(record)
            run.execute()
        wall_time = time.perf_counter() - began
    percent = 100 * sum(times) / wall_time
    return {**describe(subject), "events": len(times), "run_s": wall_time, "journal_percent": percent}


if __name__ == "__main__":
    run_command(measure)
