"""A whole pick and place of one object: arm, tool and physics, without skills and without a camera."""

from __future__ import annotations

import numpy as np
import pytest
from rig import Rig

from executive.cell.arm import Goal, Task
from executive.cell.layout import build_bin, build_object_class
from executive.cell.objects import Load
from executive.geometry import Pose

AIM = {"cube": 0.0, "sphere": 0.0, "duck": 0.01}
"""Where along x from what is to be touched the middle of an object stands [m]: a duck's head is in front."""
OVERTRAVEL, DROP = 0.015, 0.015


def in_tool(rig: Rig, body: int) -> Pose:
    """Return the pose of an object in the tool's frame."""
    return rig.world.get_tool_pose().inverse() @ rig.world.get_object_pose(body)


@pytest.mark.parametrize(
    ("label", "bin", "x", "y"),
    [("cube", "red_bin", 0.44, -0.2), ("sphere", "blue_bin", 0.53, 0.0), ("duck", "yellow_bin", 0.62, 0.2)],
)
def test_an_object_is_picked_carried_without_slip_and_placed(
    rig: Rig, label: str, bin: str, x: float, y: float
) -> None:
    config, arm, tool = rig.config, rig.arm, rig.tool
    kind, box = build_object_class(label, config.objects[label]), build_bin(bin, config.bins[bin])
    body = rig.add(label, x + AIM[label], y)
    rig.step(120)
    over = Goal((*box.slots[0], float(box.position[2]) + kind.height + DROP))

    motion = config.motion
    down = Goal((x, y, kind.height - OVERTRAVEL), None, OVERTRAVEL + motion.descent, motion.descent_speed)
    rig.touch_down(down)
    tool.close()
    assert tool.held_body == body
    carry = Task(Load(kind, tool.holding_force))
    arm.plan_ahead(over, carry)
    rig.step(24)

    planning = arm.plan(over, carry)
    assert planning.ready
    hung, slips, pulls = in_tool(rig, body), [0.0], [0.0]
    arm.start(planning.result())
    while not arm.at_rest:
        rig.step()
        slips.append(float(np.linalg.norm(in_tool(rig, body).position - hung.position)))
        pulls.append(tool.pull)
    assert tool.holding
    assert arm.collision is None
    assert max(slips) < 0.001
    assert max(pulls) < tool.holding_force / 2
    assert arm.tool_pose.position == pytest.approx(over.position, abs=1e-4)

    arm.plan_ahead("home")
    tool.open()
    rig.step(24)
    home = arm.plan("home")
    assert home.ready
    arm.start(home.result())
    rig.run()
    assert arm.collision is None
    rig.step(120)
    lies = rig.world.get_object_pose(body).position
    assert lies[:2] == pytest.approx(box.slots[0], abs=0.03)
    assert box.contains(lies)
    assert lies[2] < kind.height
