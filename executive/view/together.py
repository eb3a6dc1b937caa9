"""Several views of one run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from executive.events import Event

if TYPE_CHECKING:
    from executive.record.recorded_run import View
    from executive.runtime.run import Run


class Together:
    """Shows a run in each of several views; implements `View`.

    Args:
        views: The views.
        paused: Let the run stand still before its first step, until somebody lets it go on.
    """

    def __init__(self, views: Sequence[View], *, paused: bool = False) -> None:
        self._views = views
        self._paused = paused

    def open(self, run: Run) -> None:
        """Begin to show a run."""
        if self._paused:
            run.control.pause()
        for view in self._views:
            view.open(run)

    def __call__(self, event: Event) -> None:
        """Hand on an event."""
        for view in self._views:
            view(event)

    def close(self) -> None:
        """Stop showing, the last view first."""
        for view in reversed(self._views):
            view.close()

    def note(self, sentence: str) -> None:
        """Say something about the record."""
        for view in self._views:
            view.note(sentence)
