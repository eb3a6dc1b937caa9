"""Models of objects: visual mesh, PyBullet body, pose and mass, and check of the declared size."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
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
from executive.cells.sim.model_files import find_mesh, find_model, parse_numbers, read_urdf, read_wavefront
from executive.errors import InputError
from executive.geometry import Array, Pose

DEFAULT_MESH_MASS = 0.05
"""Mass of a mesh for which the cell file declares no mass [kg]."""
SIZE_TOLERANCE = 0.003
"""Maximum difference between a size in a cell file and the size of the model [m]."""
ROLLING_FRICTION = 0.0005
"""Coefficient of rolling and spinning friction; without it, balls would never come to rest."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangle mesh in the upright frame O of an object, whose z axis points up.

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
        # Each triangle (a, b, c) and the origin form a tetrahedron with the signed volume a · (b x c) / 6 and
        # the centroid (a + b + c) / 4.
        a, b, c = (self.vertices[self.triangles[:, i]] for i in range(3))
        volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
        if abs(volumes.sum()) < 1e-12:
            return (self.vertices.min(axis=0) + self.vertices.max(axis=0)) / 2
        return np.asarray(volumes @ (a + b + c) / 4 / volumes.sum())

    @cached_property
    def is_convex(self) -> bool:
        """True if no vertex is more than 0.1 mm in front of the plane of any triangle."""
        a, b, c = (self.vertices[self.triangles[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        lengths = np.linalg.norm(normals, axis=1)
        has_area = lengths > 0  # triangles without an area have no normal
        normals, a = normals[has_area] / lengths[has_area, None].clip(1e-12), a[has_area]
        distances = self.vertices @ normals.T - (a * normals).sum(axis=1)
        return bool(distances.max() < 1e-4)


def add_body(client: BulletClient, config: ObjectConfig, X_WO: Pose) -> int:
    """Add an object to the world, with its upright frame O at the pose `X_WO`, and return the body.

    Raises:
        InputError: The model is missing or invalid.
    """
    X_WL = X_WO @ compute_upright_pose(config)
    body = _add_mesh(client, config, X_WL) if config.mesh else _add_urdf(client, config, X_WL)
    if config.urdf and config.mass is not None:
        client.changeDynamics(body, -1, mass=config.mass)
    client.changeDynamics(body, -1, rollingFriction=ROLLING_FRICTION, spinningFriction=ROLLING_FRICTION)
    return body


def _add_urdf(client: BulletClient, config: ObjectConfig, X_WL: Pose) -> int:
    """Add the object of a URDF, with the frame L of the file at the pose `X_WL`, and return the body."""
    path = str(find_model(config.urdf))
    try:
        return int(client.loadURDF(path, X_WL.position, X_WL.quaternion, globalScaling=config.scale))
    except pybullet.error as error:
        raise InputError(f"PyBullet cannot load the model {config.urdf}: {error}") from error


def _add_mesh(client: BulletClient, config: ObjectConfig, X_WL: Pose) -> int:
    """Add an object of uniform density with a mesh, and return the body.

    PyBullet replaces each group (`g`) of a Wavefront file by its convex hull, enlarged by 1 mm.
    """
    shape = {"fileName": str(find_model(config.mesh)), "meshScale": [config.scale] * 3}
    centroid = compute_upright_pose(config).inverse().apply(load_mesh(config).centroid)
    collision = client.createCollisionShape(pybullet.GEOM_MESH, **shape)
    visual = client.createVisualShape(pybullet.GEOM_MESH, **shape)
    mass = compute_mass(config)
    return int(client.createMultiBody(mass, collision, visual, X_WL.position, X_WL.quaternion, centroid))


def compute_mass(config: ObjectConfig) -> float:
    """Return the mass of a simulated object [kg], from the cell file or its URDF."""
    if config.mass is not None or config.mesh:
        return config.mass or DEFAULT_MESH_MASS
    masses = read_urdf(find_model(config.urdf)).iterfind(".//inertial/mass")
    return sum(sum(parse_numbers(mass.get("value"), (0.0,))) for mass in masses)


def build_simulated_class(label: str, config: ObjectConfig) -> ObjectClass:
    """Return the object class of a section of a cell file, with the mass of the simulated objects."""
    return replace(build_object_class(label, config), mass=compute_mass(config))


def find_model_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each model of a cell file that is missing, invalid, or of a wrong size."""
    for label, object_config in config.objects.items():
        check: Callable[[ObjectConfig], object] = load_mesh if object_config.mesh else compute_mass
        try:
            check(object_config)
        except InputError as error:
            yield ("objects", label, "mesh" if object_config.mesh else "urdf"), str(error)
        else:
            yield from _find_wrong_sizes(label, object_config)


def _find_wrong_sizes(label: str, config: ObjectConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message if the declared height or radius of a class differs from that of its model.

    The executive computes the centre, the top and the free space of an object from height and radius.
    """
    try:
        mesh = load_mesh(config)
    except InputError:
        return  # the size of a model without a Wavefront mesh is unknown
    for name, model_size in (("height", mesh.top - mesh.bottom), ("radius", mesh.radius)):
        declared_size = getattr(config, name)
        if not abs(declared_size - model_size) <= SIZE_TOLERANCE:  # also True for NaN
            message = f"the model of {label} has a {name} of {model_size:.4f} m, not {declared_size:g} m; "
            yield ("objects", label, name), message + f"correct {name}, scale or upright_deg"


@lru_cache(maxsize=64)
def compute_upright_pose(config: ObjectConfig) -> Pose:
    """Return `X_OL`, the pose of the frame L of the model file in the frame O of the upright object.

    The z axis of O points up. The origin of O is the origin of a URDF, but the centre of the bounding box of
    a mesh, because meshes have arbitrary origins.
    """
    X_OL = Pose(_make_rotation(*(math.radians(angle) for angle in config.upright_deg)), np.zeros(3))
    if not config.mesh:
        return X_OL
    vertices = X_OL.apply(read_wavefront(find_model(config.mesh))[0] * config.scale)
    return Pose(X_OL.rotation, -(vertices.min(axis=0) + vertices.max(axis=0)) / 2)


def get_inertial_pose(client: BulletClient, body: int) -> Pose:
    """Return `X_LI`, the pose of the inertial frame I, at the centre of mass, in the model frame L."""
    return Pose.of(*client.getDynamicsInfo(body, -1)[3:5])


@lru_cache(maxsize=64)
def load_mesh(config: ObjectConfig) -> Mesh:
    """Return the scaled visual mesh of an object class in the upright frame O.

    Raises:
        InputError: The model has no visual mesh in Wavefront format.
    """
    if config.mesh:
        points, faces = read_wavefront(find_model(config.mesh))
        return Mesh(compute_upright_pose(config).apply(points * config.scale), faces)
    path = find_model(config.urdf)
    vertices: list[Array] = []
    triangles: list[NDArray[np.intp]] = []
    for visual in read_urdf(path).iter("visual"):
        mesh = visual.find("geometry/mesh")
        if mesh is None or not mesh.get("filename", "").endswith(".obj"):
            raise InputError(f"{path}: only visuals made of .obj meshes can be labelled")
        points, faces = read_wavefront(find_mesh(path, mesh))
        scale = np.array(parse_numbers(mesh.get("scale"), (1.0, 1.0, 1.0)))
        origin = visual.find("origin")
        rpy = parse_numbers(None if origin is None else origin.get("rpy"), (0.0, 0.0, 0.0))
        xyz = parse_numbers(None if origin is None else origin.get("xyz"), (0.0, 0.0, 0.0))
        X_LV = Pose(_make_rotation(*rpy), np.array(xyz) * config.scale)
        triangles.append(faces + sum(map(len, vertices)))  # indices count the vertices of earlier visuals
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
