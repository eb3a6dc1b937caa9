"""Models of objects: visual mesh, body in PyBullet, mass, and check of the declared size."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import pybullet
from numpy.typing import NDArray
from pybullet_utils.bullet_client import BulletClient

from executive.cell.config import CellConfig, ObjectConfig
from executive.cell.layout import build_object_class
from executive.cell.objects import ObjectClass
from executive.cell.workcell import KeyPath
from executive.cells.sim.model_files import find_mesh, find_model, read_numbers, read_obj, read_urdf
from executive.errors import InputError
from executive.geometry import Array, Pose

SIZE_TOLERANCE = 0.003
"""Maximum difference between a size in a cell file and the size of the model [m]."""
ROLLING_FRICTION = 0.0005
"""Coefficient of rolling and spinning friction; without it, balls would never come to rest."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh in the upright frame O of its object (see `compute_upright_pose`); z points up.

    Attributes:
        vertices: Positions of the vertices `(N, 3)` [m].
        triangles: Indices of the vertices of each triangle `(M, 3)`.
    """

    vertices: Array
    triangles: NDArray[np.intp]

    @property
    def bottom(self) -> float:
        """Z coordinate of the lowest vertex [m]."""
        return float(self.vertices[:, 2].min())

    @property
    def top(self) -> float:
        """Z coordinate of the highest vertex [m]."""
        return float(self.vertices[:, 2].max())

    @property
    def radius(self) -> float:
        """Radius [m] of the vertical cylinder around the mesh, about the centre of the bounding box."""
        points = self.vertices[:, :2]
        return float(np.linalg.norm(points - (points.min(axis=0) + points.max(axis=0)) / 2, axis=1).max())

    @cached_property
    def centroid(self) -> Array:
        """Centroid of the enclosed volume `(3,)` [m]; without a volume, the centre of the bounding box."""
        a, b, c = (self.vertices[self.triangles[:, i]] for i in range(3))
        volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
        if abs(volumes.sum()) < 1e-12:
            return (self.vertices.min(axis=0) + self.vertices.max(axis=0)) / 2
        return np.asarray(volumes @ (a + b + c) / 4 / volumes.sum())

    @cached_property
    def is_convex(self) -> bool:
        """True if no vertex is more than 0.1 mm outside of the plane of a triangle."""
        a, b, c = (self.vertices[self.triangles[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        lengths = np.linalg.norm(normals, axis=1)
        normals, a = (normals / lengths[:, None].clip(1e-12))[lengths > 0], a[lengths > 0]
        distances = self.vertices @ normals.T - (a * normals).sum(axis=1)
        return bool(distances.max() < 1e-4)


def add_body(client: BulletClient, config: ObjectConfig, X_WO: Pose) -> int:
    """Add an object and return its body; `X_WO` is the pose of its upright frame O in the world.

    Raises:
        InputError: The model is missing or invalid.
    """
    X_WL = X_WO @ compute_upright_pose(config)
    body = _add_mesh(client, config, X_WL) if config.mesh else _add_urdf(client, config, X_WL)
    client.changeDynamics(body, -1, rollingFriction=ROLLING_FRICTION, spinningFriction=ROLLING_FRICTION)
    return body


def _add_urdf(client: BulletClient, config: ObjectConfig, X_WL: Pose) -> int:
    path = str(find_model(config.urdf))
    try:
        return int(client.loadURDF(path, X_WL.position, X_WL.quaternion, globalScaling=config.scale))
    except pybullet.error as error:
        raise InputError(f"PyBullet cannot load the model {config.urdf}: {error}") from error


def _add_mesh(client: BulletClient, config: ObjectConfig, X_WL: Pose) -> int:
    """Add a mesh of uniform density and return its body; each group collides as its convex hull + 1 mm."""
    shape = {"fileName": str(find_model(config.mesh)), "meshScale": [config.scale] * 3}
    centroid = compute_upright_pose(config).inverse().apply(load_mesh(config).centroid)
    return int(
        client.createMultiBody(
            baseMass=config.mass,
            baseCollisionShapeIndex=client.createCollisionShape(pybullet.GEOM_MESH, **shape),
            baseVisualShapeIndex=client.createVisualShape(pybullet.GEOM_MESH, **shape),
            basePosition=X_WL.position,
            baseOrientation=X_WL.quaternion,
            baseInertialFramePosition=centroid,
        )
    )


def compute_mass(config: ObjectConfig) -> float:
    """Return the mass of a simulated object [kg], from the cell file or its URDF."""
    if config.mesh:
        return config.mass
    masses = read_urdf(find_model(config.urdf)).iterfind(".//inertial/mass")
    return sum(sum(read_numbers(mass.get("value"), (0.0,))) for mass in masses)


def object_class_with_mass(label: str, config: ObjectConfig) -> ObjectClass:
    """Return the object class of a section of a cell file, with the mass of its simulated objects."""
    return replace(build_object_class(label, config), mass=compute_mass(config))


def find_missing_models(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each model of a cell file that is missing, invalid, or of a wrong size."""
    for label, section in config.objects.items():
        key: KeyPath = ("objects", label)
        try:
            if section.mesh:
                load_mesh(section)
            else:
                compute_mass(section)
        except InputError as error:
            yield (*key, "mesh" if section.mesh else "urdf"), str(error)
        else:
            yield from (((*key, name), message) for name, message in _find_wrong_sizes(label, section))


def _find_wrong_sizes(label: str, section: ObjectConfig) -> Iterator[tuple[str, str]]:
    """Yield `height` or `radius`, with a message, for each declared size that differs from the model.

    The executive computes the centre, the top and the free space of an object from these sizes. The size of
    a model without a Wavefront mesh is not checked.
    """
    try:
        mesh = load_mesh(section)
    except InputError:
        return
    for name, actual in (("height", mesh.top - mesh.bottom), ("radius", mesh.radius)):
        declared = getattr(section, name)
        if not abs(declared - actual) <= SIZE_TOLERANCE:  # also True for NaN
            yield (
                name,
                f"the model of {label} has a {name} of {actual:.4f} m, not {declared:g} m; "
                "correct the figure, scale or upright_deg",
            )


@lru_cache(maxsize=64)
def compute_upright_pose(config: ObjectConfig) -> Pose:
    """Return `X_OL`, the pose of the frame L of the model file in the frame O of the upright object.

    For a URDF, O has the origin of the file. For a mesh, whose origin is arbitrary, the origin of O is the
    centre of the bounding box.
    """
    X_OL = Pose(_make_rotation(*(math.radians(angle) for angle in config.upright_deg)), np.zeros(3))
    if not config.mesh:
        return X_OL
    vertices = X_OL.apply(read_obj(find_model(config.mesh))[0] * config.scale)
    return Pose(X_OL.rotation, -(vertices.min(axis=0) + vertices.max(axis=0)) / 2)


@lru_cache(maxsize=64)
def load_mesh(config: ObjectConfig) -> Mesh:
    """Return the scaled visual mesh of a class of objects in the frame O of the upright object.

    Raises:
        InputError: The model has no visual mesh in Wavefront format.
    """
    if config.mesh:
        points, faces = read_obj(find_model(config.mesh))
        return Mesh(compute_upright_pose(config).apply(points * config.scale), faces)
    path = find_model(config.urdf)
    vertices: list[Array] = []
    triangles: list[NDArray[np.intp]] = []
    for visual in read_urdf(path).iter("visual"):
        mesh = visual.find("geometry/mesh")
        if mesh is None or not mesh.get("filename", "").endswith(".obj"):
            raise InputError(f"{path}: only visuals made of .obj meshes can be labelled")
        points, faces = read_obj(find_mesh(path, mesh))
        scale = np.array(read_numbers(mesh.get("scale"), (1.0, 1.0, 1.0)))
        origin = visual.find("origin")
        rpy = read_numbers(None if origin is None else origin.get("rpy"), (0.0, 0.0, 0.0))
        xyz = read_numbers(None if origin is None else origin.get("xyz"), (0.0, 0.0, 0.0))
        X_LV = Pose(_make_rotation(*rpy), np.array(xyz) * config.scale)
        triangles.append(faces + sum(map(len, vertices)))
        vertices.append((compute_upright_pose(config) @ X_LV).apply(points * scale * config.scale))
    if not vertices:
        raise InputError(f"the model {path.name} has no visual, so no camera would see it")
    return Mesh(np.concatenate(vertices), np.concatenate(triangles))


def _make_rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation matrix for the angles in a URDF [rad]: about the fixed axes x, then y, then z."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)
