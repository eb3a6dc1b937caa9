"""Recording of the answers of a cell, and their replay."""

from __future__ import annotations

from typing import Any

import pytest
from events import at, read
from executive.cell.proxy import IS_METHOD
from executive.replay.recording_cell import (
    COMMANDS,
    INPUT_FORMATS,
    RECORDED_ROLES,
    InputRecorder,
    make_recording_cell,
)
from executive.replay.replayed_cell import InputReplayer
from hypothesis import given
from hypothesis import strategies as st

from executive.cell.devices import StepClock
from executive.errors import Fault, Unreachable
from executive.events import Event, TimedEvent, ToolCommanded
from executive.run.replay import InputLog
from executive.testing.fake_cell import FakeCell


def test_every_member_of_a_part_is_a_question_or_a_command() -> None:
    roles = (*RECORDED_ROLES, "plan", "request")
    members = {f"{role}.{member}" for role in roles for member in IS_METHOD[role]}
    assert members == INPUT_FORMATS.keys() | COMMANDS
    assert not INPUT_FORMATS.keys() & COMMANDS


def test_an_intent_is_emitted_before_the_tool_acts() -> None:
    fake = FakeCell()
    intents: list[tuple[str, bool]] = []

    def emit(event: Event) -> None:
        if isinstance(event, ToolCommanded):
            intents.append((event.action, fake.tool.holding))

    tool = make_recording_cell(fake.cell, InputRecorder(emit), StepClock(lambda: 0.0), emit).tool
    tip = fake.arm.tool_pose.position
    fake.world.put("cube", *tip[:2]).position[2] = tip[2] - 0.025
    tool.close()
    tool.open()
    assert not tool.holding
    assert intents == [("close", False), ("open", True)]


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


@pytest.mark.parametrize("error", [Unreachable("1 mm too far"), Fault("off its path"), KeyError("x")])
def test_an_exception_of_the_cell_is_raised_again(error: Exception) -> None:
    def fail() -> Any:
        raise error

    recording = Recording()
    with pytest.raises(type(error)):
        recording.recorder.read("plan", fail)
    with pytest.raises(Exception) as raised:
        recording.replayer().read("plan")
    assert (type(raised.value).__name__, raised.value.args[0]) == (type(error).__name__, str(error))


def test_only_answers_unlike_the_one_before_are_recorded() -> None:
    recording = Recording()
    answers = [recording.recorder.read("x", lambda value=value: value) for value in (1, 1, 5, 5, 1)]
    assert answers == [1, 1, 5, 5, 1]
    assert [one.event for one in recording.events] == [read("x", 1), read("x", 5, 3), read("x", 1, 5)]
