"""Shapes of the fake cell for display: table, bins, tool, and objects as cylinders."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.layout import TOOL_RADIUS, list_bin_boxes
from executive.cell.visuals import Shape
from executive.cells.fake.world import FakeWorld
from executive.geometry import Pose

TOOL_NAME = "tool"
"""Name of the tool as a body of the displayed scene."""
TOOL_COLOUR, TABLE_COLOUR = (0.25, 0.28, 0.32), (0.86, 0.78, 0.66)
"""Colours of the displayed tool and table: red, green and blue, each 0 to 1."""
TABLE_THICKNESS = 0.02
"""Thickness of the displayed table [m]."""
TABLE_MARGIN = 0.12
"""Distance from the workspace to the edge of the displayed table on each side [m]."""


class FakeVisuals:
    """Shapes of a fake cell; implements `executive.cell.visuals.Visuals`.

    Args:
        config: The cell file.
        world: The world with all objects.
        get_tool_pose: Returns the pose of the tool centre point.

    Attributes:
        shapes: All shapes of the cell.
    """

    def __init__(self, config: CellConfig, world: FakeWorld, get_tool_pose: Callable[[], Pose]) -> None:
        self._world = world
        self._get_tool_pose = get_tool_pose
        self._names = {body: f"object {number}" for number, body in enumerate(world.objects)}
        # The origin of the tool frame is the tip of the tool, and z points out of the tool.
        tool_size = (2 * TOOL_RADIUS, 2 * TOOL_RADIUS, config.tool.length)
        tool_centre = Pose.of((0.0, 0.0, -config.tool.length / 2))
        tool = Shape(TOOL_NAME, "cylinder", tool_size, tool_centre, TOOL_COLOUR)
        self.shapes: Sequence[Shape] = (*_make_fixed_shapes(config), tool, *self._make_object_shapes(config))

    def poses(self) -> Mapping[str, Pose]:
        """Return the poses of the tool and of the objects, by name."""
        object_poses = {self._names[body]: Pose.of(body.position) for body in self._world.objects}
        return {TOOL_NAME: self._get_tool_pose(), **object_poses}

    def _make_object_shapes(self, config: CellConfig) -> Iterator[Shape]:
        """Yield the shapes of the objects, which are cylinders with the colour of the class."""
        for fake_object, name in self._names.items():
            object_class = config.objects[fake_object.label]
            size = (2 * object_class.radius, 2 * object_class.radius, object_class.height)
            yield Shape(name, "cylinder", size, Pose.of((0.0, 0.0, 0.0)), object_class.colours[0])


def _make_fixed_shapes(config: CellConfig) -> Iterator[Shape]:
    """Yield the shapes of the table and of the bins."""
    (left, right), (near, far) = config.table.x, config.table.y
    size = (right - left + 2 * TABLE_MARGIN, far - near + 2 * TABLE_MARGIN, TABLE_THICKNESS)
    table_pose = Pose.of(((left + right) / 2, (near + far) / 2, -TABLE_THICKNESS / 2))
    yield Shape("", "box", size, table_pose, TABLE_COLOUR)
    for bin in config.bins.values():
        for (half_length, half_width, half_height), centre in list_bin_boxes(bin.size):
            size = 2 * half_length, 2 * half_width, 2 * half_height
            yield Shape("", "box", size, Pose.of(np.add(bin.position, centre)), bin.colour)
