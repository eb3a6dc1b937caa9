"""Models of objects: mesh, silhouette, PyBullet body, pose and mass."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from pathlib import Path

import cv2
import numpy as np
import pybullet
from numpy.typing import NDArray
from pybullet_utils.bullet_client import BulletClient

from executive.arms.urdf import find_model, make_rotation, parse_numbers
from executive.cell.config import ObjectConfig
from executive.cell.device_config import STEP
from executive.cell.frame import Box
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.physics import model_files

DEFAULT_MESH_MASS = 0.05
"""Mass of a mesh for which the cell file declares no mass [kg]."""
MIN_MASS = 1e-4
"""Minimum mass of an object in a URDF [kg]; the same as of a mass in a cell file."""
MAX_MASS = 1000.0
"""Maximum mass of an object in a URDF [kg]; the same as of a mass in a cell file."""
MAX_ORIGIN_OFFSET = 0.5
"""Maximum horizontal distance between centre and origin of a URDF, relative to the radius."""
MESH_MARGIN = 1e-4
"""Distance by which the collision shape of a mesh exceeds the mesh [m]. With the default of PyBullet, 1 mm,
the top of a mesh on a table is felt 2 mm too high."""
ROLLING_FRICTION = 0.0005
"""Coefficient of rolling and spinning friction; without it, balls would never come to rest."""
DROP_HEIGHT = 0.002
"""Height above its support at which an object is released [m]."""
SETTLING_STEP_COUNT = 360
"""Number of physics steps in which released objects come to rest."""
UNKNOWN_MODEL_COUNT = 1000
"""Number of shapes in `random_urdfs` of pybullet_data."""
DAMAGED_MODEL_NUMBER = 168
"""Index of the shape in `random_urdfs` with a damaged mesh."""


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

    def measure_top(self, x: float, y: float) -> float:
        """Return the height of the surface at a point above the lowest vertex [m]; -inf beside the mesh.

        `x` and `y` are relative to the centre of the bounding box [m].
        """
        centre = (self.vertices.min(axis=0) + self.vertices.max(axis=0)) / 2
        corners = self.vertices[self.triangles] - [centre[0] + x, centre[1] + y, self.bottom]
        a, b, c = np.swapaxes(corners, 0, 1)

        def cross(p: Array, q: Array) -> Array:
            return np.asarray(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])

        # Weights of the corners of the point (0, 0), which is in a triangle if no two have different signs.
        weights = np.stack([cross(b, c), cross(c, a), cross(a, b)])
        sums = weights.sum(axis=0)
        is_inside = (weights * np.sign(sums) >= 0).all(axis=0) & (np.abs(sums) > 1e-12)
        heights = np.einsum("ij,ji->j", weights, corners[..., 2]) / np.where(sums == 0, 1.0, sums)
        return float(np.max(heights, where=is_inside, initial=-math.inf))

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
        normals = normals[has_area] / lengths[has_area, None].clip(1e-12)
        # A matrix of all distances would take 2 GB for 20,000 triangles.
        planes = zip(a[has_area], normals, strict=True)
        return all(((self.vertices - point) @ normal).max() < 1e-4 for point, normal in planes)


def add_body(client: BulletClient, config: ObjectConfig, X_WO: Pose) -> int:
    """Add an object to the world, with its upright frame O at the pose `X_WO`, and return the body.

    A mesh has uniform density.

    Raises:
        InputError: The model is missing or invalid.
    """
    X_WL = X_WO @ compute_upright_pose(config)
    path = model_files.convert_model(find_model(config.mesh or config.urdf))
    if config.mesh:
        # PyBullet replaces each group (`g`) of a Wavefront file by its convex hull.
        shape = {"fileName": path, "meshScale": [config.scale] * 3}
        centroid = compute_upright_pose(config).inverse().apply(load_mesh(config).centroid)
        collision = client.createCollisionShape(pybullet.GEOM_MESH, **shape)
        visual = client.createVisualShape(pybullet.GEOM_MESH, **shape)
        mass = compute_mass(config)
        body = client.createMultiBody(mass, collision, visual, X_WL.position, X_WL.quaternion, centroid)
        client.changeDynamics(body, -1, collisionMargin=MESH_MARGIN)
    else:
        try:
            body = client.loadURDF(path, X_WL.position, X_WL.quaternion, globalScaling=config.scale)
        except pybullet.error as error:
            raise InputError(
                f"PyBullet cannot load the model {Path(config.urdf).name}: {error} Name <robot> and <link>, "
                "and give <inertial> an <inertia>."
            ) from error
        if config.mass is not None:
            client.changeDynamics(body, -1, mass=config.mass)
    client.changeDynamics(body, -1, rollingFriction=ROLLING_FRICTION, spinningFriction=ROLLING_FRICTION)
    if config.friction is not None:
        client.changeDynamics(body, -1, lateralFriction=config.friction)
    return int(body)


def compute_mass(config: ObjectConfig) -> float:
    """Return the mass of a simulated object [kg], from the cell file or its URDF.

    Raises:
        InputError: The mass in the URDF is missing, or out of range.
    """
    if config.mesh:
        return config.mass or DEFAULT_MESH_MASS
    path = find_model(config.urdf)
    masses = model_files.read_urdf(path).iterfind(".//inertial/mass")
    mass = sum(sum(parse_numbers(path, mass, "value", (0.0,))) for mass in masses)
    if config.mass is not None:
        return config.mass
    if not MIN_MASS <= mass <= MAX_MASS:
        problem = f"the <inertial> of the model {path.name} has a mass of {mass:g} kg"
        raise InputError(f"{problem}; write {MIN_MASS:g} to {MAX_MASS:g} kg, or give the class a mass")
    return mass


def build_drop_world() -> BulletClient:
    """Return a physics world with nothing but a table top, at height 0."""
    client = BulletClient(pybullet.DIRECT)
    client.setGravity(0, 0, -9.81)
    client.setTimeStep(STEP)
    client.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
    table_shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[2, 2, 0.5])
    client.createMultiBody(0, table_shape, basePosition=[0, 0, -0.5])
    return client


@lru_cache(maxsize=64)
def compute_upright_pose(config: ObjectConfig) -> Pose:
    """Return `X_OL`, the pose of the frame L of the model file in the frame O of the upright object.

    The z axis of O points up. The origin of O is the origin of a URDF, but the centre of the bounding box of
    a mesh, because meshes have arbitrary origins; also of a URDF whose origin is far from its centre.
    """
    X_OL = Pose(make_rotation(*(math.radians(angle) for angle in config.upright_deg)), np.zeros(3))
    mesh = place_mesh(config, X_OL)
    centre = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    is_near_origin = math.hypot(*centre[:2]) <= MAX_ORIGIN_OFFSET * mesh.radius
    return X_OL if config.urdf and is_near_origin else Pose(X_OL.rotation, -centre)


def locate_object(client: BulletClient, body: int, config: ObjectConfig) -> Pose:
    """Return the pose `X_WO` of the upright frame O of an object."""
    X_WI = Pose.of(*client.getBasePositionAndOrientation(body))
    X_WL = X_WI @ get_inertial_pose(client, body).inverse()
    return X_WL @ compute_upright_pose(config).inverse()


def get_inertial_pose(client: BulletClient, body: int) -> Pose:
    """Return `X_LI`, the pose of the inertial frame I, at the centre of mass, in the model frame L."""
    return Pose.of(*client.getDynamicsInfo(body, -1)[3:5])


@lru_cache(maxsize=64)
def load_mesh(config: ObjectConfig) -> Mesh:
    """Return the scaled visual mesh of an object class in the upright frame O.

    Raises:
        InputError: The model is missing or invalid, or has no visual.
    """
    return place_mesh(config, compute_upright_pose(config))


@lru_cache(maxsize=64)
def has_texture(config: ObjectConfig) -> bool:
    """Return True if the material of a mesh names a texture, whose colours an object has."""
    files = model_files.list_model_files(find_model(config.mesh)) if config.mesh else []
    return any(file.suffix.lower() not in (".obj", ".mtl", ".stl", ".dae") for file in files)


def place_mesh(config: ObjectConfig, X_OL: Pose, tag: str = "visual") -> Mesh:
    """Return the scaled `visual` or `collision` mesh of an object class whose model frame L is at `X_OL`."""
    path = find_model(config.mesh or config.urdf)
    points, faces = model_files.read_mesh(path) if config.mesh else model_files.read_shapes(path, tag)
    return Mesh(X_OL.apply(points * config.scale), faces)


def scale_model(model: ObjectConfig, factor: float) -> ObjectConfig:
    """Return the model of an object scaled by `factor`."""
    names = ("scale", "height", "radius", "ring")
    sizes = {name: getattr(model, name) * factor for name in names}
    footprint = model.footprint and tuple(side * factor for side in model.footprint)
    return model.model_copy(update={**sizes, "footprint": footprint})


def name_unknown_model(number: int) -> str:
    """Return the path of shape `number` (0 to 999) in pybullet_data; most shapes are 12 cm long."""
    return f"random_urdfs/{number:03d}/{number:03d}.urdf"


@cache
def load_unknown_model(path: str) -> ObjectConfig:
    """Return the model of an object of no class, a URDF or a mesh."""
    key = "urdf" if path.endswith(".urdf") else "mesh"
    config = ObjectConfig.model_validate({key: path, "height": 1.0, "radius": 1.0})
    mesh = load_mesh(config)
    sizes = {"height": mesh.top - mesh.bottom, "radius": mesh.radius}
    if not 0 < max(sizes.values()) <= 1:
        raise InputError(f"the model {path} is {max(sizes.values()):g} m large; scale it to metres")
    return config.model_copy(update=sizes)


SUBPIXEL_COUNT = 4
"""Number of subpixels of a pixel along each axis in the rasterization of a silhouette."""


def compute_bounding_box(pixels: Array) -> Box:
    """Return the box around projected vertices `(N, 2)` [pixel]."""
    left, top = pixels.min(axis=0)
    right, bottom = pixels.max(axis=0)
    return float(left), float(top), float(right), float(bottom)


def compute_silhouette_area(mesh: Mesh, pixels: Array) -> float:
    """Return the area [pixel²] of the silhouette of a mesh whose projected vertices are `pixels` `(N, 2)`."""
    if mesh.is_convex:
        return float(cv2.contourArea(cv2.convexHull(pixels.astype(np.float32))))
    return float(draw_silhouette(mesh, pixels).sum()) / SUBPIXEL_COUNT**2


def draw_silhouette(mesh: Mesh, pixels: Array) -> NDArray[np.uint8]:
    """Return the silhouette of a mesh with projected vertices `(N, 2)` as a mask of subpixels, 0 or 1."""
    corner = np.floor(pixels.min(axis=0))
    size = np.ceil((pixels.max(axis=0) - corner + 1) * SUBPIXEL_COUNT).astype(int)
    mask = np.zeros((size[1], size[0]), np.uint8)
    triangles = ((pixels - corner) * SUBPIXEL_COUNT)[mesh.triangles]
    ax, ay = (triangles[:, 1] - triangles[:, 0]).T
    bx, by = (triangles[:, 2] - triangles[:, 0]).T
    # The triangles on the side of the camera, whose corners are clockwise, cover the whole silhouette.
    for triangle in triangles[ax * by - ay * bx > 0].round().astype(np.int32):
        cv2.fillConvexPoly(mask, triangle, 1)
    return mask
