"""A station that replays recorded inputs, and continues on its devices."""

from __future__ import annotations

import pytest
from events import at, read, run_started

from executive.errors import Stopped
from executive.events import RunHalted, TimedEvent
from executive.run.replay import InputLog, Interruption, Replay
from executive.testing.fake_cell import FakeCell


def sense(tick: int, name: str, value: object, raised: str = "") -> TimedEvent:
    return at(tick, read(name, value, raised=raised))


def log(*events: TimedEvent) -> InputLog:
    return InputLog([at(0, run_started()), *events])


def advance(replay: Replay, fake: FakeCell) -> None:
    """Continue with the next tick, as a resumed run does."""
    if replay.is_live:
        fake.advance()
        fake.border.tick = fake.tick_count
    else:
        replay.advance()
        fake.border.tick = replay.tick


def test_questions_are_answered_from_the_log_and_commands_are_not_executed(fake: FakeCell) -> None:
    fake.cell.arm.start(fake.cell.arm.plan("aside").result())
    replay = Replay(fake, log(sense(0, "tool.holding", True), sense(0, "command", None)))
    fake.cell.arm.stop()
    assert (fake.cell.tool.holding, fake.tool.holding, fake.arm.commands) == (True, False, ["start"])
    advance(replay, fake)
    assert (replay.tick, fake.tick_count) == (1, 0)


def test_after_the_last_interruption_the_devices_take_over(fake: FakeCell) -> None:
    last = Interruption(1, "", False, 0)
    replay = Replay(fake, log(sense(0, "tool.holding", True), sense(1, "tool.holding", False)), last)
    assert replay.pending_interruption is None
    advance(replay, fake)
    assert (replay.pending_interruption, fake.cell.tool.holding) == (last, True)
    replay.resume()
    assert (replay.is_live, replay.pending_interruption, fake.tick_count) == (True, None, 1)
    assert not fake.cell.tool.holding


@pytest.mark.parametrize("ticked", [False, True])
def test_it_ends_where_the_recorded_run_was_halted(fake: FakeCell, ticked: bool) -> None:
    replay = Replay(fake, log(at(1, RunHalted(ticked))))
    assert not replay.has_run_ended
    replay.advance()
    assert replay.has_run_ended is not ticked
    if ticked:
        with pytest.raises(Stopped):
            replay.advance()
    # The arm may brake afterwards.
    replay.advance()
