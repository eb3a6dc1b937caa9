"""Shapes of the simulated world for display."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import pybullet

from executive.cell.visuals import Shape
from executive.cells.sim.world import World
from executive.geometry import Pose

TABLE_COLOUR = (0.86, 0.78, 0.66)
"""Mean colour of the texture of the table, RGB, each 0 to 1."""

_KINDS = {
    pybullet.GEOM_BOX: "box",
    pybullet.GEOM_CYLINDER: "cylinder",
    pybullet.GEOM_SPHERE: "sphere",
    pybullet.GEOM_MESH: "mesh",
}


class SimVisuals:
    """Shapes of a world except the floor; implements `executive.cell.visuals.Visuals`.

    A call of `poses` takes about 0.3 ms.

    Args:
        world: The world with all its objects.

    Attributes:
        shapes: All shapes.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._links = range(world.client.getNumJoints(world.arm))
        # The simulator returns the pose of the centre of mass of a body without links.
        self._X_IB = {body: _inertia(world, body).inverse() for body in world.bodies}
        bodies = {world.table: "", **{body: "" for own in world.bins.values() for body in own}}
        bodies |= {body: _object(body) for body in world.bodies}
        self.shapes: Sequence[Shape] = tuple(_shapes_of(world, bodies))

    def poses(self) -> Mapping[str, Pose]:
        """Return the poses of the links of the arm and of the loose objects, by name."""
        client = self._world.client
        links = client.getLinkStates(self._world.arm, self._links, computeForwardKinematics=True)
        found = {_link(link): Pose.of(*state[4:6]) for link, state in zip(self._links, links, strict=True)}
        for body in self._world.bodies:
            X_WI = Pose.of(*client.getBasePositionAndOrientation(body))
            found[_object(body)] = X_WI @ self._X_IB[body]
        return found


def _shapes_of(world: World, bodies: Mapping[int, str]) -> Iterator[Shape]:
    """Yield the shapes of the arm and of the bodies with the given names."""
    for body, name in ((world.arm, ""), *bodies.items()):
        X_WB = Pose.of(*world.client.getBasePositionAndOrientation(body)) @ _inertia(world, body).inverse()
        for data in world.client.getVisualShapeData(body):
            _, link, kind, size, file, position, quaternion, colour = data[:8]
            if kind not in _KINDS:
                continue
            X_BS = Pose.of(position, quaternion)
            owner = _link(link) if body == world.arm and link >= 0 else name
            if not owner:
                X_BS = X_WB @ X_BS
            # The simulator returns height, radius of a cylinder.
            lengths = (2 * size[1], 2 * size[1], size[0]) if kind == pybullet.GEOM_CYLINDER else tuple(size)
            if kind == pybullet.GEOM_SPHERE:
                lengths = (2 * size[0],) * 3
            rgb = TABLE_COLOUR if body == world.table else tuple(colour[:3])
            yield Shape(owner, _KINDS[kind], lengths, X_BS, rgb, file.decode())


def _inertia(world: World, body: int) -> Pose:
    """Return `X_LI`, the pose of the centre of mass of a body in the frame of the body."""
    return Pose.of(*world.client.getDynamicsInfo(body, -1)[3:5])


def _link(link: int) -> str:
    return f"link {link + 1}"


def _object(body: int) -> str:
    return f"object {body}"
