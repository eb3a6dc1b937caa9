"""Views that fail during a run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from executive.record.recorded_run import GuardedView


class FailingView:
    """A view one of whose methods raises an error.

    Attributes:
        calls: Names of the methods that were called.
    """

    def __init__(self, method: str) -> None:
        self._method = method
        self.calls: list[str] = []

    def _call(self, name: str) -> None:
        self.calls.append(name)
        if name == self._method:
            raise ValueError("no ink")

    def open(self, run: Any) -> None:
        self._call("open")

    def __call__(self, event: Any) -> None:
        self._call("event")

    def close(self) -> None:
        self._call("close")

    def show_message(self, message: str) -> None:
        self._call("note")


def use(view: GuardedView) -> None:
    """Call all methods of a view as a run does."""
    calls: tuple[Callable[[], None], ...] = (
        lambda: view.open(None),  # type: ignore[arg-type]
        lambda: view(None),  # type: ignore[arg-type]
        lambda: view(None),  # type: ignore[arg-type]
        view.close,
        lambda: view.show_message("a note"),
    )
    for call in calls:
        call()


@pytest.mark.parametrize(
    "method, calls",
    [
        ("open", ["open", "close"]),
        ("event", ["open", "event", "close"]),
        ("close", ["open", "event", "event", "close", "close"]),
        ("note", ["open", "event", "event", "close", "note", "close"]),
    ],
)
def test_a_view_that_failed_is_only_closed(method: str, calls: list[str]) -> None:
    inner = FailingView(method)
    view = GuardedView(inner)
    use(view)
    assert inner.calls == calls
    assert view.problem == "the view FailingView failed during the run: ValueError: no ink"


def test_a_view_without_errors_has_no_problem() -> None:
    view = GuardedView(FailingView("none"))
    use(view)
    assert view.problem == ""
