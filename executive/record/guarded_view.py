"""Wrapper of a view that protects the run from errors of the view."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from executive.events import TimedEvent
from executive.record.recorded_run import View
from executive.run.run import Run


class GuardedView:
    """View that forwards all calls to another view, and closes that view after its first error.

    Attributes:
        problem: Message about the first error of the view, or "".
    """

    def __init__(self, view: View) -> None:
        self._view = view
        self.problem = ""

    def open(self, run: Run) -> None:
        """Begin to show a run."""
        self._forward(lambda: self._view.open(run))

    def __call__(self, timed: TimedEvent) -> None:
        """Show an event."""
        self._forward(lambda: self._view(timed))

    def close(self) -> None:
        """Stop showing the run."""
        self._forward(self._view.close)

    def show_message(self, message: str) -> None:
        """Show a message about the record of the run."""
        self._forward(lambda: self._view.show_message(message))

    def _forward(self, call: Callable[[], None]) -> None:
        """Call the view; after its first error, close the view and ignore all later calls."""
        if self.problem:
            return
        try:
            call()
        except Exception as error:
            view_name = type(self._view).__name__
            self.problem = f"the view {view_name} failed during the run: {type(error).__name__}: {error}"
            # A view that stays open would block the screen and the keyboard.
            with contextlib.suppress(Exception):
                self._view.close()
