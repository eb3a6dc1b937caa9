"""What a journal says of a run so far."""

from __future__ import annotations

from typing import Any

import pytest

from executive.replay.input_log import Past


def entry(tick: int, kind: str, **data: Any) -> dict[str, Any]:
    return {"tick": tick, "clock": tick / 240, "kind": kind, **data}


def sense(tick: int, value: object, name: str = "tool.holding", nth: int = 1) -> dict[str, Any]:
    return entry(tick, "sense", name=name, nth=nth, value=value)


START = entry(0, "run", step=1 / 240, seed=3)


def test_answers_are_in_order_by_what_was_asked() -> None:
    past = Past.of([START, sense(0, False), sense(0, "arm", name="arm.met"), sense(7, True, nth=2)])
    assert [(one.tick, one.nth, one.value) for one in past.senses["tool.holding"]] == [
        (0, 1, False),
        (7, 2, True),
    ]
    assert (past.number_of_answers("arm.met"), past.number_of_answers("arm.q")) == (1, 0)


def test_what_a_kill_left_of_a_control_step_is_void_once_the_run_was_taken_up() -> None:
    killed = [START, sense(4, True), sense(5, False), entry(5, "intent", action="open")]
    assert Past.of(killed).last_intent == "open"
    taken_up = Past.of([*killed, entry(5, "resume", ticked=5, intent="open"), sense(5, True, nth=3)])
    assert [one.value for one in taken_up.senses["tool.holding"]] == [True, True]
    assert (taken_up.last_intent, taken_up.resumes[5]["intent"]) == ("", "open")


def test_a_second_time_voids_only_what_came_after_the_first() -> None:
    entries = [
        START, sense(2, 1), sense(3, 2), entry(3, "resume", ticked=3, intent=""), sense(4, 3), sense(6, 4),
        entry(9, "resume", ticked=6, intent=""), sense(9, 5),
    ]  # fmt: skip
    past = Past.of(entries)
    assert [one.value for one in past.senses["tool.holding"]] == [1, 3, 5]
    assert {ticked: entry["tick"] for ticked, entry in past.resumes.items()} == {3: 3, 6: 9}


def test_what_came_after_a_halt_does_not_count() -> None:
    halted = [START, sense(8, 1), entry(9, "halt", ticked=True), sense(30, 2), entry(30, "end")]
    past = Past.of(halted)
    assert (past.complete(30), [one.value for one in past.before(9).senses["tool.holding"]]) == (9, [1])
    # Once it goes on, the halt is void.
    assert Past.of([*halted, entry(30, "resume", ticked=9, intent="")]).halt is None


@pytest.mark.parametrize(("steps", "complete"), [(0, 0), (7, 7), (8, 8), (9, 9), (500, 9)])
def test_a_control_step_counts_once_the_world_has_made_it_and_the_journal_knows_of_it(
    steps: int, complete: int
) -> None:
    # 8 is the last step that it tells of: whether all of it, the world's steps say.
    assert Past.of([START, sense(8, 1)]).complete(steps) == complete


def test_how_it_began() -> None:
    assert Past.of([]).start is None
    past = Past.of([START, entry(3, "request"), entry(4, "request")])
    assert (past.step, past.number_of("request")) == (1 / 240, 2)
