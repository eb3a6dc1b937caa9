"""How fast the tool moves, from the joints."""

from __future__ import annotations

import numpy as np
import pytest
from rig import Rig

from executive.arm import Goal
from executive.clock import STEP


def test_it_is_how_far_the_tool_gets_in_a_control_step(rig: Rig) -> None:
    rig.go("home")
    rig.arm.start(rig.planned(Goal((0.55, -0.2, 0.2))))
    fastest = 0.0
    while not rig.arm.at_rest:
        before = rig.arm.tool_pose.position
        rig.step()
        gone = (rig.arm.tool_pose.position - before) / STEP
        assert rig.arm.tool_velocity == pytest.approx(gone, abs=0.02)
        fastest = max(fastest, float(np.linalg.norm(gone)))
    assert fastest > 0.3
    rig.step(30)
    assert rig.arm.tool_velocity == pytest.approx(np.zeros(3), abs=1e-3)
