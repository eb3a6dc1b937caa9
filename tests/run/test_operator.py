"""The operator: what words mean, in a script and at the terminal."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import threading
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from executive.behaviours import load_skills
from executive.errors import InputError, Stopped
from executive.events import Event, NodeEnded, NodeStarted, OperatorAsked, RequestGiven, TimedEvent
from executive.mission.load import load_mission
from executive.record.replayed_run import replay_and_compare
from executive.run.assembly import RunOptions, assemble
from executive.run.operator import RunControl, ScriptedOperator, TerminalOperator, parse_request
from executive.run.replay import InputLog
from executive.testing.fake_cell import FakeCell

CHOICES = ("cube", "sphere", "duck")


@pytest.mark.parametrize(
    ("word", "meaning"),
    [
        ("0", "cube"), ("2", "duck"), ("DUCK", "duck"), ("S", "rescan"), ("rescan", "rescan"), ("q", None),
        ("Quit", None), ("3", ""), ("-1", ""), ("banana", ""), ("", ""), ("²", ""), ("1" * 5000, ""),
    ],
)  # fmt: skip
def test_what_a_word_means(word: str, meaning: str | None) -> None:
    assert parse_request(word, CHOICES) == meaning


class Heard(list[Event]):
    def __call__(self, event: Event) -> None:
        self.append(event)


def test_a_script_is_followed_and_then_quits_for_good() -> None:
    heard = Heard()
    operator = ScriptedOperator(["duck", "0", "s", "q"], CHOICES, heard)
    answers = [operator.ask(CHOICES) for _ in range(5)]
    assert answers == ["duck", "cube", "rescan", None, None]
    assert heard == [RequestGiven(answer) for answer in answers]
    with pytest.raises(InputError, match='cannot pick "banana"; ask for one of: cube, sphere, duck'):
        ScriptedOperator(["cube", "banana"], CHOICES, heard)


@pytest.fixture
def type_in(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """A function that types a text into the terminal, and may close the terminal afterwards."""
    with contextlib.ExitStack() as files:

        def type_in(text: str, *, closed: bool = False) -> None:
            reading, writing = os.pipe()
            os.write(writing, text.encode())
            keyboard = files.enter_context(io.FileIO(writing, "w"))
            if closed:
                keyboard.close()
            # Unbuffered, as select sees only what the pipe still holds.
            stdin = io.TextIOWrapper(io.FileIO(reading), write_through=True)
            monkeypatch.setattr("sys.stdin", files.enter_context(stdin))

        yield type_in


@pytest.mark.parametrize(
    ("typed", "meant"), [("1\n", "sphere"), (" duck \n", "duck"), ("q\n", None), ("", None)]
)
def test_the_terminal_lists_the_classes_and_takes_numbers_and_names(
    type_in: Any, capsys: pytest.CaptureFixture[str], typed: str, meant: str | None
) -> None:
    type_in(typed, closed=not typed)
    heard = Heard()
    assert TerminalOperator(heard, RunControl()).ask(CHOICES) == meant
    assert capsys.readouterr().err == "pick what?  0 cube  1 sphere  2 duck  s rescan  q quit > "
    assert heard == [OperatorAsked([*CHOICES]), RequestGiven(meant)]


def test_each_line_of_a_pipe_answers_one_question_at_once(type_in: Any) -> None:
    type_in("duck\n\n" + "x" * 50_000 + "\n0\n1\n")
    control = RunControl()
    watchdog = threading.Timer(5.0, control.stop)
    watchdog.start()
    operator = TerminalOperator(Heard(), control)
    assert [operator.ask(CHOICES) for _ in range(3)] == ["duck", "cube", "sphere"]
    watchdog.cancel()


def test_a_line_without_end_is_neither_kept_nor_a_request(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()

    def write() -> None:
        with open(writing, "wb") as keyboard:
            for _ in range(200):
                keyboard.write(b"duck" * 25_000)
            keyboard.write(b"\nsphere\n")

    writer = threading.Thread(target=write)
    with open(reading) as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        writer.start()
        tracemalloc.start()
        assert TerminalOperator(Heard(), RunControl()).ask(CHOICES) == "sphere"
        assert tracemalloc.get_traced_memory()[1] < 1_000_000, "the line has 20 MB"
        tracemalloc.stop()
        writer.join()


@pytest.mark.parametrize("keyboard", [True, False])
def test_ctrl_c_ends_the_wait_for_an_answer(type_in: Any, keyboard: bool) -> None:
    type_in("")
    control = RunControl()
    threading.Timer(0.3, control.stop).start()
    operator = TerminalOperator(Heard(), control, has_keyboard=keyboard)
    with pytest.raises(Stopped):
        operator.ask(CHOICES)


def test_ctrl_c_at_the_question_halts_the_run_instead_of_ending_it_well(missions: Path, type_in: Any) -> None:
    def interrupt(timed: TimedEvent) -> None:
        if isinstance(timed.event, OperatorAsked):
            os.kill(os.getpid(), signal.SIGINT)

    type_in("")
    loaded = load_mission(missions / "pick_on_request.yaml", load_skills())
    events: list[TimedEvent] = []
    run = assemble(loaded, RunOptions(1, make_cell=FakeCell), [events.append, interrupt])
    outcome = run.execute()
    assert (outcome.status, outcome.message) == ("HALTED", "halted by the user")
    ends = {one.event.status for one in events if isinstance(one.event, NodeEnded)}
    assert ends == {"INVALID"}, "nothing failed, and nobody quit"
    again = replay_and_compare(loaded, InputLog(events), 1)
    assert again.difference == ""
    assert again.decisions == sum(isinstance(one.event, NodeStarted | NodeEnded) for one in events) > 0


@pytest.mark.parametrize(
    ("before", "after", "answer"),
    [([], ["a unicorn", "1"], "sphere"), (["cube", "cube"], ["duck"], "duck")],
    ids=["without a keyboard", "an answer without a question picks nothing"],
)
def test_requests_from_elsewhere_are_answers(before: list[str], after: list[str], answer: str) -> None:
    heard, control = Heard(), RunControl()
    for word in before:
        control.add_request(word)
    threading.Timer(0.2, lambda: [control.add_request(word) for word in after]).start()
    operator = TerminalOperator(heard, control, has_keyboard=False)
    assert operator.ask(CHOICES) == answer
    assert heard == [OperatorAsked(list(CHOICES)), RequestGiven(answer)]
