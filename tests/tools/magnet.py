"""A magnet that holds only objects of the class `cube`: an example of a kind of tool in one file.

The project that contains this file registers the kind in its pyproject.toml:

    [project.entry-points."executive.tools"]
    magnet = "magnet:Magnet"

A cell file then declares the tool: `tool: {kind: magnet, force: 6, source: data sheet}`.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, ClassVar, Literal

from executive.cell.arm import Goal
from executive.cell.device_config import Force, Length, MotionConfig
from executive.cell.objects import ObjectClass, Target
from executive.cell.tools import GraspAttempt, GraspPose, ToolModel, ToolPart

if TYPE_CHECKING:
    from executive.drivers.sim.tool import SimTool
    from executive.drivers.sim.world import World

REACH = 0.002
"""Maximum distance between head and object at which the magnet attracts the object [m]."""
ROD_RADIUS = 0.008
"""Radius of the rod between flange and head [m]."""


class Magnet(ToolModel):
    """An electromagnet with a round head at the end of a rod, for cubes of steel."""

    noun: ClassVar[str] = "hold"

    kind: Literal["magnet"] = "magnet"
    head_radius: Length = 0.012
    """Radius of the head [m]."""
    head_length: Length = 0.02
    """Length of the head [m]."""
    force: Force
    """Force with which the magnet holds an object [N]."""

    @property
    def parts(self) -> tuple[ToolPart, ...]:
        """Rod and head."""
        rod = ToolPart(self.head_length, self.length - self.head_length, ROD_RADIUS)
        return rod, ToolPart(0.0, self.head_length, self.head_radius)

    @property
    def max_holding_force(self) -> float:
        """Force with which the magnet holds an object [N]."""
        return self.force

    def explain_unsuitable(self, object_class: ObjectClass) -> str:
        """Return a clause for each class but `cube`, because no other object is of steel."""
        return "" if object_class.label == "cube" else f"the magnet cannot hold a {object_class.label}"

    def list_grasps(
        self, object_class: ObjectClass, target: Target, motion: MotionConfig, attempt: GraspAttempt
    ) -> tuple[GraspPose]:
        """Return the grasp at the middle of the top, where the magnet stops on contact."""
        x, y, z = map(float, target.pose_at(target.stamp).position)
        top = z + object_class.height / 2
        goal = Goal(
            (x, y, top - attempt.overtravel),
            guarded_length=motion.descent + attempt.overtravel,
            guarded_speed=motion.descent_speed,
        )
        return (GraspPose(goal, contact_height=top),)

    def build_sim(self, world: World, noise_seed: int = 0) -> SimTool:
        """Return the simulated magnet, which holds a cube within reach."""
        # The module loads the physics engine, which a cell without physics does not need.
        from executive.drivers.sim.tool import SimTool

        def find_grip(bodies: Collection[int]) -> tuple[int, float] | None:
            cubes = sorted(body for body in bodies if world.labels[body] == "cube")
            return (cubes[0], self.force) if cubes else None

        return SimTool(world, self, find_grip, REACH, noise_seed)
