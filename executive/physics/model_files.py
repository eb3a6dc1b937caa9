"""Readers and checks of model files (URDF and meshes) before PyBullet opens the files."""

from __future__ import annotations

import io
import os
import re
import tempfile
import warnings
import zipfile
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pybullet
import pybullet_data
from numpy.typing import ArrayLike, NDArray

from executive.arms.urdf import (
    describe_place,
    find_model,
    parse_numbers,
    read_chain,
    read_origin,
    read_robot,
)
from executive.cell.arm_config import ArmFile
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.plugins import find_package_folder
from executive.text.files import get_shipped_folder, has_outside_link, is_outside_path, read_image_header

MAX_TRIANGLE_COUNT = 20_000
"""Maximum number of triangles of a mesh: a collision in PyBullet takes 3 s with 20,000, 60 s with 300,000."""
MAX_GROUP_COUNT = 1_000
"""Maximum number of groups and objects of a Wavefront file, of each of which PyBullet makes a convex hull,
and of the files that a Wavefront or material file names."""
FIXED_JOINTS = "joint[@type='fixed'][parent]"
"""Path of the fixed joints of a URDF."""
_NAMED_FILE = re.compile(r"^[ \t]*(?:mtllib|map_\w+|bump|disp|decal|refl)[ \t]+(\S.*)", re.MULTILINE)
"""Name of a further file in a Wavefront mesh or its materials."""
MESH_KINDS = {".obj": "Wavefront", ".stl": "STL", ".dae": "COLLADA"}
"""Formats of mesh files by suffix."""

Triangles = tuple[Array, NDArray[np.intp]]
"""Vertices `(N, 3)` [m], and the indices of the vertices of each triangle `(M, 3)`."""


def is_shipped(path: Path) -> bool:
    """Return True if a model belongs to pybullet_data or to the executive."""
    folders = (Path(pybullet_data.getDataPath()), get_shipped_folder() / "cells" / "fasteners")
    return any(path.is_relative_to(folder.resolve()) for folder in folders)


def read_urdf(path: Path) -> Element:
    """Return the root element of the URDF of an object; links joined by fixed joints become one link.

    Raises:
        InputError: The file is no URDF, refers to a file outside of its folder, or has an invalid mesh.
    """
    root = read_robot(path)
    check_files(path, root)
    _merge_links(path, root)
    return root


def check_files(path: Path, root: Element, max_triangle_count: float = MAX_TRIANGLE_COUNT) -> None:
    """Check every file that a URDF names; `root` is the root element of the URDF.

    Raises:
        InputError: The URDF has a namespace, or a mesh or texture is invalid, or outside of its folder.
    """
    for element in root.iter():
        if element.tag.startswith("{"):
            raise InputError(f"the model {path.name} has an XML namespace, {element.tag}; remove it")
        if element.tag == "mesh":
            read_mesh(find_mesh(path, element), max_triangle_count)
        elif element.tag == "texture":
            read_image_header(find_mesh(path, element))
        elif "filename" in element.attrib:
            _locate_file(path, element.attrib["filename"])


def _merge_links(path: Path, root: Element) -> None:
    """Move the parts of links joined by fixed joints into the base, the link that is no child of a joint."""
    pairs = [(joint, child) for joint in root.findall(FIXED_JOINTS) for child in joint.findall("child")]
    joints = {child.get("link"): joint for joint, child in pairs}
    links = {link.get("name"): link for link in root.findall("link")}
    for name, link in links.items():
        base = name
        X_BL = Pose.identity()
        left = dict(joints)  # each joint is passed once, even in a loop of joints
        while (joint := left.pop(base, None)) is not None:
            X_BL = read_origin(path, joint) @ X_BL
            base = joint.findall("parent")[0].get("link")
        if base == name or base not in links:
            continue
        for part in link:
            X_BP = X_BL @ read_origin(path, part)
            angles = pybullet.getEulerFromQuaternion(X_BP.quaternion)
            xyz, rpy = (" ".join(map(str, numbers)) for numbers in (X_BP.position, angles))
            part[:] = [child for child in part if child.tag != "origin"]
            ElementTree.SubElement(part, "origin", xyz=xyz, rpy=rpy)
        links[base].extend(link)
        root.remove(link)
        root.remove(joints[name])


def read_shapes(path: Path, tag: str) -> Triangles:
    """Return vertices and triangles of all `visual` or `collision` of a URDF, in the frame of its link.

    Raises:
        InputError: There is none, a shape is unknown or invalid, or the URDF has several links or inertials.
    """
    root = read_urdf(path)
    vertices: list[Array] = []
    triangles: list[NDArray[np.intp]] = []
    for element in root.iterfind(f"link/{tag}"):
        X_LE = read_origin(path, element)
        for shape in element.iterfind("geometry/*"):
            points, faces = read_shape(path, shape)
            triangles.append(faces + sum(map(len, vertices)))  # indices count the vertices of earlier shapes
            vertices.append(X_LE.apply(points))
    link_count, inertial_count = (len(root.findall(key)) for key in ("link", "link/inertial"))
    if link_count != 1 or not vertices or inertial_count > 1:
        counts = f"{link_count} link(s), {inertial_count} inertial(s) and {len(vertices)} shape(s) as <{tag}>"
        needed = "one <link>, or links joined by fixed joints, with <visual>, <collision> and one <inertial>"
        raise InputError(f"the model {path.name} has {counts}; an object is {needed}")
    return np.concatenate(vertices), np.concatenate(triangles)


def read_shape(path: Path, shape: Element, max_triangle_count: float = MAX_TRIANGLE_COUNT) -> Triangles:
    """Return vertices and triangles of an element below `geometry` of a URDF."""
    if shape.tag == "mesh":
        points, faces = read_mesh(find_mesh(path, shape), max_triangle_count)
        return points * parse_numbers(path, shape, "scale", (1.0, 1.0, 1.0), 0.0), faces
    if shape.tag not in ("box", "cylinder", "sphere", "capsule"):
        problem = f"{describe_place(path, shape)} has the geometry <{shape.tag}>"
        raise InputError(f"{problem}; possible are box, cylinder, sphere, capsule and mesh")
    from trimesh import creation  # the import takes a second

    if shape.tag == "box":
        mesh = creation.box(parse_numbers(path, shape, "size", (0.0, 0.0, 0.0), 0.0))
    else:
        (radius,) = parse_numbers(path, shape, "radius", (0.0,), 0.0)
        (length,) = (0.0,) if shape.tag == "sphere" else parse_numbers(path, shape, "length", (0.0,), 0.0)
        make = creation.cylinder if shape.tag == "cylinder" else creation.capsule
        mesh = make(radius=radius, height=length)
    return mesh.vertices, mesh.faces


@lru_cache(maxsize=64)
def convert_model(path: Path, max_triangle_count: float = MAX_TRIANGLE_COUNT) -> str:
    """Return the path of a URDF or mesh that contains Wavefront meshes only.

    PyBullet crashes, ignores units or reads nothing for some STL and COLLADA meshes. The files of converted
    models exist until the end of the process.
    """
    if path.suffix == ".obj":
        return str(path)
    if path.suffix.lower() in MESH_KINDS:
        import trimesh  # the import takes a second

        mesh = trimesh.Trimesh(*read_mesh(path, max_triangle_count), process=False)
        content = str(mesh.export(file_type="obj")).encode()
    else:
        root = read_urdf(path)
        files = [(element, find_mesh(path, element)) for element in root.iter("mesh")]
        names = [str(path.parent / element.attrib["filename"]) for element, _ in files]
        if names == [convert_model(file) for _, file in files] and b"<joint" not in path.read_bytes():
            return str(path)
        for element, file in files:
            element.set("filename", convert_model(file))
        content = ElementTree.tostring(root)
    suffix = ".obj" if path.suffix.lower() in MESH_KINDS else ".urdf"
    with tempfile.NamedTemporaryFile(suffix=suffix, dir=_make_folder().name, delete=False) as target:
        target.write(content)
    return target.name


@lru_cache(maxsize=1)
def _make_folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="models_")


def find_mesh(urdf: Path, mesh: Element) -> Path:
    """Return the path of the file of a `mesh` or `texture` element of a URDF.

    Raises:
        InputError: It is no file in the folder of the URDF, or is too large.
    """
    name = mesh.get("filename", "")
    file = os.path.abspath(_locate_file(urdf, name))
    if not os.path.isfile(file):
        problem = f'the model {urdf.name} names the file "{name}", but there is no file {file}'
        raise InputError(f"{problem}; copy the file there, or correct the name")
    return find_model(file)


def list_arm_files(arm: ArmFile) -> list[Path]:
    """Return the URDF of an arm, and the files that its links and materials name.

    Raises:
        InputError: A file does not exist, or is outside of the folder of the URDF.
    """
    path = find_model(arm.urdf)
    places = read_chain(arm.urdf, arm.flange).places
    parts = [part for part in read_robot(path) if part.tag == "material" or part.get("name") in places]
    meshes = [find_mesh(path, element) for part in parts for element in _find_references(part)]
    return [*dict.fromkeys([path, *(file for mesh in meshes for file in list_model_files(mesh))])]


def _find_references(part: Element) -> list[Element]:
    """Return the elements in a part of a URDF that name a file which PyBullet opens."""
    return [element for element in part.iter() if element.tag in ("mesh", "texture")]


def list_model_files(model: Path) -> list[Path]:
    """Return a URDF or mesh, and the existing files that it names: meshes, materials and textures.

    Raises:
        InputError: A URDF is invalid, or `list_named_files` raises the error.
    """
    files = [model]
    for path in files:  # The loop goes on with the files that it appends.
        files += [file for file in list_named_files(path) if file not in files]
    return files


def list_named_files(path: Path) -> list[Path]:
    """Return the existing files that a URDF, a Wavefront or a material file names.

    PyBullet opens these files; it leaves out missing materials and textures.

    Raises:
        InputError: The file names too many files, or one that is too large, no regular file, or outside of
            its folder.
    """
    names: dict[str, None] = {}
    if path.suffix.lower() in (".obj", ".mtl"):
        values = _NAMED_FILE.findall(path.read_text(encoding="utf-8", errors="surrogateescape"))
        # Options of a material may precede the name, and PyBullet reads only one word of some names.
        names = dict.fromkeys(name for value in values for name in (value.strip(), *value.split()))
    elif path.suffix.lower() == ".urdf":
        names = dict.fromkeys(element.get("filename", "") for element in _find_references(read_robot(path)))
    if len(names) > MAX_GROUP_COUNT:
        raise InputError(f"the model {path.name} names more than {MAX_GROUP_COUNT} files; join them")
    # A missing file of another computer, such as D:\colours.png, is no file outside of the folder.
    is_elsewhere = re.compile(r"[A-Za-z]:\\[^/]*").fullmatch
    named_files = [
        _locate_file(path, name) for name in names if os.path.lexists(name) or not is_elsewhere(name)
    ]
    existing_files = [file for file in dict.fromkeys(named_files) if os.path.lexists(file)]
    for file in existing_files:
        find_model(str(file.absolute()))
    return existing_files


def _locate_file(path: Path, name: str) -> Path:
    """Return the path of a file that a model names, without `package://NAME/`, `file://` etc.

    `package://NAME/` is the nearest parent folder NAME of the model, else the installed package NAME, else
    the folder of the model. The files of an installed package may name each other by `..`.

    Raises:
        InputError: The file is outside of the folder, of the package and of the shipped folders.
    """
    folder = path.parent
    scheme, rest = re.findall(r"^(?:(\w+):(?://)?)?(.*)", name)[0]
    if scheme in ("package", "model") and not (folder / rest).exists():
        package, _, rest = rest.partition("/")
        parents = [parent for parent in path.parents if parent.name == package]
        folder = parents[0] if parents else find_package_folder(package) or folder
    if ".." in rest.split("/"):
        for parent in path.parents:
            found = find_package_folder(parent.name)
            if found and found.resolve() == parent and (parent / "__init__.py").is_file():
                rest = os.path.relpath(os.path.normpath(folder / rest), parent)
                folder = parent
    if os.path.isabs(rest):
        rest = os.path.relpath(os.path.realpath(unquote(rest) if scheme else rest), folder)
    is_foreign = scheme not in ("", "file", "package", "model") or is_outside_path(rest)
    if not is_shipped((folder / rest).resolve()) and (is_foreign or has_outside_link(folder, rest)):
        problem = f'the model {path.name} names the file "{name}", which is outside of its folder'
        raise InputError(f"{problem}; copy the file into the folder, and name it without a folder")
    return folder / rest


@lru_cache(maxsize=64)
def read_mesh(path: Path, max_triangle_count: float = MAX_TRIANGLE_COUNT) -> Triangles:
    """Return vertices and triangles of a Wavefront, STL or COLLADA file; polygons are split into triangles.

    Raises:
        InputError: The file has another suffix, contains no valid mesh, has too many triangles, or names an
            invalid material or texture.
    """
    suffix = path.suffix.lower()
    if suffix not in MESH_KINDS:
        raise InputError(f"the model {path.name} is no mesh; convert it to one of: {', '.join(MESH_KINDS)}")
    try:
        vertices, triangles = _read_wavefront(path) if suffix == ".obj" else _read_with_trimesh(path, suffix)
        points = np.array(vertices, dtype=float)
        faces = np.array(triangles, dtype=np.intp).reshape(-1, 3)
        if not len(faces):
            raise ValueError("it has no faces" + (" (lines beginning with f)" if suffix == ".obj" else ""))
        if points.shape != (len(points), 3) or not np.isfinite(points).all():
            raise ValueError("a vertex needs three finite numbers")
        if faces.min() < 0 or faces.max() >= len(points):
            raise ValueError(f"a face names a vertex that is not there; there are {len(points)}")
    except Exception as error:  # trimesh raises errors of many types
        reason = "it has no scene, or a wrong reference" if isinstance(error, AttributeError) else error
        raise InputError(f"the model {path.name} is no {MESH_KINDS[suffix]} mesh: {reason}") from None
    if len(faces) > max_triangle_count:
        problem = f"the model {path.name} has more than {max_triangle_count} triangles"
        raise InputError(f"{problem}; simplify the mesh")
    # The import of Pillow takes 0.1 s, for which the check of shipped models must not wait.
    if suffix == ".obj" and not is_shipped(path):
        for material in list_named_files(path):
            if material.suffix.lower() != ".mtl":
                raise InputError(f"the model {path.name} names {material.name}, which is no .mtl file")
            for texture in list_named_files(material):
                read_image_header(texture)
    return points, faces


def _read_wavefront(path: Path) -> tuple[ArrayLike, ArrayLike]:
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    text = path.read_text(encoding="utf-8")
    if len(re.findall(r"(?m)^[ \t]*[go][ \t]", text)) > MAX_GROUP_COUNT:
        raise ValueError(
            f"it has more than {MAX_GROUP_COUNT} groups (lines beginning with g or o); join them"
        )
    for line in text.splitlines():
        keyword, *words = line.split() or [""]
        if keyword == "v":
            vertices.append([float(word) for word in words[:3]])
        elif keyword == "f":
            # A word such as 3/1/2 starts with a vertex number, from 1 or, if negative, from the end.
            numbers = [int(word.split("/")[0]) for word in words]
            indices = [number - 1 if number > 0 else len(vertices) + number for number in numbers]
            triangles += [(indices[0], *pair) for pair in pairwise(indices[1:])]
    return vertices, triangles


def _read_with_trimesh(path: Path, suffix: str) -> tuple[ArrayLike, ArrayLike]:
    """Read an STL or COLLADA file, the latter with its unit, but, like PyBullet, without its `up_axis`."""
    content = path.read_bytes()
    if suffix == ".stl":
        # A binary file has a header of 80 bytes, the number of triangles, and 50 bytes for each triangle.
        content = content[: 84 + 50 * int.from_bytes(content[80:84], "little")]
        if len(content) > 84 and len(content) % 50 == 34 and not content.startswith(b"solid"):
            triangles = np.frombuffer(
                content, [("normal", "<f4", 3), ("corners", "<f4", 9), ("", "<u2")], offset=84
            )
            return np.unique(triangles["corners"].reshape(-1, 3), axis=0, return_inverse=True)
    elif zipfile.is_zipfile(path) or re.search(rb"\bnan\b", content, re.IGNORECASE):
        # trimesh would unpack an archive of any size, and replace NaN by 0.
        raise ValueError("it is an archive, or contains NaN")
    import trimesh  # the import takes a second

    with warnings.catch_warnings(), np.errstate(invalid="ignore"):
        warnings.simplefilter("error", DeprecationWarning)  # NumPy warns about text that is no number
        scene = trimesh.load_scene(io.BytesIO(content), suffix[1:], process=False, ignore_broken=False)
        if scene.units:
            scene = scene.convert_units("meters")
        corners = scene.to_mesh().triangles.reshape(-1, 3)
    return np.unique(corners, axis=0, return_inverse=True)
