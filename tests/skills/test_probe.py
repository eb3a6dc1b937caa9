"""Probes of places where images show something that no item explains."""

from __future__ import annotations

import numpy as np
import pytest

from executive.cell.frame import Detections, Region, assume_rates
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.probe import Probe


@pytest.fixture
def region_cell(fake: FakeCell) -> FakeCell:
    """A cell in which two looks have shown a region at (0.5, 0.0) m."""
    for _ in range(2):
        show_region(fake)
    return fake


def show_region(fake: FakeCell) -> None:
    frame = fake.cell.camera.capture()
    area = fake.cell.camera.get_view_box("full")
    look = Detections("eye", (), assume_rates(0.5, ""), frame=frame, view="full", area=area)
    fake.ledger.observe_regions(look, [Region((0, 0, 9, 9), np.array([0.5, 0.0, 0.025]), "a thing")])


def test_a_touched_object_stays_unexplained_and_is_not_probed_again(region_cell: FakeCell) -> None:
    region_cell.world.put("cube", 0.5, 0.0)
    assert run_skill(Probe(), region_cell).status == "SUCCESS"
    show_region(region_cell)
    (event,) = region_cell.ledger.unexplained.events
    assert "the tool touched it at 51 mm" in event.text, "the fake tool feels a surface 1 mm away"
    assert run_skill(Probe(), region_cell).commands == []


def test_a_place_without_a_contact_is_flat_and_later_looks_ignore_it(region_cell: FakeCell) -> None:
    assert run_skill(Probe(), region_cell).status == "SUCCESS"
    show_region(region_cell)
    assert region_cell.ledger.unexplained.events == []


def test_a_mission_that_allows_no_probe_does_not_move(region_cell: FakeCell) -> None:
    assert run_skill(Probe(allowed=False), region_cell).commands == []
