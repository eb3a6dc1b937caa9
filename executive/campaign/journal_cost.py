"""What the journal costs a run: the time in which it makes lines, writes them and waits for the disk."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from executive.events import Event
from executive.mission.load import LoadedMission
from executive.record.entry import Entry
from executive.record.journal import Journal
from executive.record.recorder import Recorder
from executive.record.run_directory import RunDirectory, refused
from executive.runtime.run import Run
from executive.skill import Skill

MOST_SHARE = 0.03
"""Share of a run's time on the wall that its journal may cost."""


@dataclass(frozen=True)
class JournalCost:
    """What the journal of one run cost; times are on the wall [s].

    Attributes:
        entries: Lines written.
        size: All of them [byte].
        syncs: How often the run waited for the disk.
        encode, write, sync: Making lines, handing them to the system, waiting for the disk.
        append: All that the journal took, these three and what is between them.
        record: All that the record took on the tick thread, trace and pictures included.
        wall: The run, from building its cell to the arm at rest.
    """

    entries: int
    size: int
    syncs: int
    encode: float
    write: float
    sync: float
    append: float
    record: float
    wall: float

    @property
    def share(self) -> float:
        """Part of the run's time that the journal took."""
        return self.append / self.wall

    def as_plain(self) -> dict[str, Any]:
        """Return the figures as plain values: times in s, the share in percent."""
        times = {f"{name}_s": value for name, value in asdict(self).items() if isinstance(value, float)}
        return {
            "entries": self.entries,
            "bytes": self.size,
            "syncs": self.syncs,
            **{name: round(value, 6) for name, value in times.items()},
            "percent": round(100 * self.share, 4),
            "most_percent": 100 * MOST_SHARE,
        }

    def text(self) -> str:
        """Return the figures as a table."""
        rows = {
            "encode": self.encode,
            "write": self.write,
            "sync": self.sync,
            "journal": self.append,
            "record": self.record,
            "run": self.wall,
        }
        return "\n".join(
            [
                f"{self.entries} lines, {self.size / 1000:.1f} kB, {self.syncs} times on the disk at once; "
                f"the journal may cost {MOST_SHARE:.0%} of the run",
                f"{'':10}{'ms':>10}{'%':>8}",
                *(f"{name:10}{1000 * t:10.1f}{100 * t / self.wall:8.2f}" for name, t in rows.items()),
            ]
        )


class TimedJournal(Journal):
    """A journal that measures itself.

    Attributes:
        entries, size, syncs, encode, write, sync, append_time: See `JournalCost`.
    """

    def __init__(self, path: Path, *, again: bool = False) -> None:
        super().__init__(path, again=again)
        self.entries = self.size = self.syncs = 0
        self.encode = self.write = self.sync = self.append_time = 0.0

    def append(self, entry: Entry) -> None:
        """Append `entry`."""
        began = time.perf_counter()
        super().append(entry)
        self.append_time += time.perf_counter() - began
        self.entries += 1

    def _encode(self, entry: Entry) -> bytes:
        began = time.perf_counter()
        line = super()._encode(entry)
        self.encode += time.perf_counter() - began
        self.size += len(line)
        return line

    def _write(self, file: int, line: bytes) -> None:
        began = time.perf_counter()
        super()._write(file, line)
        self.write += time.perf_counter() - began

    def _sync(self, file: int) -> None:
        began = time.perf_counter()
        super()._sync(file)
        self.sync += time.perf_counter() - began
        self.syncs += 1


def measure(
    loaded: LoadedMission, skills: Mapping[str, type[Skill]], *, seed: int, runs: Path
) -> JournalCost:
    """Run `loaded` once, with nobody to ask for anything, and return what its journal cost.

    The record is made below `runs`, on the disk that runs are recorded on, and removed afterwards.

    Raises:
        InputError: `runs` cannot be written to.
    """
    try:
        runs.mkdir(parents=True, exist_ok=True)
        folder = TemporaryDirectory(prefix=".bench-", dir=runs, ignore_cleanup_errors=True)
    except OSError as error:
        raise refused(f'record a run below "{runs}"', error) from error
    with folder as name:
        return _measured(loaded, skills, seed, RunDirectory(Path(name)))


def _measured(
    loaded: LoadedMission, skills: Mapping[str, type[Skill]], seed: int, directory: RunDirectory
) -> JournalCost:
    journals: list[TimedJournal] = []
    in_record = 0.0

    def journal(path: Path, *, again: bool) -> TimedJournal:
        journals.append(TimedJournal(path, again=again))
        return journals[0]

    def recording(event: Event) -> None:
        nonlocal in_record
        began = time.perf_counter()
        recorder(event)
        in_record += time.perf_counter() - began

    began = time.perf_counter()
    with (
        closing(Run(loaded, skills, seed=seed, requests=())) as run,
        closing(Recorder(directory, journal=journal)) as recorder,
    ):
        run.observe(recording)
        run.execute()
        wall = time.perf_counter() - began
    (timed,) = journals
    return JournalCost(
        entries=timed.entries, size=timed.size, syncs=timed.syncs, encode=timed.encode, write=timed.write,
        sync=timed.sync, append=timed.append_time, record=in_record, wall=wall,
    )  # fmt: skip
