"""Objects dropped onto table and bins until they lie still, in a small world of their own.

A fresh world every time makes the outcome a function of the starting poses alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import pybullet
from pybullet_utils.bullet_client import BulletClient

from executive.cell_config import CellConfig
from executive.clock import STEP
from executive.geometry import Pose
from executive.sim.bodies import add_body
from executive.sim.models import upright
from executive.sim.world import add_bin

SETTLING = 360
"""Physics steps after which a pile is taken as it is."""


def settle(config: CellConfig, objects: Sequence[tuple[str, Pose]]) -> list[Pose]:
    """Return where objects (label, `X_WO`) come to lie 1.5 s after they are let go."""
    client = BulletClient(pybullet.DIRECT)
    try:
        client.setGravity(0, 0, -9.81)
        client.setTimeStep(STEP)
        client.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
        table = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[2, 2, 0.5])
        client.createMultiBody(0, table, basePosition=[0, 0, -0.5])
        for bin in config.bins.values():
            add_bin(client, bin)
        poses = []
        for label, X_WO in objects:
            body = add_body(client, config.objects[label], X_WO)
            X_LI = Pose.of(*client.getDynamicsInfo(body, -1)[3:5])
            poses.append((body, (upright(config.objects[label]) @ X_LI).inverse()))
        for _ in range(SETTLING):
            client.stepSimulation()
        return [Pose.of(*client.getBasePositionAndOrientation(body)) @ X_IO for body, X_IO in poses]
    finally:
        client.disconnect()
