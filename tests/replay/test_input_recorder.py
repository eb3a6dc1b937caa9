"""Recording what is answered, and playing it back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.errors import Fault, Unreachable
from executive.replay.input_log import Past
from executive.replay.input_recorder import Tape, Unrecorded

STEP = 0.25


class Recording:
    """A tape that records, and what it told."""

    def __init__(self) -> None:
        self.entries: list[dict[str, Any]] = [{"tick": 0, "clock": 0.0, "kind": "run", "step": STEP}]
        self.tick = 0
        self.tape = Tape(self.emit, STEP, lambda: self.tick * STEP)

    def emit(self, kind: str, **data: Any) -> None:
        value = data.pop("value")
        self.entries.append(
            {"tick": self.tick, "kind": kind, "value": getattr(value, "value", value), **data}
        )

    def begin(self, tick: int) -> None:
        self.tick = tick
        self.tape.begin_tick(tick)

    def played(self) -> Tape:
        return Tape(never, STEP, lambda: 0.0, Past.of(self.entries))


def never(*args: Any, **data: Any) -> Any:
    raise AssertionError("nobody is asked or told anything while a tape plays")


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
            recording.tape.sense(name, lambda value=value: value)
    tape = recording.played()
    for tick, asked in enumerate(steps):
        tape.begin_tick(tick)
        assert [tape.sense(name, never) for name, _ in asked] == [value for _, value in asked]


def test_what_the_cell_raised_is_raised_again() -> None:
    recording = Recording()
    for error in (Unreachable("1 mm too far"), Fault("off its path"), KeyError("x")):
        with pytest.raises(type(error)):
            recording.tape.sense("plan", raising(error))
    tape = recording.played()
    tape.begin_tick(0)
    for name, message in (("Unreachable", "1 mm too far"), ("Fault", "off its path"), ("KeyError", "x")):
        with pytest.raises(Exception, match=message) as raised:
            tape.sense("plan", never)
        assert type(raised.value).__name__ == name


def test_a_command_is_not_given_while_it_plays_but_its_failure_is() -> None:
    recording = Recording()
    done: list[int] = []
    recording.tape.command(lambda: done.append(1))
    with pytest.raises(Fault):
        recording.tape.command(raising(Fault("the arm is moving")))
    assert done == [1]
    tape = recording.played()
    tape.begin_tick(0)
    tape.command(never)
    with pytest.raises(Fault, match="the arm is moving"):
        tape.command(never)


def test_what_was_never_asked_has_no_answer() -> None:
    tape = Recording().played()
    with pytest.raises(Unrecorded, match=r"the record holds no answer to what is asked here first: arm\.q"):
        tape.sense("arm.q", never)


def test_the_clock_is_the_count_of_steps_and_what_the_cells_own_is_ahead() -> None:
    recording = Recording()
    recording.begin(2)
    assert recording.tape.clock() == recording.tape.now == 0.5
    tape = recording.played()
    tape.begin_tick(2)
    assert tape.clock() == tape.now == 0.5
    drifting = Tape(recording.emit, STEP, lambda: 0.6, None)
    drifting.begin_tick(2)
    assert drifting.clock() == pytest.approx(0.6)


def test_gone_live_it_asks_and_tells_only_what_is_unlike_the_answer_before() -> None:
    recording = Recording()
    recording.begin(0)
    recording.tape.sense("x", lambda: 1)
    told: list[Any] = []
    past = Past.of(recording.entries)
    tape = Tape(lambda kind, **data: told.append(data["value"].value), STEP, lambda: 0.0, past)
    tape.begin_tick(0)
    assert tape.sense("x", never) == 1
    tape.go_live()
    assert [tape.sense("x", lambda value=value: value) for value in (1, 5, 5, 1)] == [1, 5, 5, 1]
    assert told == [5, 1]
