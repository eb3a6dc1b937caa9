"""What no item explains: it needs some looks, and disappears with the looks that do not show it."""

from __future__ import annotations

import numpy as np
from ledger_bench import EYE, area_of, take_frame

from executive.cell.frame import Detections, Region
from executive.events import Event, UnexplainedChanged
from executive.ledger.unexplained import SETTLING_LOOK_COUNT, Unexplained

GATE = 0.03


def look(unexplained: Unexplained, *places: tuple[float, float], hidden: slice = slice(0, 0)) -> None:
    """Look at the table, on which regions are at some places [m]; the arm hides some columns."""
    frame = take_frame(1, hidden=hidden)
    seen = Detections("eye", (), EYE, frame=frame, view="full", area=area_of("full"))
    regions = [Region((0, 0, 9, 9), np.array([x, y, 0.0]), "a thing") for x, y in places]
    unexplained.observe(seen, regions, GATE)


def test_a_region_needs_no_more_looks_after_some() -> None:
    unexplained = Unexplained(lambda _: None)
    for _ in range(SETTLING_LOOK_COUNT):
        look(unexplained, (0.5, 0.1))
        assert len(unexplained.events) == 1
    assert not unexplained.needs_look


def test_two_regions_farther_apart_than_the_gate_are_two() -> None:
    unexplained = Unexplained(lambda _: None)
    look(unexplained, (0.5, 0.1), (0.54, 0.1))
    look(unexplained, (0.55, 0.1), (0.51, 0.1))
    assert [event.name for event in unexplained.events] == ["unexplained-1", "unexplained-2"]
    assert unexplained.needs_look


def test_looks_without_a_region_close_it_unless_the_arm_hides_it() -> None:
    events: list[Event] = []
    unexplained = Unexplained(events.append)
    look(unexplained, (0.5, 0.1))
    look(unexplained, hidden=slice(0, 640))
    assert unexplained.events
    look(unexplained)
    assert not unexplained.events
    assert isinstance(events[-1], UnexplainedChanged)
    assert not events[-1].is_open


def test_a_report_stays_until_it_is_withdrawn_and_is_emitted_when_it_changes() -> None:
    events: list[Event] = []
    unexplained = Unexplained(events.append)
    for text in ("a", "a", "b"):
        unexplained.report("bin red_bin", text)
    look(unexplained)
    assert [event.text for event in unexplained.events] == ["b"]
    assert len(events) == 2
    unexplained.report("bin red_bin", "")
    assert not unexplained.events
