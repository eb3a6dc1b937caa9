"""The visible shape of a model: its mesh, read from the URDF that the simulator loads too."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pybullet_data
from numpy.typing import NDArray

from executive.cell_config import CellConfig, ObjectConfig
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.workcell import KeyPath


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh in the object's frame O: z up as the object stands, origin as in the URDF.

    Attributes:
        vertices: `(N, 3)` [m].
        triangles: `(M, 3)` indices into `vertices`.
    """

    vertices: Array
    triangles: NDArray[np.intp]

    @property
    def bottom(self) -> float:
        """Height of the lowest vertex over the origin [m], negative where it lies below."""
        return float(self.vertices[:, 2].min())

    @property
    def top(self) -> float:
        """Height of the highest vertex over the origin [m]."""
        return float(self.vertices[:, 2].max())

    @cached_property
    def convex(self) -> bool:
        """True where no vertex lies more than 0.1 mm outside of any triangle's plane."""
        a, b, c = (self.vertices[self.triangles[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        lengths = np.linalg.norm(normals, axis=1)
        normals, a = (normals / lengths[:, None].clip(1e-12))[lengths > 0], a[lengths > 0]
        outside = self.vertices @ normals.T - (a * normals).sum(axis=1)
        return bool(outside.max() < 1e-4)


def find_model(urdf: str) -> Path:
    """Return the path of a URDF: a full path as it is, any other name as one of pybullet_data's.

    Raises:
        InputError: There is no such file.
    """
    path = Path(pybullet_data.getDataPath()) / urdf
    if path.is_file():
        return path.resolve()
    raise InputError(f"there is no model {urdf}, neither beside the cell file nor in pybullet_data")


def missing_models(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key of every model of a cell file that does not exist, and a sentence."""
    named: list[tuple[KeyPath, str]] = [(("arm", "urdf"), config.arm.urdf)]
    named += [(("objects", label, "urdf"), kind.urdf) for label, kind in config.objects.items()]
    for key, urdf in named:
        try:
            find_model(urdf)
        except InputError as error:
            yield key, str(error)


def upright(config: ObjectConfig) -> Pose:
    """Return `X_OL`: how the URDF's link frame L is turned in the object's frame O."""
    return Pose(_rotation(*(math.radians(angle) for angle in config.upright_deg)), np.zeros(3))


def load_mesh(config: ObjectConfig) -> Mesh:
    """Return the visual mesh of a class of objects, scaled and upright.

    Raises:
        InputError: The model has no mesh in Wavefront format to look at.
    """
    path = find_model(config.urdf)
    vertices: list[Array] = []
    triangles: list[NDArray[np.intp]] = []
    for visual in ElementTree.parse(path).iter("visual"):
        mesh = visual.find("geometry/mesh")
        if mesh is None or not mesh.get("filename", "").endswith(".obj"):
            raise InputError(f"{path}: only visuals made of .obj meshes can be labelled")
        corners, faces = _read_obj(path.parent / mesh.get("filename", ""))
        scale = np.array(_numbers(mesh.get("scale"), (1.0, 1.0, 1.0)))
        origin = visual.find("origin")
        rpy = _numbers(None if origin is None else origin.get("rpy"), (0.0, 0.0, 0.0))
        xyz = _numbers(None if origin is None else origin.get("xyz"), (0.0, 0.0, 0.0))
        X_LV = Pose(_rotation(*rpy), np.array(xyz) * config.scale)
        triangles.append(faces + sum(map(len, vertices)))
        vertices.append((upright(config) @ X_LV).apply(corners * scale * config.scale))
    return Mesh(np.concatenate(vertices), np.concatenate(triangles))


def _numbers(text: str | None, default: tuple[float, ...]) -> tuple[float, ...]:
    return default if text is None else tuple(map(float, text.split()))


def _rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation of URDF's fixed-axis angles [rad]: about x, then y, then z."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def _read_obj(path: Path) -> tuple[Array, NDArray[np.intp]]:
    """Return vertices and triangles of a Wavefront file; polygons are cut into fans."""
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for line in path.read_text().splitlines():
        key, *values = line.split() or [""]
        if key == "v":
            vertices.append([float(value) for value in values[:3]])
        elif key == "f":
            corners = [int(value.split("/")[0]) for value in values]
            corners = [i - 1 if i > 0 else len(vertices) + i for i in corners]
            triangles += [(corners[0], a, b) for a, b in pairwise(corners[1:])]
    return np.array(vertices), np.array(triangles, dtype=np.intp)
