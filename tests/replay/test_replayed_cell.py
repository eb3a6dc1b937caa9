"""A cell that replays recorded inputs, and continues on the cell inside."""

from __future__ import annotations

import pytest
from events import STEP, at, read, run_started

from executive.cells.fake.cell import FakeCell
from executive.errors import Stopped
from executive.events import RunHalted, RunResumed, TimedEvent
from executive.replay.input_log import InputLog, Interruption
from executive.replay.replayed_cell import ReplayedCell


def sense(tick: int, name: str, value: object, raised: str = "") -> TimedEvent:
    return at(tick, read(name, value, raised=raised))


START = [at(0, run_started()), sense(0, "clock", 0.0)]


def log(*events: TimedEvent) -> InputLog:
    return InputLog([*START, *events])


def test_questions_are_answered_from_the_log_and_commands_are_not_executed() -> None:
    fake = FakeCell()
    replayed = ReplayedCell(fake, log(sense(0, "tool.holding", True), sense(0, "command", None)))
    replayed.cell.arm.stop()
    assert (replayed.cell.tool.holding, fake.tool.holding) == (True, False)
    replayed.advance()
    assert (replayed.steps, fake.steps, replayed.cell.clock.now) == (1, 0, STEP)


def test_the_clock_is_the_count_of_steps_and_its_recorded_lead() -> None:
    replayed = ReplayedCell(FakeCell(), log(sense(2, "clock", 0.1)))
    replayed.advance()
    replayed.advance()
    assert replayed.cell.clock.now == pytest.approx(2 * STEP + 0.1)


def test_after_the_last_interruption_the_cell_inside_takes_over() -> None:
    fake = FakeCell()
    last = Interruption(1, "", False, 0)
    replayed = ReplayedCell(fake, log(sense(0, "tool.holding", True), sense(1, "tool.holding", False)), last)
    assert replayed.pending_interruption is None
    replayed.advance()
    assert (replayed.pending_interruption, replayed.cell.tool.holding) == (last, True)
    replayed.resume()
    assert (replayed.is_live, replayed.pending_interruption) == (True, None)
    assert not replayed.cell.tool.holding
    replayed.advance()
    assert replayed.steps == fake.steps == 2


def test_a_recorded_interruption_leaves_out_the_steps_in_which_nothing_was_decided() -> None:
    replayed = ReplayedCell(FakeCell(), log(at(5, RunResumed(1, "open", {})), sense(5, "arm.at_rest", True)))
    replayed.advance()
    assert replayed.pending_interruption == Interruption(1, "open", False, 5)
    replayed.resume()
    assert (replayed.steps, replayed.is_live, replayed.cell.arm.at_rest) == (5, False, True)


@pytest.mark.parametrize("ticked", [False, True])
def test_it_ends_where_the_recorded_run_was_halted(ticked: bool) -> None:
    replayed = ReplayedCell(FakeCell(), log(at(1, RunHalted(ticked))))
    assert not replayed.has_run_ended
    replayed.advance()
    assert replayed.has_run_ended is not ticked
    if ticked:
        with pytest.raises(Stopped):
            replayed.advance()
    # The arm may brake afterwards.
    replayed.advance()


def test_it_ends_where_the_record_ends() -> None:
    replayed = ReplayedCell(FakeCell(), log(sense(1, "tool.holding", True)))
    replayed.advance()
    assert not replayed.has_run_ended
    replayed.advance()
    assert replayed.has_run_ended
