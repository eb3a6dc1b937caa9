"""One observer that keeps the whole record of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from executive.errors import Fault
from executive.events import TimedEvent
from executive.record.frames import Frames
from executive.record.journal import Journal
from executive.record.run_directory import RunDirectory
from executive.record.trace import Trace


class Recorder:
    """Feeds journal, trace and, where wanted, the pictures of a run.

    Args:
        directory: Where the record is kept.
        frames: Keep pictures.
        again: Go on with the journal of a run that was cut off.
        journal: Makes the journal.

    Raises:
        InputError: The journal cannot be opened.
    """

    def __init__(
        self,
        directory: RunDirectory,
        *,
        frames: bool = True,
        again: bool = False,
        journal: Callable[..., Journal] = Journal,
    ) -> None:
        self._trace = Trace()
        self._journal = journal(directory.journal, again=again)
        self._frames = Frames(directory.frames) if frames else None
        self._problem = ""

    def __call__(self, timed: TimedEvent) -> None:
        """Record an event; the trace first, because it cannot fail."""
        self._trace(timed)
        self._journal(timed)
        if self._frames is not None:
            try:
                self._frames(timed)
            except Exception as error:
                # A run can be explained without its pictures.
                self._problem = f"not every picture was drawn: {type(error).__name__}: {error}"

    def remember(self, past: Iterable[TimedEvent]) -> None:
        """Add the events of a resumed run to the trace; they are in the journal already."""
        for timed in past:
            self._trace(timed)

    def close(self, *, wait: bool = True) -> None:
        """Bring everything to the disk, with `wait` the pictures too; more calls do nothing.

        What did not get there, `problem` tells.
        """
        try:
            self._journal.close()
        except Fault as fault:
            self._problem = str(fault)
        if self._frames is not None:
            self._frames.close(wait=wait)

    @property
    def trace(self) -> str:
        """Hash over every decision so far."""
        return self._trace.hexdigest()

    @property
    def problem(self) -> str:
        """What the record lacks, in a sentence, or ""."""
        pictures = "" if self._frames is None else self._frames.problem
        return "; ".join(filter(None, (self._problem, pictures)))
