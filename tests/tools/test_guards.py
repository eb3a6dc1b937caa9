"""An approach that must stay clear of everything, as of open fingers beside an object."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executive.cell.objects import Target
from executive.cell.tools import GraspPose
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from executive.tools.suction import Suction
from skills.approach import Approach


class Hovering(Suction):
    """A tool that grips from a distance of 10 mm."""

    def list_grasps(self, *arguments, **options) -> tuple[GraspPose]:
        (grasp,) = super().list_grasps(*arguments, **options)
        x, y, _ = grasp.goal.position
        goal = replace(grasp.goal, position=(x, y, grasp.contact_height + 0.01), guarded_length=0.01)
        return (replace(grasp, goal=goal, guard="clear"),)


@pytest.mark.parametrize(("higher", "reason"), [(0.0, ""), (0.01, "blocked")])
def test_a_contact_is_a_failure_and_an_arrival_without_one_a_success(
    fake: FakeCell, target: Target, higher: float, reason: str
) -> None:
    fake.cell = replace(fake.cell, tool_model=Hovering(**fake.cell.tool_model.model_dump()))
    fake.world.objects[0].position[2] += higher
    result = run_skill(Approach(target=target), fake)
    assert (result.reason or "") == reason
    assert fake.ledger.describe("cube-1").attempts == 0
