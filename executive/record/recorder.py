"""Observer that writes the record of a run: journal, pictures, and the trace for the comparison of runs."""

from __future__ import annotations

import hashlib
import json

from executive.errors import Fault
from executive.events import ItemChanged, NodeEnded, NodeStarted, TargetSelected, TimedEvent
from executive.record.journal import Journal
from executive.record.picture_recorder import PictureRecorder
from executive.record.run_directory import RunDirectory

_ENCODER = json.JSONEncoder(sort_keys=True, separators=(",", ":"), check_circular=False)
"""Encoder with a unique text for each value, so that equal decisions have equal hashes."""


class Trace:
    """Hash of the starts and ends of nodes, the changes of items and the selected targets, with their ticks.

    Wall times, messages and paths of files are not hashed, so that the same mission, seed and weights of
    detectors give the same trace on the same kind of processor.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def __call__(self, timed: TimedEvent) -> None:
        """Add an event to the hash if it is a decision."""
        event = timed.event
        match event:
            case NodeStarted(node, skill, item):
                decision = ["status", node, "RUNNING", *(("", item) if skill else (None, None)), None]
            case NodeEnded(node, status, skill):
                details = (event.reason, event.item) if skill else (event.reason or None, None)
                decision = ["status", node, status, *details, event.outputs]
            case ItemChanged(item, label, state, position):
                decision = ["item", item, state, label, position, event.bin]
            case TargetSelected(item, label, frame):
                decision = ["decision", item, label, frame]
            case _:
                return
        self._hash.update(_ENCODER.encode([timed.tick, *decision]).encode() + b"\n")

    def hexdigest(self) -> str:
        """Return the first 16 hexadecimal digits of the SHA-256 of all decisions up to now."""
        return self._hash.hexdigest()[:16]


class Recorder:
    """Observer that passes events to the journal, the trace and the recorder of pictures.

    Args:
        directory: The run directory.
        saves_pictures: True to save pictures.
        resume: True to append to the journal of an interrupted run.

    Attributes:
        trace: Trace of all events; the caller adds the events from before a resumption.

    Raises:
        InputError: The journal cannot be opened.
    """

    def __init__(self, directory: RunDirectory, *, saves_pictures: bool = True, resume: bool = False) -> None:
        self.trace = Trace()
        self._journal = Journal(directory.journal, resume=resume)
        self._pictures = PictureRecorder(directory.pictures) if saves_pictures else None
        self._problem = ""

    def __call__(self, timed: TimedEvent) -> None:
        """Record an event, first in the trace: an exception of the journal must not affect the trace."""
        self.trace(timed)
        self._journal(timed)
        if self._pictures is not None:
            try:
                self._pictures(timed)
            except Exception as error:
                # The run continues, because a record without pictures still explains the run.
                self._problem = f"not every picture was drawn: {type(error).__name__}: {error}"

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
    def problem(self) -> str:
        """Message about the missing parts of the record, or ""."""
        picture_problem = "" if self._pictures is None else self._pictures.problem
        return "; ".join(filter(None, (self._problem, picture_problem)))
