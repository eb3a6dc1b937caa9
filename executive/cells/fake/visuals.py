"""The fake cell as a person sees it: bins, objects as cylinders, and the tool, which is all of its arm."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.layout import TOOL_RADIUS, bin_walls
from executive.cell.visuals import Shape
from executive.cells.fake.world import FakeObject, FakeWorld
from executive.geometry import Pose

TOOL, TOOL_COLOUR = "tool", (0.25, 0.28, 0.32)
TABLE_COLOUR = (0.86, 0.78, 0.66)
TABLE_THICKNESS = 0.02
"""What lies under the workspace, for the eye only [m]."""
TABLE_MARGIN = 0.12
"""How far the table goes on beyond the workspace [m]."""


class FakeVisuals:
    """Everything in a fake cell; implements `executive.cell.visuals.Visuals`.

    Args:
        config: The cell file.
        world: With all its objects in it.
        tool: Tells where the tool centre point is.
    """

    def __init__(self, config: CellConfig, world: FakeWorld, tool: Callable[[], Pose]) -> None:
        self._world = world
        self._tool = tool
        self._names: dict[FakeObject, str] = {
            thing: f"object {number}" for number, thing in enumerate(world.objects)
        }
        self._shapes = (*_fixed(config), *_tool(config), *self._objects(config))

    @property
    def shapes(self) -> Sequence[Shape]:
        """Every solid."""
        return self._shapes

    def poses(self) -> Mapping[str, Pose]:
        """Return where the tool and the objects are, by name."""
        places = {self._names[thing]: Pose.of(thing.position) for thing in self._world.objects}
        return {TOOL: self._tool(), **places}

    def _objects(self, config: CellConfig) -> Iterator[Shape]:
        for thing, name in self._names.items():
            kind = config.objects[thing.label]
            size = (2 * kind.radius, 2 * kind.radius, kind.height)
            yield Shape(name, "cylinder", size, Pose.of((0.0, 0.0, 0.0)), kind.colours[0])


def _fixed(config: CellConfig) -> Iterator[Shape]:
    """Yield the table and the bins."""
    (left, right), (near, far) = config.table.x, config.table.y
    size = (right - left + 2 * TABLE_MARGIN, far - near + 2 * TABLE_MARGIN, TABLE_THICKNESS)
    middle = Pose.of(((left + right) / 2, (near + far) / 2, -TABLE_THICKNESS / 2))
    yield Shape("", "box", size, middle, TABLE_COLOUR)
    for bin in config.bins.values():
        for (x, y, z), place in bin_walls(bin.size):
            size = 2 * x, 2 * y, 2 * z
            yield Shape("", "box", size, Pose.of(np.add(bin.position, place)), bin.colour)


def _tool(config: CellConfig) -> Iterator[Shape]:
    """Yield the tool, whose frame is at its tip, z pointing out of it."""
    size = (2 * TOOL_RADIUS, 2 * TOOL_RADIUS, config.tool.length)
    yield Shape(TOOL, "cylinder", size, Pose.of((0.0, 0.0, -config.tool.length / 2)), TOOL_COLOUR)
