"""Shapes of the bodies of the simulated world, for display."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import pybullet

from executive.cell.workcell import Shape
from executive.cells.sim.models import get_inertial_pose
from executive.cells.sim.world import World
from executive.geometry import Pose

TABLE_COLOUR = (0.86, 0.78, 0.66)
"""Mean colour of the texture of the table, RGB, each 0 to 1."""

_SHAPE_KINDS = {
    pybullet.GEOM_BOX: "box",
    pybullet.GEOM_CYLINDER: "cylinder",
    pybullet.GEOM_SPHERE: "sphere",
    pybullet.GEOM_MESH: "mesh",
}
"""Values of `Shape.kind`, by PyBullet's types of geometry."""


class SimVisuals:
    """Shapes of all bodies except the floor; implements `executive.cell.workcell.Visuals`.

    A call of `poses` takes about 0.3 ms.

    Args:
        world: The world with all objects.

    Attributes:
        shapes: All shapes.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._link_indices = range(world.client.getNumJoints(world.arm))
        # Frame I: centre of mass, frame L: link. For a body without links, PyBullet returns the pose X_WI.
        self._X_IL = {body: get_inertial_pose(world.client, body).inverse() for body in world.labels}
        self.shapes: Sequence[Shape] = tuple(_make_shapes(world))

    def poses(self) -> Mapping[str, Pose]:
        """Return the poses of the links of the arm and of the loose objects, by name."""
        client = self._world.client
        states = client.getLinkStates(self._world.arm, self._link_indices, computeForwardKinematics=True)
        poses_by_name = {f"link {number}": Pose.of(*state[4:6]) for number, state in enumerate(states, 1)}
        for body in self._world.labels:
            X_WI = Pose.of(*client.getBasePositionAndOrientation(body))
            poses_by_name[f"object {body}"] = X_WI @ self._X_IL[body]
        return poses_by_name


def _make_shapes(world: World) -> Iterator[Shape]:
    """Yield the shapes of arm, table, bins and objects; the name of a static shape is ""."""
    for body in (world.arm, world.table, *world.bin_bodies.values(), *world.labels):
        X_WI = Pose.of(*world.client.getBasePositionAndOrientation(body))
        X_WL = X_WI @ get_inertial_pose(world.client, body).inverse()
        for data in world.client.getVisualShapeData(body):
            _, link, geometry, size, file, position, quaternion, colour = data[:8]
            if geometry not in _SHAPE_KINDS:
                continue
            pose = Pose.of(position, quaternion)  # relative to the link of the arm or to the object
            name = f"object {body}" if body in world.labels else ""
            if body == world.arm and link >= 0:
                name = f"link {link + 1}"
            if not name:
                pose = X_WL @ pose
            # PyBullet returns height and radius of a cylinder, and the radius of a sphere.
            is_cylinder = geometry == pybullet.GEOM_CYLINDER
            lengths = (2 * size[1], 2 * size[1], size[0]) if is_cylinder else tuple(size)
            if geometry == pybullet.GEOM_SPHERE:
                lengths = (2 * size[0],) * 3
            rgb = TABLE_COLOUR if body == world.table else tuple(colour[:3])
            yield Shape(name, _SHAPE_KINDS[geometry], lengths, pose, rgb, file.decode())
