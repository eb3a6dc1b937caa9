from __future__ import annotations

import numpy as np

from executive.cell import Via
from executive.geometry import tool_down
from executive.motion.strokes import strokes


def via(x: float, z: float, yaw: float | None = None) -> Via:
    return Via(np.array([x, 0.0, z]), yaw)


def test_vias_above_one_another_are_one_stroke_with_one_yaw() -> None:
    found = strokes([via(0.5, 0.2), via(0.5, 0.1, yaw=0.3), via(0.4, 0.1)])
    assert [len(stroke.poses) for stroke in found] == [2, 1]
    assert [stroke.yaw for stroke in found] == [0.3, None]


def test_another_yaw_begins_another_stroke() -> None:
    assert len(strokes([via(0.5, 0.2, yaw=0.1), via(0.5, 0.1, yaw=0.3)])) == 2


def test_a_stroke_continues_where_the_tool_already_points_down_above_it() -> None:
    lift = [via(0.5, 0.2), via(0.5, 0.3, yaw=0.1)]
    assert strokes(lift, tool_down([0.5, 0.0, 0.05]))[0].continues
    assert not strokes(lift, tool_down([0.4, 0.0, 0.05]))[0].continues
    assert not strokes(lift)[0].continues
