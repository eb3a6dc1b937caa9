"""The journal's share of the wall time of a run."""

from __future__ import annotations

import tempfile
import time
from contextlib import closing
from pathlib import Path

from executive.campaign.subject import Subject
from executive.cli.options import runs_option
from executive.record.entry import Entry
from executive.record.journal import Journal
from executive.record.recorder import Recorder
from executive.record.run_directory import RunDirectory
from executive.runtime.run import Run
from tests.benchmarks.report import Figures, describe, run_mission_command

MAX_PERCENT = 3.0
"""Limit of the journal's share of the wall time of a simulated run."""


class TimedJournal(Journal):
    """A journal that measures itself.

    Attributes:
        entries: Number of entries so far.
        seconds: Wall time in which they were encoded, written and synced [s].
    """

    def __init__(self, path: Path, *, again: bool = False) -> None:
        super().__init__(path, again=again)
        self.entries, self.seconds = 0, 0.0

    def append(self, entry: Entry) -> None:
        """Append `entry`."""
        began = time.perf_counter()
        super().append(entry)
        self.seconds += time.perf_counter() - began
        self.entries += 1


def measure(subject: Subject, runs: Path) -> Figures:
    """Measure the journal's share of a run of MISSION; the record is made below `--runs` and removed."""
    runs.mkdir(parents=True, exist_ok=True)
    journals: list[TimedJournal] = []

    def make_journal(path: Path, *, again: bool) -> TimedJournal:
        journals.append(TimedJournal(path, again=again))
        return journals[0]

    with tempfile.TemporaryDirectory(prefix=".journal-", dir=runs, ignore_cleanup_errors=True) as folder:
        began = time.perf_counter()
        run = Run(
            subject.loaded, subject.skills, seed=subject.seed, requests=subject.requests, kind=subject.kind
        )
        recorder = Recorder(RunDirectory(Path(folder)), journal=make_journal)
        with closing(run), closing(recorder):
            run.observe(recorder)
            run.execute()
            wall = time.perf_counter() - began
    (journal,) = journals
    percent = 100 * journal.seconds / wall
    return {
        **describe(subject),
        "entries": journal.entries,
        "journal_s": journal.seconds,
        "run_s": wall,
        "percent": percent,
        "allowed_percent": MAX_PERCENT,
    }


if __name__ == "__main__":
    run_mission_command(measure, runs_option)
