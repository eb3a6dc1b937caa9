"""The border of a run: accesses from outside are intercepted, recorded and replayed."""

from __future__ import annotations

from typing import Any

import pytest
from events import at, read
from hypothesis import given
from hypothesis import strategies as st

from executive.cell.arm import Planning, Task
from executive.cell.devices import ArmDevice, CameraDevice
from executive.cell.protocols import Behaviours, Detector, Localizer, Operator, Request, Tool
from executive.errors import Fault, Unreachable
from executive.events import Event, TimedEvent, ToolCommanded
from executive.run.replay import InputLog
from executive.station.border import ATTRIBUTES, METHODS, Access, Border, InputNotRecorded
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import observe_accesses


def test_every_access_is_intercepted_and_so_are_those_to_what_a_call_returns(fake: FakeCell) -> None:
    seen: list[tuple[str, str, tuple[Any, ...], bool]] = []

    def intercept(access: Access) -> Any:
        seen.append((access.path, access.name, access.arguments, access.is_call))
        return access.proceed()

    fake.border.interceptor = intercept
    assert fake.cell.arm.at_rest
    planning = fake.cell.arm.plan("home", task=Task())
    assert not planning.ready
    frame = fake.cell.camera.capture()
    assert not fake.cell.detectors["embedded"].request(frame, view="full").ready
    paths = [path for path, *_ in seen]
    assert paths[:5] == ["arm.at_rest", "arm.at_rest", "arm.end_q", "planner.plan", "plan.ready"]
    assert paths[-5:] == ["camera.capture", "arm.q", "image.capture", "detector.request", "request.ready"]
    assert seen[-2:] == [
        ("detector.request", "embedded", (frame, "full"), True),
        ("request.ready", "embedded", (), False),
    ]


def test_an_observer_sees_the_accesses_of_skills_with_their_arguments(fake: FakeCell) -> None:
    seen: list[tuple[str, tuple[Any, ...], bool]] = []
    cell = observe_accesses(
        fake.cell, lambda access: seen.append((access.path, access.arguments, access.is_call))
    )
    assert cell.arm.at_rest
    assert not cell.arm.plan("home", task=Task()).ready
    assert seen == [("arm.at_rest", (), False), ("arm.plan", ("home", Task()), True)]


def test_every_member_of_a_part_is_an_input_or_a_command() -> None:
    protocols: dict[str, Any] = {
        "arm": ArmDevice, "tool": Tool, "image": CameraDevice, "plan": Planning, "detector": Detector,
        "request": Request, "operator": Operator, "localizer": Localizer, "behaviours": Behaviours,
    }  # fmt: skip
    members = {
        f"{role}.{name}": value
        for role, protocol in protocols.items()
        for owner in protocol.__mro__
        for name, value in vars(owner).items()
        if not name.startswith("_")
    }
    attributes = {path for path, value in members.items() if isinstance(value, property)}
    assert attributes == ATTRIBUTES.keys()
    of_the_station = {
        "planner.plan",
        "planner.plan_ahead",
        "camera.sees_table",
        "camera.find_faults",
        "camera.find_unexplained",
        "camera.inspect_bins",
    }
    assert members.keys() - attributes == METHODS.keys() - of_the_station


def test_an_intent_is_emitted_before_the_tool_acts() -> None:
    intents: list[tuple[str, bool]] = []

    def emit(event: Event) -> None:
        if isinstance(event, ToolCommanded):
            intents.append((event.action, fake.tool.holding))

    fake = FakeCell(emit=emit)
    tool = fake.cell.tool
    tip = fake.arm.tool_pose.position
    fake.world.put("cube", *tip[:2]).position[2] = tip[2] - 0.025
    tool.close()
    tool.open()
    assert not tool.holding
    assert intents == [("close", False), ("open", True)]


class Recording:
    """A border and its events."""

    def __init__(self) -> None:
        self.events: list[TimedEvent] = []
        self.border = Border(self.emit)

    def emit(self, event: Event) -> None:
        self.events.append(at(self.border.tick, event))

    def replay(self) -> Border:
        border = Border(self.emit)
        border.replay(InputLog(self.events).inputs)
        return border


def refuse() -> Any:
    raise AssertionError("a replay asks nobody")


@given(st.lists(st.lists(st.tuples(st.sampled_from("xy"), st.integers(0, 2)), max_size=5), max_size=12))
def test_the_same_questions_get_the_same_answers(steps: list[list[tuple[str, int]]]) -> None:
    recording = Recording()
    for tick, asked in enumerate(steps):
        recording.border.tick = tick
        for name, value in asked:
            recording.border.read(name, lambda value=value: value)
    replayed = recording.replay()
    for tick, asked in enumerate(steps):
        replayed.tick = tick
        assert [replayed.read(name, refuse) for name, _ in asked] == [value for _, value in asked]


@pytest.mark.parametrize("error", [Unreachable("1 mm too far"), Fault("off its path"), KeyError("x")])
def test_an_exception_of_the_cell_is_raised_again(error: Exception) -> None:
    def fail() -> Any:
        raise error

    recording = Recording()
    with pytest.raises(type(error)):
        recording.border.read("plan", fail)
    with pytest.raises(Exception) as raised:
        recording.replay().read("plan", refuse)
    assert (type(raised.value).__name__, raised.value.args[0]) == (type(error).__name__, str(error))


def test_only_answers_unlike_the_one_before_are_recorded() -> None:
    recording = Recording()
    answers = [recording.border.read("x", lambda value=value: value) for value in (1, 1, 5, 5, 1)]
    assert answers == [1, 1, 5, 5, 1]
    assert [one.event for one in recording.events] == [read("x", 1), read("x", 5, 3), read("x", 1, 5)]


def test_a_question_that_was_not_asked_before_has_no_answer_in_a_replay() -> None:
    replayed = Recording().replay()
    with pytest.raises(InputNotRecorded, match="reads x in step 0, but the journal has no earlier value"):
        replayed.read("x", refuse)
    assert replayed.missing_input_message.startswith("the replay reads x in step 0")
