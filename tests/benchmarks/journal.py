"""The journal's share of the wall time of a run: encoding lines, writing them and waiting for the disk."""

from __future__ import annotations

import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

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
        counts: Entries, bytes and syncs so far.
        seconds: Wall time of each part, and of the whole as `journal` [s].
    """

    def __init__(self, path: Path, *, again: bool = False) -> None:
        super().__init__(path, again=again)
        self.counts = Counter[str]()
        self.seconds = dict.fromkeys(("encode", "write", "sync", "journal"), 0.0)

    def append(self, entry: Entry) -> None:
        """Append `entry`."""
        self._time("journal", super().append, entry)
        self.counts["entries"] += 1

    def _encode(self, entry: Entry) -> bytes:
        line: bytes = self._time("encode", super()._encode, entry)
        self.counts["bytes"] += len(line)
        return line

    def _write(self, file: int, line: bytes) -> None:
        self._time("write", super()._write, file, line)

    def _sync(self, file: int) -> None:
        self._time("sync", super()._sync, file)
        self.counts["syncs"] += 1

    def _time(self, name: str, function: Callable[..., Any], *args: Any) -> Any:
        began = time.perf_counter()
        value = function(*args)
        self.seconds[name] += time.perf_counter() - began
        return value


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
    seconds = {**journal.seconds, "run": wall}
    return {
        **describe(subject),
        **journal.counts,
        "times": [
            {"part": name, "ms": 1e3 * time, "percent": 100 * time / wall} for name, time in seconds.items()
        ],
        "allowed_percent": MAX_PERCENT,
    }


if __name__ == "__main__":
    run_mission_command(measure, runs_option)
