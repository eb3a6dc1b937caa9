"""Observer that writes the record of a run: journal, trace and pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from executive.errors import Fault
from executive.events import TimedEvent
from executive.record.frames import PictureRecorder
from executive.record.journal import Journal
from executive.record.run_directory import RunDirectory
from executive.record.trace import Trace


class Recorder:
    """Observer that passes events to the journal, the trace and the pictures of a run.

    Args:
        directory: The run directory.
        frames: True to save pictures.
        resume: True to append to the journal of an interrupted run.
        journal: Class of the journal.

    Raises:
        InputError: The journal cannot be opened.
    """

    def __init__(
        self,
        directory: RunDirectory,
        *,
        frames: bool = True,
        resume: bool = False,
        journal: Callable[..., Journal] = Journal,
    ) -> None:
        self._trace = Trace()
        self._journal = journal(directory.journal, resume=resume)
        self._frames = PictureRecorder(directory.frames) if frames else None
        self._problem = ""

    def __call__(self, timed: TimedEvent) -> None:
        """Record an event; the trace, which cannot fail, gets the event first."""
        self._trace(timed)
        self._journal(timed)
        if self._frames is not None:
            try:
                self._frames(timed)
            except Exception as error:
                # A run without pictures can still be explained.
                self._problem = f"not every picture was drawn: {type(error).__name__}: {error}"

    def remember(self, past: Iterable[TimedEvent]) -> None:
        """Add the events of a resumed run, which the journal contains already, to the trace."""
        for timed in past:
            self._trace(timed)

    def close(self, *, wait: bool = True) -> None:
        """Sync the journal and, if `wait` is True, finish the pictures; further calls have no effect.

        Afterwards `problem` names the missing parts of the record.
        """
        try:
            self._journal.close()
        except Fault as fault:
            self._problem = str(fault)
        if self._frames is not None:
            self._frames.close(wait=wait)

    @property
    def trace(self) -> str:
        """Hash of all decisions so far."""
        return self._trace.hexdigest()

    @property
    def problem(self) -> str:
        """Missing parts of the record, in a sentence, or ""."""
        pictures = "" if self._frames is None else self._frames.problem
        return "; ".join(filter(None, (self._problem, pictures)))
