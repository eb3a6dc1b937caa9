"""A class of objects as a body of the simulator."""

from __future__ import annotations

import pybullet
from pybullet_utils.bullet_client import BulletClient

from executive.cell_config import ObjectConfig
from executive.geometry import Pose
from executive.sim.models import find_model, load_mesh, upright

ROLLING = SPINNING = 0.0005
"""Without this friction a ball set down at rest creeps, and a released one never stops."""


def add_body(client: BulletClient, config: ObjectConfig, X_WO: Pose) -> int:
    """Put an object at `X_WO` (z up as it stands) and return its body.

    Raises:
        InputError: Its model is not there, or is no mesh.
    """
    X_WL = X_WO @ upright(config)
    body = _add_mesh(client, config, X_WL) if config.mesh else _add_urdf(client, config, X_WL)
    client.changeDynamics(body, -1, rollingFriction=ROLLING, spinningFriction=SPINNING)
    return body


def _add_urdf(client: BulletClient, config: ObjectConfig, X_WL: Pose) -> int:
    path = str(find_model(config.urdf))
    return int(client.loadURDF(path, X_WL.position, X_WL.quaternion, globalScaling=config.scale))


def _add_mesh(client: BulletClient, config: ObjectConfig, X_WL: Pose) -> int:
    """Add a mesh of uniform density; to collide, its groups become convex and grow by Bullet's 1 mm."""
    shape = {"fileName": str(find_model(config.mesh)), "meshScale": [config.scale] * 3}
    centre = upright(config).inverse().apply(load_mesh(config).centroid)
    return int(
        client.createMultiBody(
            baseMass=config.mass,
            baseCollisionShapeIndex=client.createCollisionShape(pybullet.GEOM_MESH, **shape),
            baseVisualShapeIndex=client.createVisualShape(pybullet.GEOM_MESH, **shape),
            basePosition=X_WL.position,
            baseOrientation=X_WL.quaternion,
            baseInertialFramePosition=centre,
        )
    )
