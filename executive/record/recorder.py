"""One observer that keeps the whole record of a run."""

from __future__ import annotations

from executive.events import Event
from executive.record.entry import entry_of
from executive.record.frames import Frames
from executive.record.journal import Journal
from executive.record.run_directory import RunDirectory
from executive.record.trace import Trace


class Recorder:
    """Feeds journal, trace and, where wanted, the pictures of a run."""

    def __init__(self, directory: RunDirectory, *, frames: bool = True) -> None:
        self._trace = Trace()
        self._journal = Journal(directory.journal)
        self._frames = Frames(directory.frames) if frames else None

    def __call__(self, event: Event) -> None:
        """Record `event`; the trace first, for it cannot fail."""
        entry = entry_of(event)
        self._trace.take(entry)
        self._journal.append(entry)
        if self._frames is not None:
            self._frames(event)

    def close(self, *, wait: bool = True) -> None:
        """Bring everything to the disk, with `wait` the pictures too; more calls do nothing."""
        self._journal.close()
        if self._frames is not None and wait:
            self._frames.close()

    @property
    def trace(self) -> str:
        """Hash over every decision so far."""
        return self._trace.hexdigest()

    @property
    def problem(self) -> str:
        """What the record lacks, in a sentence, or ""."""
        return "" if self._frames is None else self._frames.problem
