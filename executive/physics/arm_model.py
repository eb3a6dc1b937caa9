"""Arm of a URDF for PyBullet: its model with the tool, the hulls of its links, and errors in its model."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from string import Template
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from executive.arms.urdf import (
    ATTACHED_PREFIX,
    JointChain,
    describe_place,
    find_model,
    locate_flange,
    parse_numbers,
    read_chain,
    read_origin,
    read_robot,
)
from executive.cell.arm_config import TOOL_LINK, ArmConfig, ArmFile, FlangeConfig
from executive.cell.config import CellConfig
from executive.cell.device_config import Angles
from executive.cell.tools import ToolPart
from executive.errors import InputError
from executive.geometry import Array, Pose, rotate_about_z
from executive.perception.camera_model import draw_hull
from executive.physics.model_files import check_files, convert_model, find_mesh, is_shipped, read_shape
from executive.text.findings import suggest_choice
from executive.text.validate import KeyPath

CYLINDER_MARGIN = 0.001
"""Collision margin that Bullet adds on all sides to a cylinder of a URDF [m]."""
TOOL_MASS = 0.1
"""Mass of the tool [kg]."""
MAX_ARM_TRIANGLE_COUNT = 200_000
"""Maximum number of triangles of a mesh of an arm: the largest visual mesh of a UR5e has 42,000."""
MIN_LINK_MASS = 1e-3
"""Mass of a link without a mass [kg]; PyBullet would assume 1 kg."""
MAX_HULL_SIZE = 3.0
"""Maximum distance of a point of a link from the origin of the link [m]; a larger mesh is in millimetres."""
MAX_LINK_MASS = 1000.0
"""Maximum mass of a link [kg]."""
MAX_SHAPE_COUNT = 1000
"""Maximum number of collision shapes of an arm: the check of 2,000 shapes takes 4 s."""
NUMBER_COUNTS = {
    **dict.fromkeys(("xyz", "rpy"), 3),
    **dict.fromkeys(("value", "ixx", "iyy", "izz", "ixy", "ixz", "iyz", "damping", "friction"), 1),
}
"""Number of the numbers in the attributes of a link or joint that PyBullet reads, except those of shapes."""
HULL_MARGIN = 0.01
"""Distance between a link and its hull [m], for cables, hoses and the error of the camera pose."""
DIRECTION_COUNT = 240
"""Number of directions in which a hull touches its link."""


def build_arm_urdf(config: CellConfig, *, visuals: bool) -> str:
    """Return the URDF of the arm of a cell, with the tool as an additional fixed link.

    A fixed link has no drift, in contrast to a constraint between two bodies. The URDF contains the links
    that belong to the arm, absolute names of meshes that PyBullet can read, and an inertia for every link.
    """
    arm = config.arm
    path = find_model(arm.urdf)
    robot = read_robot(path)
    chain = read_chain(arm.urdf, arm.flange)
    result = Element("robot", name=arm.arm)
    for element in _list_parts(robot, chain):
        is_link = element.tag == "link"
        result.append(_complete_link(path, element, visuals=visuals) if is_link else element)
    _resolve_files(path, result)
    for number, material in enumerate(result.iter("material")):
        material.set("name", material.get("name", f"material_{number}"))  # PyBullet needs a name.
    ElementTree.indent(result)  # PyBullet cannot read long lines.
    text = ElementTree.tostring(result, encoding="unicode")
    return text.removesuffix("</robot>") + _build_tool_urdf(config)


def _resolve_files(path: Path, robot: Element) -> None:
    """Replace the names of meshes and textures by absolute paths of files that PyBullet can read."""
    for mesh in robot.iter("mesh"):
        file = find_mesh(path, mesh)
        # PyBullet reads the STL files of pybullet_data; the conversion would import trimesh.
        name = str(file) if is_shipped(file) else convert_model(file, MAX_ARM_TRIANGLE_COUNT)
        mesh.set("filename", name)
    for texture in robot.iter("texture"):
        texture.set("filename", str(find_mesh(path, texture)))


def build_attached_links(urdf: str, rotation_deg: Angles) -> str:
    """Return links and joints of a URDF whose base hangs on the link of the tool, turned by `rotation_deg`.

    The names get the prefix `ATTACHED_PREFIX`, because names of the arm may be equal.
    """
    path = find_model(urdf)
    robot = read_robot(path)
    children = {child.get("link") for child in robot.iterfind("joint/child")}
    bases = [link.get("name", "") for link in robot.iterfind("link") if link.get("name") not in children]
    if len(bases) != 1:
        raise InputError(f"the model {path.name} has {len(bases)} base links; a tool has one")
    result = Element("robot")
    for link in robot.iterfind("link"):
        result.append(_complete_link(path, link, visuals=True))
    for joint in robot.iterfind("joint"):
        for end in (*joint.findall("parent"), *joint.findall("child")):
            end.set("link", ATTACHED_PREFIX + end.get("link", ""))
        result.append(joint)
    for element in result:
        element.set("name", ATTACHED_PREFIX + element.get("name", ""))
    _resolve_files(path, result)
    for number, material in enumerate(result.iter("material")):
        material.set("name", f"{ATTACHED_PREFIX}material_{number}")
    mount = ElementTree.SubElement(result, "joint", name=f"{ATTACHED_PREFIX}mount", type="fixed")
    ElementTree.SubElement(mount, "parent", link=TOOL_LINK)
    ElementTree.SubElement(mount, "child", link=ATTACHED_PREFIX + bases[0])
    ElementTree.SubElement(mount, "origin", xyz="0 0 0", rpy=" ".join(map(str, np.radians(rotation_deg))))
    ElementTree.indent(result)  # PyBullet cannot read long lines.
    return "".join(ElementTree.tostring(element, encoding="unicode") for element in result)


def _list_parts(robot: Element, chain: JointChain) -> list[Element]:
    """Return the links, joints and materials of a URDF that belong to the arm."""
    parts = robot.findall("material")
    for element in robot:
        child = element.find("child") if element.tag == "joint" else None
        name = element.get("name") if element.tag == "link" else child is not None and child.get("link")
        if name in chain.places:
            parts.append(element)
    return parts


def _complete_link(path: Path, link: Element, *, visuals: bool) -> Element:
    """Return a link with an inertia, and without visual shapes unless `visuals` is True."""
    result = Element("link", name=link.get("name", ""))
    left_out = ("inertial",) if visuals else ("inertial", "visual")
    result.extend(child for child in link if child.tag not in left_out)
    inertial = link.find("inertial")
    mass = link.find("inertial/mass")
    inertia = link.find("inertial/inertia")
    value = 0.0 if mass is None else parse_numbers(path, mass, "value", (0.0,))[0]
    moment = str(MIN_LINK_MASS * max(1.0, value / MIN_LINK_MASS) * 1e-3)
    axes = {"ixx": moment, "iyy": moment, "izz": moment, "ixy": "0", "ixz": "0", "iyz": "0"}
    if inertial is None or inertia is None or axes.keys() - inertia.attrib.keys() or value <= 0:
        inertial = Element("inertial")
        ElementTree.SubElement(inertial, "mass", value=str(max(value, MIN_LINK_MASS)))
        ElementTree.SubElement(inertial, "inertia", axes)
    result.insert(0, inertial)
    return result


def _build_tool_urdf(config: CellConfig) -> str:
    """Return the end of a URDF: link and joint of the tool."""
    tool = config.tool
    flange = config.arm.flange
    text_of_tool, text_of_part = Path(__file__).with_name("tool.urdf").read_text().split("</robot>\n")
    part_template = Template(text_of_part)
    parts = "".join(
        part_template.substitute(
            centre=tool.length - part.offset - part.length / 2,
            x=part.centre[0],
            y=part.centre[1],
            visual=_describe_shape(part, 0.0),
            collision=_describe_shape(part, 0.0 if part.sides else CYLINDER_MARGIN),
        )
        for part in tool.parts
    )
    values: dict[str, object] = {
        "flange_link": escape(flange.link, {'"': "&quot;"}),
        "xyz": " ".join(map(str, locate_flange(flange).position)),
        "rpy": " ".join(map(str, np.radians(flange.rotation_deg))),
        "centre": tool.length / 2,
        "mass": TOOL_MASS,
        "parts": parts,
    }
    return Template(text_of_tool).substitute(values) + tool.build_links() + "</robot>"


def _describe_shape(part: ToolPart, margin: float) -> str:
    """Return the shape of a part of the tool in a URDF, smaller by `margin` [m] on all sides."""
    length = part.length - 2 * margin
    if part.sides is None:
        return f'<cylinder length="{length}" radius="{part.radius - margin}"/>'
    return f'<box size="{part.sides[0]} {part.sides[1]} {length}"/>'


class ArmHulls:
    """Hulls of the links of an arm in the world and in images.

    Args:
        arm: The arm of a cell.
    """

    def __init__(self, arm: ArmConfig) -> None:
        self._chain = read_chain(arm.urdf, arm.flange)
        self._X_WB = Pose(rotate_about_z(math.radians(arm.base.yaw_deg)), np.array(arm.base.position))
        self._points_by_link = read_hulls(arm.urdf, arm.flange)

    def compute_points(self, q: Array) -> list[Array]:
        """Return the corners `(N, 3)` [m] of the hull of each link in the world at `q` `(n,)` [rad]."""
        frames = self._chain.compute_frames(q)
        points_by_link = []
        for link, points in self._points_by_link.items():
            count, X_JL = self._chain.places[link]
            points_by_link.append((self._X_WB @ frames[count] @ X_JL).apply(points))
        return points_by_link

    def draw(self, mask: NDArray[np.uint8], q: Array, matrix: Array, X_WC: Pose) -> None:
        """Set the pixels of an image mask `(H, W)` that the links hide at `q` `(n,)` [rad].

        `matrix` is the camera matrix `(3, 3)` [pixel].
        """
        for points in self.compute_points(q):
            draw_hull(mask, points, matrix, X_WC)


@lru_cache(maxsize=8)
def read_hulls(urdf: str, flange: FlangeConfig) -> Mapping[str, Array]:
    """Return the corners `(N, 3)` [m] of a hull `HULL_MARGIN` around each link, in the frame of the link.

    Raises:
        InputError: A collision shape is invalid.
    """
    path = find_model(urdf)
    places = read_chain(urdf, flange).places
    directions = _spread_directions(DIRECTION_COUNT)
    hulls: dict[str, Array] = {}
    for link in read_robot(path).findall("link"):
        name = link.get("name", "")
        if name not in places:
            continue
        shapes = [
            read_origin(path, element).apply(read_shape(path, shape, MAX_ARM_TRIANGLE_COUNT)[0])
            for element in link.findall("collision")
            for shape in element.iterfind("geometry/*")
        ]
        if shapes:
            # One shape after the other, because a mesh may have 600,000 vertices.
            points = np.concatenate([each[(each @ directions.T).argmax(axis=0)] for each in shapes])
            corners = points[(points @ directions.T).argmax(axis=0)]
            size = float(np.abs(corners).max())
            if size > MAX_HULL_SIZE:
                advice = 'lengths are in metres; add scale="0.001 0.001 0.001" to a mesh in millimetres'
                raise InputError(f'the link "{name}" of the model {path.name} is {size:.3g} m long: {advice}')
            hulls[name] = corners + HULL_MARGIN * directions
    return hulls


def _spread_directions(count: int) -> Array:
    """Return unit vectors `(count, 3)`, evenly spread on a Fibonacci spiral."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angles = np.arange(count) * math.pi * (3.0 - math.sqrt(5.0))
    radius = np.sqrt(1.0 - z**2)
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), z], axis=1)


def _check_parts(path: Path, robot: Element) -> None:
    """Check the files, numbers and shapes of the parts of an arm.

    Raises:
        InputError: PyBullet cannot read a part, or would need too much time.
    """
    check_files(path, robot, MAX_ARM_TRIANGLE_COUNT)
    if (count := len(robot.findall("link/collision"))) > MAX_SHAPE_COUNT:
        raise InputError(f"the arm in {path.name} has {count} <collision>; write at most {MAX_SHAPE_COUNT}")
    for element in robot.iter():
        for key in NUMBER_COUNTS.keys() & element.attrib.keys():
            numbers = parse_numbers(path, element, key, (0.0,) * NUMBER_COUNTS[key])
            if element.tag == "mass" and not 0 <= numbers[0] <= MAX_LINK_MASS:
                problem = f"{describe_place(path, element)} has a mass of {numbers[0]:g} kg"
                raise InputError(f"{problem}; allowed are 0 to {MAX_LINK_MASS:g} kg")
        if element.tag in ("visual", "collision"):
            shapes = element.findall("geometry/*")
            if len(shapes) != 1:
                problem = f"{describe_place(path, element)} has {len(shapes)} shapes in a <{element.tag}>"
                raise InputError(f"{problem}; write one <geometry> with one shape")
            read_shape(path, shapes[0], MAX_ARM_TRIANGLE_COUNT)


def find_arm_model_errors(arm: ArmFile) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each error in the model of the arm: links, joints, masses and meshes."""
    try:
        path = find_model(arm.urdf)
        chain = read_chain(arm.urdf, arm.flange)
        robot = read_robot(path)
        robot[:] = _list_parts(robot, chain)
        if not is_shipped(path):
            _check_parts(path, robot)
        hulls = read_hulls(arm.urdf, arm.flange)
    except InputError as error:
        yield ("arm", "urdf"), str(error)
        return
    if TOOL_LINK in chain.places:
        yield (
            ("arm", "urdf"),
            f'the model {path.name} has a link "{TOOL_LINK}", the name of the tool; rename it',
        )
    if len(chain.joints) != arm.joint_count:
        joints = f"{len(chain.joints)} joints up to the flange: {', '.join(chain.joints)}"
        message = f"the model {path.name} has {joints}; the limits are for {arm.joint_count} joints"
        yield ("arm", "limits"), message
    # The tool is beyond the link before the last joint.
    frames = chain.compute_frames(np.zeros(len(chain.joints)))
    for name, (count, X_JL) in chain.places.items():
        if count == len(chain.joints) - 1 and name in hulls:
            centre = (frames[-1].inverse() @ frames[count] @ X_JL).apply(hulls[name].mean(axis=0))
            if centre[2] > HULL_MARGIN:
                message = (
                    f'the z axis of the flange of the model {path.name} points back to the link "{name}"'
                )
                yield ("arm", "flange"), f"{message}; turn it by 180 degrees with flange.rotation_deg"
    moving = {name for name, (count, _) in chain.places.items() if count > 1}
    if not moving & hulls.keys():
        message = f"the model {path.name} has no <collision> after its first joint; it would touch nothing"
        yield ("arm", "urdf"), message
    for index, pair in enumerate(arm.self_collision_pairs or ()):
        for link in pair:
            if link not in (*chain.places, TOOL_LINK):
                hint = suggest_choice(link, [*chain.places], "Links of the arm")
                keys = ("arm", "self_collision_pairs", index)
                yield keys, f'the model {path.name} of the arm {arm.arm} has no link "{link}". {hint}'
