"""The fake cell as a person sees it."""

from __future__ import annotations

import numpy as np

from executive.cells.fake.cell import FakeCell


def test_shows_bins_objects_and_the_tool_where_they_are() -> None:
    cell = FakeCell(seed=4)
    thing = cell.world.put("cube", 0.5, 0.1)
    visuals = cell.visuals()
    kinds = [shape.kind for shape in visuals.shapes]
    assert kinds.count("box") == 1 + 5 * len(cell.cell.bins)
    assert kinds.count("cylinder") == len(cell.world.objects) + 1
    poses = visuals.poses()
    assert np.allclose(poses["tool"].position, cell.arm.tool_pose.position)
    name = f"object {cell.world.objects.index(thing)}"
    assert np.allclose(poses[name].position, thing.position)
    thing.position = np.add(thing.position, (0.1, 0.0, 0.0))
    assert np.allclose(visuals.poses()[name].position, thing.position)
    cell.world.objects.remove(thing)
    assert name not in visuals.poses()
