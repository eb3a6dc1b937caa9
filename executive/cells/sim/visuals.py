"""Shapes of the bodies of the simulated world, for display."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import pybullet

from executive.cell.visuals import Shape
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
    """Shapes of a world without its floor; implements `executive.cell.visuals.Visuals`.

    A call of `poses` takes about 0.3 ms.

    Args:
        world: The world with all its objects.

    Attributes:
        shapes: All shapes.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._links = range(world.client.getNumJoints(world.arm))
        # For a body without links, PyBullet returns the pose X_WI of the centre of mass.
        self._X_IB = {body: _get_inertia_pose(world, body).inverse() for body in world.bodies}
        names = {world.table: "", **{body: "" for bodies in world.bins.values() for body in bodies}}
        names |= {body: _name_object(body) for body in world.bodies}
        self.shapes: Sequence[Shape] = tuple(_make_shapes(world, names))

    def poses(self) -> Mapping[str, Pose]:
        """Return the poses of the links of the arm and of the loose objects, by name."""
        client = self._world.client
        states = client.getLinkStates(self._world.arm, self._links, computeForwardKinematics=True)
        links = zip(self._links, states, strict=True)
        poses_by_name = {_name_link(link): Pose.of(*state[4:6]) for link, state in links}
        for body in self._world.bodies:
            X_WI = Pose.of(*client.getBasePositionAndOrientation(body))
            poses_by_name[_name_object(body)] = X_WI @ self._X_IB[body]
        return poses_by_name


def _make_shapes(world: World, names: Mapping[int, str]) -> Iterator[Shape]:
    """Yield the shapes of the arm and of the bodies in `names`; the name of a static body is ""."""
    for body, name in ((world.arm, ""), *names.items()):
        X_WI = Pose.of(*world.client.getBasePositionAndOrientation(body))
        X_WB = X_WI @ _get_inertia_pose(world, body).inverse()
        for data in world.client.getVisualShapeData(body):
            _, link, geometry, size, file, position, quaternion, colour = data[:8]
            if geometry not in _SHAPE_KINDS:
                continue
            X_BS = Pose.of(position, quaternion)
            owner = _name_link(link) if body == world.arm and link >= 0 else name
            if not owner:
                X_BS = X_WB @ X_BS
            # PyBullet returns height and radius of a cylinder, and the radius of a sphere.
            is_cylinder = geometry == pybullet.GEOM_CYLINDER
            lengths = (2 * size[1], 2 * size[1], size[0]) if is_cylinder else tuple(size)
            if geometry == pybullet.GEOM_SPHERE:
                lengths = (2 * size[0],) * 3
            rgb = TABLE_COLOUR if body == world.table else tuple(colour[:3])
            yield Shape(owner, _SHAPE_KINDS[geometry], lengths, X_BS, rgb, file.decode())


def _get_inertia_pose(world: World, body: int) -> Pose:
    """Return `X_BI`, the pose of the centre of mass of a body in the frame of the body."""
    return Pose.of(*world.client.getDynamicsInfo(body, -1)[3:5])


def _name_link(link: int) -> str:
    return f"link {link + 1}"


def _name_object(body: int) -> str:
    return f"object {body}"
