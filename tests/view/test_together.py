"""Several views of one run."""

from __future__ import annotations

from types import SimpleNamespace

from executive.events import Event
from executive.runtime.run_control import RunControl
from executive.view.together import Together


class Heard:
    def __init__(self, name, log):
        self._name, self._log = name, log

    def open(self, run):
        self._log.append((self._name, "open", run.control.paused))

    def __call__(self, event):
        self._log.append((self._name, event.kind))

    def close(self):
        self._log.append((self._name, "close"))

    def note(self, sentence):
        self._log.append((self._name, sentence))


def test_each_is_told_everything_and_the_last_is_closed_first() -> None:
    log: list[tuple] = []
    both = Together([Heard("a", log), Heard("b", log)])
    both.open(SimpleNamespace(control=RunControl()))
    both(Event("run", 0, 0.0))
    both.note("full")
    both.close()
    assert log == [
        ("a", "open", False), ("b", "open", False), ("a", "run"), ("b", "run"), ("a", "full"), ("b", "full"),
        ("b", "close"), ("a", "close"),
    ]  # fmt: skip


def test_a_run_can_be_let_stand_still_before_anybody_sees_it() -> None:
    log: list[tuple] = []
    run = SimpleNamespace(control=RunControl())
    Together([Heard("a", log)], paused=True).open(run)
    assert log == [("a", "open", True)]
