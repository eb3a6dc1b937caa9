"""Observer that writes the record of a run: journal, trace and pictures."""

from __future__ import annotations

from collections.abc import Iterable

from executive.errors import Fault
from executive.events import TimedEvent
from executive.record.journal import Journal
from executive.record.picture_recorder import PictureRecorder
from executive.record.run_directory import RunDirectory
from executive.record.trace import Trace


class Recorder:
    """Observer that passes events to the journal, the trace and the recorder of pictures.

    Args:
        directory: The run directory.
        saves_pictures: True to save pictures.
        resume: True to append to the journal of an interrupted run.

    Raises:
        InputError: The journal cannot be opened.
    """

    def __init__(self, directory: RunDirectory, *, saves_pictures: bool = True, resume: bool = False) -> None:
        self._trace = Trace()
        self._journal = Journal(directory.journal, resume=resume)
        self._pictures = PictureRecorder(directory.pictures) if saves_pictures else None
        self._problem = ""

    def __call__(self, timed: TimedEvent) -> None:
        """Record an event, first in the trace: an exception of the journal must not affect the trace."""
        self._trace(timed)
        self._journal(timed)
        if self._pictures is not None:
            try:
                self._pictures(timed)
            except Exception as error:
                # The run continues, because a record without pictures still explains the run.
                self._problem = f"not every picture was drawn: {type(error).__name__}: {error}"

    def add_to_trace(self, events: Iterable[TimedEvent]) -> None:
        """Add the earlier events of a resumed run, which the journal contains already, to the trace."""
        for timed in events:
            self._trace(timed)

    def close(self, *, wait: bool = True) -> None:
        """Sync the journal to the disk and, if `wait` is True, draw all queued pictures.

        Afterwards `problem` describes the missing parts of the record. Further calls have no effect.
        """
        try:
            self._journal.close()
        except Fault as fault:
            self._problem = str(fault)
        if self._pictures is not None:
            self._pictures.close(wait=wait)

    @property
    def trace(self) -> str:
        """Hash of all decisions up to now."""
        return self._trace.hexdigest()

    @property
    def problem(self) -> str:
        """Message about the missing parts of the record, or ""."""
        picture_problem = "" if self._pictures is None else self._pictures.problem
        return "; ".join(filter(None, (self._problem, picture_problem)))
