"""Readers and checks of model files (URDF and meshes) before PyBullet opens the files."""

from __future__ import annotations

import os
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pybullet_data
from numpy.typing import NDArray

from executive.cell.paths import has_outside_link, is_outside_path
from executive.errors import InputError
from executive.geometry import Array

MAX_MODEL_SIZE = 20_000_000
"""Maximum size of a model file [byte], to limit the duration of the check."""
MAX_TRIANGLE_COUNT = 20_000
"""Maximum number of triangles of a mesh: a collision in PyBullet takes 3 s with 20,000, 60 s with 300,000."""


def find_model(name: str) -> Path:
    """Return the path of a model file, for an absolute path or a path in the folder of pybullet_data.

    Raises:
        InputError: There is no such file, or the file is larger than `MAX_MODEL_SIZE`.
    """
    path = os.path.join(pybullet_data.getDataPath(), name)
    # For an invalid file name, Path.is_file raises an error, but os.path.isfile returns False.
    if os.path.isfile(path):
        if os.path.getsize(path) > MAX_MODEL_SIZE:
            raise InputError(f"the model {name} is larger than {MAX_MODEL_SIZE // 1_000_000} MB")
        return Path(path).resolve()
    raise InputError(f"there is no model {name}, neither beside the cell file nor in pybullet_data")


def read_urdf(path: Path) -> ElementTree.Element:
    """Return the root element of the URDF of an object.

    Raises:
        InputError: The file is no URDF, refers to a file outside of its folder, or has an invalid mesh.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, OSError, ValueError, LookupError) as error:
        raise InputError(f"the model {path.name} is no URDF: {error}") from None
    if root.tag != "robot":
        raise InputError(f"the model {path.name} is no URDF: its root is <{root.tag}>, not <robot>")
    for element in root.iter():
        if element.tag.startswith("{"):
            raise InputError(f"the model {path.name} has an XML namespace, {element.tag}; remove it")
        if "filename" in element.attrib:
            _normalize_name(path, element.attrib["filename"])
        if element.tag == "mesh":
            find_mesh(path, element)
    return root


def find_mesh(urdf: Path, mesh: ElementTree.Element) -> Path:
    """Return the path of the mesh file of a `mesh` element of a URDF.

    Raises:
        InputError: The mesh is no file in the folder of the URDF, is too large, or has too many triangles.
    """
    path = find_model(str(urdf.parent / _normalize_name(urdf, mesh.get("filename", ""))))
    _check_triangle_count(path, _count_triangles(path))
    return path


def _normalize_name(urdf: Path, name: str) -> str:
    """Return a file name without `package://`; raise `InputError` for a file outside of the URDF's folder."""
    name = name.removeprefix("package://")
    if is_outside_path(name) or has_outside_link(urdf.parent, name):
        raise InputError(f'the model {urdf.name} names the file "{name}", which is outside of its folder')
    return name


@lru_cache(maxsize=64)
def _count_triangles(path: Path) -> int:
    """Return the number of triangles of a Wavefront or STL file; raise `InputError` if unreadable."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"the model {path.name} cannot be read: {error.strerror}") from error
    if path.suffix.lower() == ".stl":
        # A binary STL file has a header of 80 bytes, the number of triangles, and 50 bytes for each triangle.
        count = int.from_bytes(content[80:84], "little")
        return count if len(content) == 84 + 50 * count else content.count(b"endfacet")
    # A line "f" of a Wavefront file lists the vertices of a polygon, two more than its triangles.
    lines = (line.split() for line in content.splitlines())
    return sum(max(len(words) - 3, 0) for words in lines if words[:1] == [b"f"])


def _check_triangle_count(path: Path, count: int) -> None:
    """Raise `InputError` if the number of triangles of a file exceeds `MAX_TRIANGLE_COUNT`."""
    if count > MAX_TRIANGLE_COUNT:
        problem = f"the model {path.name} has more than {MAX_TRIANGLE_COUNT} triangles"
        raise InputError(f"{problem}; simplify the mesh")


def read_wavefront(path: Path) -> tuple[Array, NDArray[np.intp]]:
    """Return vertices `(N, 3)` and triangles `(M, 3)` of a Wavefront file; polygons are split into triangles.

    Raises:
        InputError: The file contains no valid mesh.
    """
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    try:
        for line in path.read_text(encoding="utf-8").splitlines():
            keyword, *words = line.split() or [""]
            if keyword == "v":
                vertices.append([float(word) for word in words[:3]])
            elif keyword == "f":
                # A word such as 3/1/2 starts with a vertex number, from 1 or, if negative, from the end.
                numbers = [int(word.split("/")[0]) for word in words]
                indices = [number - 1 if number > 0 else len(vertices) + number for number in numbers]
                triangles += [(indices[0], *pair) for pair in pairwise(indices[1:])]
        _check_triangle_count(path, len(triangles))
        points, faces = np.array(vertices, dtype=float), np.array(triangles, dtype=np.intp).reshape(-1, 3)
        if not triangles:
            raise ValueError("it has no faces (lines beginning with f)")
        if points.shape != (len(vertices), 3) or not np.isfinite(points).all():
            raise ValueError("a vertex (lines beginning with v) needs three finite numbers")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError(f"a face names a vertex that is not there; there are {len(vertices)}")
        return points, faces
    except (OSError, ValueError, IndexError, OverflowError) as error:
        raise InputError(f"the model {path.name} is no Wavefront mesh: {error}") from None


def parse_numbers(text: str | None, default: tuple[float, ...]) -> tuple[float, ...]:
    """Return the numbers in the text of a URDF attribute, or `default` if the attribute is missing.

    Raises:
        InputError: The text does not contain as many finite numbers as `default`.
    """
    if text is None:
        return default
    try:
        numbers = tuple(map(float, text.split()))
    except ValueError:
        numbers = ()
    if len(numbers) != len(default) or not np.isfinite(numbers).all():
        raise InputError(f'a URDF has "{text}" instead of {len(default)} finite number(s)')
    return numbers
