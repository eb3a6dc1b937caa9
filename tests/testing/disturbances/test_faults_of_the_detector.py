"""A detector that is dead, hangs, is slow or unsure: on the fake cell."""

from __future__ import annotations

import pytest

from executive.cell import Request
from executive.errors import Unavailable
from executive.events import ignore
from executive.testing.disturbances import (
    DisturbedCell,
    after,
    between,
    detector_dead,
    detector_hangs,
    detector_slow,
    detector_unsure,
    during,
)
from executive.testing.disturbances.effect import Effect
from executive.testing.fake_cell import FakeCell
from executive.testing.run_mission import run_mission

LATENCY = 0.05


def cell_with(effect: Effect, start: float = 0.0, end: float = 100.0) -> DisturbedCell:
    fake = FakeCell()
    fake.world.put("cube", 0.5, 0.0)
    return DisturbedCell(fake, [between(start, end, effect)], ignore)


def ask(cell: DisturbedCell) -> Request:
    return cell.cell.detectors["embedded"].request(cell.cell.camera.capture(), "table")


def wait(cell: DisturbedCell, until: float) -> None:
    while cell.cell.clock.now < until - 1e-9:
        cell.advance()


def answered(cell: DisturbedCell, request: Request) -> float:
    """Return when a request is answered [s]."""
    while not request.ready:
        assert cell.cell.clock.now < 50.0, "it is never answered"
        cell.advance()
    return cell.cell.clock.now


def test_a_dead_detector_is_unavailable_when_an_answer_would_be_due() -> None:
    cell = cell_with(detector_dead())
    request = ask(cell)
    assert answered(cell, request) == pytest.approx(LATENCY, abs=0.005)
    with pytest.raises(Unavailable, match="the detector is dead, as the test wants it"):
        request.result()


def test_a_detector_that_hangs_answers_when_that_is_over() -> None:
    cell = cell_with(detector_hangs(), 1.0, 3.0)
    wait(cell, 0.5)
    assert answered(cell, ask(cell)) == pytest.approx(0.5 + LATENCY, abs=0.005)
    wait(cell, 1.0)
    request = ask(cell)
    assert answered(cell, request) == pytest.approx(3.0, abs=0.005)
    assert [one.label for one in request.result().found] == ["cube"]


def test_a_detector_that_hangs_until_a_time_answers_then() -> None:
    cell = cell_with(detector_hangs(until=2.0))
    assert answered(cell, ask(cell)) == pytest.approx(2.0, abs=0.005)


def test_a_slow_detector_answers_so_much_later() -> None:
    cell = cell_with(detector_slow(0.7))
    request = ask(cell)
    assert answered(cell, request) == pytest.approx(LATENCY + 0.7, abs=0.01)
    assert len(request.result().found) == 1


def test_an_unsure_detector_sees_everything_and_believes_nothing() -> None:
    cell = cell_with(detector_unsure())
    request = ask(cell)
    answered(cell, request)
    answer = request.result()
    assert [one.label for one in answer.found] == ["cube"]
    assert all(0 < one.confidence < answer.reliability.threshold for one in answer.found)


def test_what_was_asked_before_is_answered_as_ever() -> None:
    cell = cell_with(detector_dead(), 0.01)
    request = ask(cell)
    answered(cell, request)
    assert len(request.result().found) == 1


def test_two_things_at_once_both_count() -> None:
    fake = FakeCell()
    cell = DisturbedCell(fake, [after(0.0, detector_slow(0.2)), after(0.0, detector_slow(0.3))], ignore)
    assert answered(cell, ask(cell)) == pytest.approx(LATENCY + 0.5, abs=0.01)


@pytest.mark.parametrize(
    ("effect", "reason"),
    [(detector_dead(), "unavailable"), (detector_unsure(), "unsure")],
)
def test_a_mission_looks_again(effect: Effect, reason: str) -> None:
    result = run_mission("sort_overhead", disturbances=[during("tree/look/*/Detect", effect, nth=1)])
    assert result.reasons("*/Detect") == [reason]
    assert (result.status, result.agrees) == ("SUCCESS", True)


def test_a_mission_waits_for_a_detector_that_hangs_from_4_to_9_seconds() -> None:
    plain = run_mission("sort_overhead")
    result = run_mission("sort_overhead", disturbances=[between(4.0, 9.0, detector_hangs())])
    times = [event.clock for event in result.events if event.kind == "disturbance"]
    assert times
    assert all(4.0 <= clock < 9.0 for clock in times)
    assert not [e for e in result.events if e.kind == "look" and 4.1 < e.clock < 9.0]
    assert (result.status, result.agrees) == ("SUCCESS", True)
    assert result.items["placed"] == plain.items["placed"]


def test_a_detector_that_hangs_for_ever_ends_in_the_tests_patience() -> None:
    script = [during("tree/look/*/Detect", detector_hangs())]
    result = run_mission("sort_overhead", disturbances=script, longest=5.0)
    assert result.message == "the mission is not done after 5 s on its clock"
