"""Missions whose bins are not where the cell file says."""

from __future__ import annotations

import pytest
from at_hand import intercept

from executive.cell.frame import BinAppearance
from executive.testing.fake_cell import FakeCell
from executive.testing.run_mission import run_mission


@pytest.mark.parametrize("mission", ["sort_overhead", pytest.param("sort_wrist", marks=pytest.mark.slow)])
def test_items_without_a_bin_are_rejected_and_the_others_are_sorted(mission: str) -> None:
    def arrange(fake: FakeCell) -> None:
        fake.world.objects.clear()
        for thing in (("cube", 0.46, -0.12), ("sphere", 0.58, 0.0)):
            fake.world.put(*thing)
        gone = BinAppearance("red_bin is gone")
        intercept(fake, "camera.inspect_bins", lambda frame: {"red_bin": gone})

    result = run_mission(mission, FakeCell, arrange=arrange)
    assert (result.status, result.items["placed"], result.items["rejected"]) == ("INCOMPLETE", 1, 1)
    assert "red_bin" in result.message
