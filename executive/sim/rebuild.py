"""Rebuilding a simulated world as it stood when the run that drove it was cut off."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from executive.geometry import Array, Pose
from executive.motion.sampled import sampled
from executive.motion.trajectory import Trajectory
from executive.sim import command_log as log
from executive.sim.command_log import Command, states_of
from executive.sim.tool import SuctionTool
from executive.sim.world import World


@dataclass(frozen=True, eq=False)
class UnderWay:
    """What the arm was doing when nobody commanded it any more.

    Attributes:
        command: Joint positions that it was sent last `(7,)` [rad].
        motion: The motion it followed, or None.
        time: How far on that path it was [s].
        idle: Physics steps that were none of the run.
    """

    command: Array
    motion: Trajectory | None
    time: float
    idle: int


def rebuild(world: World, tool: SuctionTool, commands: Iterable[Command]) -> UnderWay:
    """Do to a world, fresh from the same cell file and seed, all that was done to another one.

    The world is then the same to the last bit. What the arm was following is returned: as a controller that
    lost its master, it is to brake on its path.
    """
    command, motion, time, idle = np.zeros(0), None, 0.0, 0
    for kind, numbers, states in commands:
        if kind in (log.STEP, log.IDLE):
            idle += kind == log.IDLE
            world.step()
            tool.advance()
        elif kind == log.JOINTS_TO:
            time, command = numbers[0], np.array(numbers[1:])
            world.command_arm(command, time)
        elif kind == log.MOTION:
            duration, guarded, _ = numbers
            motion, time = sampled(states_of(Command(kind, numbers, states)), duration, guarded), 0.0
        elif kind == log.DONE:
            motion = None
        elif kind == log.CLOSE:
            tool.close()
        elif kind == log.OPEN:
            tool.open()
        elif kind == log.PLACE:
            world.place_object(int(numbers[0]), Pose.of(numbers[1:4], numbers[4:]))
        elif kind == log.REMOVE:
            world.remove_object(int(numbers[0]))
        elif kind == log.PART:
            tool.part()
        elif kind == log.LEAKS:
            tool.leaks = bool(numbers[0])
        elif kind == log.STICKS:
            tool.sticks = bool(numbers[0])
    return UnderWay(command, motion, time, idle)
