"""The article's cycle: joint targets held for fixed numbers of steps, whatever the arm does meanwhile.

That is how the prototype moves which this cell began as: PyBullet's position control with a force of 500 and
no limit of velocity throws the joints at their targets, and the program waits. Its numbers of steps are kept,
its places are not: here it passes where the other methods do.
"""

from __future__ import annotations

import numpy as np
import pybullet

from executive.campaign.motion_rivals import Textbook
from executive.cell_config import CellConfig
from executive.clock import STEP
from executive.geometry import Array
from executive.motion.limits import JointLimits
from executive.motion.state import JOINTS, State
from executive.motion.trajectory import peaks
from executive.sim.world import World

MOVES = (300, 240, 240, 300, 240, 240)
"""Steps for which each target is held: above the object, on it, above it, above the bin, in it, above it."""
DWELLS = (0, 80, 0, 0, 100, 0)
"""Steps waited after each, for the tool to close and to open."""
MOTION, CYCLE = sum(MOVES) * STEP, (sum(MOVES) + sum(DWELLS)) * STEP
"""Time of the moves and of the whole cycle [s]: 6.5 and 7.25, the same for every pair."""
FORCE = 500.0
"""Of the joints' motors [Nm]."""


def article_peaks(config: CellConfig, way: Textbook, limits: JointLimits) -> Array:
    """Return the largest joint velocity, acceleration and jerk `(3,)` of a cycle, each over its limit.

    The arm is simulated in an empty cell from above the place of `way` where it stands; accelerations and
    jerks are differences between its measured velocities.
    """
    up, above_object, on_object = way.fetch[1:]
    above_bin, in_bin = way.carry[2:]
    targets = (above_object, on_object, above_object, above_bin, in_bin, above_bin)
    world = World(config, visuals=False)
    try:
        world.set_arm(up)
        velocities = []
        for target, held, dwell in zip(targets, MOVES, DWELLS, strict=True):
            world.client.setJointMotorControlArray(
                world.arm,
                range(JOINTS),
                pybullet.POSITION_CONTROL,
                targetPositions=target.tolist(),
                forces=[FORCE] * JOINTS,
            )
            for _ in range(held + dwell):
                world.step()
                states = world.client.getJointStates(world.arm, range(JOINTS))
                velocities.append([state[1] for state in states])
    finally:
        world.close()
    qd = np.array([np.zeros(JOINTS), *velocities])
    qdd = np.diff(qd, axis=0) / STEP
    # The measured velocities stand for positions, too: those have no part in peaks.
    return peaks(State(qd[1:], qd[1:], qdd), limits).max(axis=1)
