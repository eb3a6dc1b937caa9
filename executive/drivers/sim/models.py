"""Models of objects: mesh, silhouette, PyBullet body, pose and mass; check of all models of a cell file."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from pathlib import Path

import cv2
import numpy as np
import pybullet
from numpy.typing import NDArray
from pybullet_utils.bullet_client import BulletClient

from executive.arms.urdf import find_model, make_rotation, parse_numbers
from executive.cell.config import CellConfig, ObjectConfig
from executive.cell.device_config import STEP
from executive.cell.frame import Box
from executive.cell.tools import CONTACT_SPACING
from executive.errors import InputError
from executive.geometry import Array, Pose, make_tool_down_pose
from executive.perception.yaw import choose_skewness
from executive.physics import model_files
from executive.processes import build_command
from executive.text.validate import KeyPath

DEFAULT_MESH_MASS = 0.05
"""Mass of a mesh for which the cell file declares no mass [kg]."""
MIN_MASS = 1e-4
"""Minimum mass of an object in a URDF [kg]; the same as of a mass in a cell file."""
MAX_MASS = 1000.0
"""Maximum mass of an object in a URDF [kg]; the same as of a mass in a cell file."""
MAX_ORIGIN_OFFSET = 0.5
"""Maximum horizontal distance between centre and origin of a URDF, relative to the radius."""
SIZE_TOLERANCE = 0.003
"""Maximum difference between a size in a cell file and the size of the model [m]."""
MESH_MARGIN = 1e-4
"""Distance by which the collision shape of a mesh exceeds the mesh [m]. With the default of PyBullet, 1 mm,
the top of a mesh on a table is felt 2 mm too high."""
ROLLING_FRICTION = 0.0005
"""Coefficient of rolling and spinning friction; without it, balls would never come to rest."""
TRIAL_TIMEOUT = 30
"""Maximum duration of the trial of a model, with the start of the process [s]."""
DROP_HEIGHT = 0.002
"""Height above its support at which an object is released [m]."""
SETTLING_STEP_COUNT = 360
"""Number of physics steps in which released objects come to rest."""
MAX_REST_ERROR = 0.005
"""Maximum distance of visual, collision shape and declared heights from each other at rest [m]."""
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


def measure_hold(config: CellConfig, label: str) -> float:
    """Return the largest force with which the tool can hold each model of a class [N].

    The tool is at the places of the first attempts: at a grasp point, on the ring or near the middle.
    """
    return min(_measure_hold(config, section) for section in config.objects[label].list_models())


def _measure_hold(config: CellConfig, section: ObjectConfig) -> float:
    mesh = load_mesh(section)
    X_WO = Pose.of([0.0, 0.0, -mesh.bottom])
    middle_x, middle_y = ((mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))[:2] / 2).tolist()
    offsets = [(x, y) for x in (0.0, -CONTACT_SPACING, CONTACT_SPACING) for y in (0.0, CONTACT_SPACING)]
    places = [grasp.point[:2] for grasp in section.grasps] or [(section.ring + x, y) for x, y in offsets]
    client = build_drop_world()
    body = add_body(client, section, X_WO)
    client.performCollisionDetection()  # Rays do not hit a new body.
    forces = [0.0]
    for x, y in places:
        if math.isfinite(top := mesh.measure_top(x, y)):
            X_WT = make_tool_down_pose((middle_x + x, middle_y + y, top))
            forces.append(config.tool.measure_hold(client, X_WT, body))
    return max(forces)


def find_model_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each model of an object that is missing, invalid, or of a wrong size.

    A child process tries each model that is not shipped with the executive or PyBullet; this process reads
    the model afterwards, because reading may take very long.
    """
    for label, section in config.objects.items():
        for index, object_config in enumerate(section.list_models()):
            try:
                path = find_model(object_config.mesh or object_config.urdf)
                if not model_files.is_shipped(path):
                    _try_in_child_process(object_config, path, path.stat().st_mtime_ns)
                compute_mass(object_config)
                for key, message in _find_wrong_sizes(label, object_config):
                    yield ("objects", label, "variants", index - 1) if index else key, message
            except InputError as error:
                keys = ("mesh" if section.mesh else "urdf",) if index == 0 else ("variants", index - 1)
                yield ("objects", label, *keys), str(error)
    for mesh in config.unknown.meshes:
        try:
            load_unknown_model(mesh)
        except InputError as error:
            yield ("unknown", "meshes"), str(error)


def _find_wrong_sizes(label: str, config: ObjectConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message if the declared height or radius of a class differs from that of its model.

    The executive computes the centre, the top and the free space of an object from height and radius.
    """
    mesh = load_mesh(config)
    has_size = True
    for name, model_size in (("height", mesh.top - mesh.bottom), ("radius", mesh.radius)):
        declared_size = getattr(config, name)
        if not abs(declared_size - model_size) <= SIZE_TOLERANCE:  # also True for NaN
            message = f"the model of {label} has a {name} of {model_size:.4f} m, not {declared_size:g} m; "
            yield ("objects", label, name), message + f"correct {name}, scale or upright_deg"
            has_size = False
    for x, y, z in (grasp.point for grasp in config.grasps):
        if z > (top := mesh.measure_top(x, y)) + SIZE_TOLERANCE:
            surface = f"the surface is {top * 1000:.1f} mm high" if top >= 0 else "there is no surface"
            message = f"the grasp point {x:g}, {y:g}, {z:g} m is outside of the {label}: {surface} there"
            yield ("objects", label, "grasp"), message
    if config.yaw_symmetry == 1 and has_size:
        outlines, _ = cv2.findContours(
            _draw_silhouette(mesh, mesh.vertices[:, :2] * 1000), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
        )
        outline = max(outlines, key=cv2.contourArea)[:, 0]
        offset = config.build_class(label).yaw_offset
        skewness = choose_skewness(outline @ [1, 1j] * np.exp(-1j * offset))
        if not skewness:
            message = f"no outline shows a half turn of the model of {label}; write yaw_symmetry: 2"
            yield ("objects", label, "yaw_symmetry"), message
        elif skewness < 0:
            turned = math.degrees(math.remainder(offset + math.pi, math.tau))
            message = f"the narrower end or the ends of the bend of the model of {label} point the other way"
            yield ("objects", label, "yaw_symmetry"), f"{message}; write yaw_offset_deg: {turned:g}"
    if config.footprint is None:
        return
    corners = cv2.convexHull(mesh.vertices[:, :2].astype(np.float32))[:, 0] @ [1, 1j]
    turned = corners * np.exp(1j * np.radians(np.arange(90)))[:, None]
    sides = np.sort(np.stack([np.ptp(turned.real, axis=1), np.ptp(turned.imag, axis=1)], axis=1), axis=1)
    errors = np.abs(sides - np.sort(config.footprint)).max(axis=1)
    if not errors.min() <= SIZE_TOLERANCE:
        width, length = sides[errors.argmin()].tolist()
        message = f"the model of {label} has a footprint of {length:.4f} by {width:.4f} m, not "
        yield (
            ("objects", label, "footprint"),
            message + " by ".join(f"{side:g}" for side in config.footprint) + " m",
        )


@lru_cache(maxsize=64)
def _try_in_child_process(config: ObjectConfig, path: Path, _change_time: int) -> None:
    """Call `try_model` in a child process, which the model at `path` may crash or keep busy.

    `_change_time` distinguishes versions of the file; the cache contains only models without errors.

    Raises:
        InputError: The child process crashed or took too long, or `try_model` failed.
    """
    command = build_command(__name__, config.model_dump_json())
    crash = f"the model {path.name} crashes PyBullet, or takes over {TRIAL_TIMEOUT} s; simplify its meshes"
    with tempfile.TemporaryDirectory() as folder:  # a crash would leave the files of `convert_model`
        environment = {**os.environ, "TMPDIR": folder}
        try:
            trial = subprocess.run(
                command, capture_output=True, text=True, timeout=TRIAL_TIMEOUT, env=environment, check=False
            )
        except subprocess.TimeoutExpired:
            raise InputError(crash) from None
    if trial.returncode < 0:  # a signal ended the process
        raise InputError(crash)
    if trial.returncode:
        message = trial.stderr.partition("InputError: ")[2].strip()
        reason = trial.stderr.strip().rpartition("\n")[2]
        raise InputError(message or f"the trial of the model {path.name} failed: {reason}")


def try_model(config: ObjectConfig) -> None:
    """Drop a model of the declared size on a table, and compare its shapes at rest with its class.

    Raises:
        InputError: PyBullet cannot load the model, or the model does not lie as its class declares.
    """
    compute_mass(config)
    if [*_find_wrong_sizes("", config)]:
        return  # the caller reports the sizes
    client = build_drop_world()
    mesh = load_mesh(config)
    _place_mesh(config, Pose.identity(), "collision")  # refuses shapes that PyBullet would ignore
    body = add_body(client, config, Pose.of([0, 0, DROP_HEIGHT - mesh.bottom]))
    for _ in range(SETTLING_STEP_COUNT):
        client.stepSimulation()
    vertices = locate_object(client, body, config).apply(mesh.vertices)
    visual = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    centre, _ = client.getBasePositionAndOrientation(body)
    lower, upper = (visual.round(3) + 0.0).tolist()  # the sum replaces -0.0 by 0.0
    problem = f"the model {Path(config.mesh or config.urdf).name} lies on the table with"
    # Each condition is also true for NaN.
    if not ((visual[0] <= centre).all() and (centre <= visual[1]).all()):
        place = f"its centre of mass at {np.round(centre, 3).tolist()} m, outside of its visual"
        raise InputError(f"{problem} {place}, {lower} to {upper} m; correct <inertial>")
    if not np.abs(visual[:, 2] - [0, config.height]).max() <= MAX_REST_ERROR:
        heights = f"z of its visual from {lower[2]:g} to {upper[2]:g} m, not 0 to {config.height:g} m"
        raise InputError(f"{problem} {heights}; correct <collision>, <inertial> or upright_deg")
    if not (difference := np.abs(client.getAABB(body) - visual).max()) <= MAX_REST_ERROR:
        box = f"a box around its collision shape that differs by {difference:.3f} m from that of its visual"
        raise InputError(f"{problem} {box}, more than {MAX_REST_ERROR:g} m; correct <collision> or <visual>")


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
    mesh = _place_mesh(config, X_OL)
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
    return _place_mesh(config, compute_upright_pose(config))


@lru_cache(maxsize=64)
def has_texture(config: ObjectConfig) -> bool:
    """Return True if the material of a mesh names a texture, whose colours an object has."""
    files = model_files.list_model_files(find_model(config.mesh)) if config.mesh else []
    return any(file.suffix.lower() not in (".obj", ".mtl", ".stl", ".dae") for file in files)


def _place_mesh(config: ObjectConfig, X_OL: Pose, tag: str = "visual") -> Mesh:
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
    return float(_draw_silhouette(mesh, pixels).sum()) / SUBPIXEL_COUNT**2


def _draw_silhouette(mesh: Mesh, pixels: Array) -> NDArray[np.uint8]:
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


if __name__ == "__main__":
    try_model(ObjectConfig.model_validate_json(sys.argv[1]))
