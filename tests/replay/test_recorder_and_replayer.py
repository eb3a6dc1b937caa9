"""Recording of answers, and their replay."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from events import at, read
from hypothesis import given
from hypothesis import strategies as st

from executive.errors import Fault, Unreachable
from executive.events import Event, TimedEvent
from executive.replay.input_log import InputLog
from executive.replay.recording_cell import InputRecorder
from executive.replay.replayed_cell import InputNotRecorded, InputReplayer


class Recording:
    """A recorder and its events."""

    def __init__(self) -> None:
        self.events: list[TimedEvent] = []
        self.tick = 0
        self.recorder = InputRecorder(self.emit)

    def emit(self, event: Event) -> None:
        self.events.append(at(self.tick, event))

    def begin(self, tick: int) -> None:
        self.tick = tick
        self.recorder.begin_step()

    def replayer(self) -> InputReplayer:
        return InputReplayer(InputLog(self.events))


def raising(error: Exception) -> Callable[[], Any]:
    def ask() -> Any:
        raise error

    return ask


@given(st.lists(st.lists(st.tuples(st.sampled_from("xy"), st.integers(0, 2)), max_size=5), max_size=12))
def test_the_same_questions_get_the_same_answers(steps: list[list[tuple[str, int]]]) -> None:
    recording = Recording()
    for tick, asked in enumerate(steps):
        recording.begin(tick)
        for name, value in asked:
            recording.recorder.read(name, lambda value=value: value)
    replayer = recording.replayer()
    for tick, asked in enumerate(steps):
        replayer.begin_step(tick)
        assert [replayer.read(name) for name, _ in asked] == [value for _, value in asked]


def test_an_exception_of_the_cell_is_raised_again() -> None:
    recording = Recording()
    for error in (Unreachable("1 mm too far"), Fault("off its path"), KeyError("x")):
        with pytest.raises(type(error)):
            recording.recorder.read("plan", raising(error))
    replayer = recording.replayer()
    for name, message in (("Unreachable", "1 mm too far"), ("Fault", "off its path"), ("KeyError", "x")):
        with pytest.raises(Exception, match=message) as raised:
            replayer.read("plan")
        assert type(raised.value).__name__ == name


def test_a_question_that_was_never_asked_has_no_answer() -> None:
    replayer, message = (
        Recording().replayer(),
        "the replay reads arm.q in step 0, but the journal has no earlier value",
    )
    with pytest.raises(InputNotRecorded, match=message):
        replayer.read("arm.q")
    assert replayer.missing_input_message == message


def test_only_answers_unlike_the_one_before_are_recorded() -> None:
    recording = Recording()
    answers = [recording.recorder.read("x", lambda value=value: value) for value in (1, 1, 5, 5, 1)]
    assert answers == [1, 1, 5, 5, 1]
    assert [one.event for one in recording.events] == [read("x", 1), read("x", 5, 3), read("x", 1, 5)]
