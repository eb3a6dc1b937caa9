"""Arm in a URDF: the chain of joints from the base to the flange, with limits and the places of the links.

Model files are named by a path beside the file that names them, by `package:NAME/path` for a file in an
installed Python package, or by a path in the folder of pybullet_data.
"""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from executive.cell.arm_config import FlangeConfig
from executive.errors import InputError
from executive.geometry import Array, Pose, rotate_about_z
from executive.plugins import PACKAGE_PREFIX, find_package_file, find_package_folder
from executive.text.findings import suggest_choice

DEFAULT_PACKAGE = "pybullet_data"
"""Package in whose folder a model without a package is searched."""
MAX_MODEL_SIZE = 20_000_000
"""Maximum size of a model file [byte], to limit the duration of the check."""
MOVABLE_KINDS = ("revolute", "continuous")
"""Types of the joints of an arm."""
MAX_AXIS_ANGLE = 1e-3
"""Maximum angle between the axis of the last joint and the z axis of the flange [rad]."""
MAX_AXIS_DISTANCE = 1e-4
"""Maximum distance between the axis of the last joint and the origin of the flange [m]."""
MAX_JOINT_POSITION = 4 * math.pi
"""Maximum limit of a joint position [rad]: two revolutions; a larger limit is in degrees."""
MAX_LINK_LENGTH = 5.0
"""Maximum distance between two joints of an arm [m]; a larger distance is in millimetres."""
MAX_LINK_COUNT = 80
"""Maximum number of links of an arm, up to the flange: the check of each pair of links takes time."""
MAX_NAME_LENGTH = 200
"""Maximum length of the name of a link or joint [characters]; PyBullet crashes for much longer names."""
ATTACHED_PREFIX = "tool_"
"""Prefix of the names of links and joints of a model that hangs on the link of the tool."""
MAX_DEPTH = 50
"""Maximum number of elements around an element of a URDF; very deep elements exhaust the stack."""
_UNDECLARED_PREFIX = re.compile(r"(?<=[<\s/])(?!xmlns:)[A-Za-z_][\w.-]*:(?=[A-Za-z_][\w.-]*[\s=>/])")
"""Prefix of an element or attribute, as in `drake:acceleration`."""


class WrongFlange(InputError):
    """The URDF has no link with the name of the flange, or its z axis is not the axis of the last joint."""


def find_model(name: str) -> Path:
    """Return the path of a model file, for an absolute path, `package:NAME/path` or a path in pybullet_data.

    Raises:
        InputError: There is no such file or package, or the file is larger than `MAX_MODEL_SIZE`.
    """
    # For an invalid file name, Path.is_file raises an error, but os.path.isfile returns False.
    path = name
    if name.startswith(PACKAGE_PREFIX):
        path = str(find_package_file(name))
    elif not os.path.isabs(name):
        path = os.path.join(find_package_folder(DEFAULT_PACKAGE) or "", name)
    if not os.path.isfile(path):
        raise InputError(f"there is no model {name}, neither beside the cell file nor in pybullet_data")
    if os.path.getsize(path) > MAX_MODEL_SIZE:
        raise InputError(f"the model {name} is larger than {MAX_MODEL_SIZE // 1_000_000} MB")
    return Path(path).resolve()


def read_robot(path: Path) -> Element:
    """Return the root element of a URDF; prefixes without a declaration are left out.

    Raises:
        InputError: The file is no URDF.
    """
    try:
        content = path.read_bytes()
        try:
            root = ElementTree.fromstring(content)
        except ElementTree.ParseError as error:
            if "unbound prefix" not in str(error):
                raise
            root = ElementTree.fromstring(_UNDECLARED_PREFIX.sub("", content.decode("utf-8")))
    except (ElementTree.ParseError, OSError, ValueError, LookupError) as error:
        raise InputError(f"the model {path.name} is no URDF: {error}") from None
    if root.tag != "robot":
        raise InputError(f"the model {path.name} is no URDF: its root is <{root.tag}>, not <robot>")
    if any("xacro}" in element.tag for element in root.iter()):
        raise InputError(f"the model {path.name} is for xacro; run `xacro {path.name} > robot.urdf` first")
    level: list[Element] = [root]
    for _ in range(MAX_DEPTH):
        level = [child for element in level for child in element]
    if level:
        raise InputError(
            f"the model {path.name} is no URDF: <{level[0].tag}> is in over {MAX_DEPTH} elements"
        )
    return root


def describe_place(path: Path, element: Element) -> str:
    """Return the link or joint of a URDF that contains an element, or an equal element, for messages."""
    text = ElementTree.tostring(element)
    for owner in read_robot(path):
        if any(ElementTree.tostring(each) == text for each in owner.iter(element.tag)):
            return f'the {owner.tag} "{owner.get("name", "")}" of the model {path.name}'
    return f"the model {path.name}"


def parse_numbers(
    path: Path, element: Element, key: str, default: tuple[float, ...], minimum: float = -math.inf
) -> tuple[float, ...]:
    """Return the numbers in an attribute of a URDF, or `default` if the attribute is missing.

    Raises:
        InputError: The numbers are not as many finite numbers as in `default`, or not above `minimum`.
    """
    text = element.get(key)
    try:
        numbers = default if text is None else tuple(map(float, text.split()))
    except ValueError:
        numbers = ()
    if len(numbers) != len(default) or not (np.isfinite(numbers) & (np.array(numbers) > minimum)).all():
        problem = f'{describe_place(path, element)} has {key}="{text or ""}" in a <{element.tag}>'
        limit = f" above {minimum:g}" if minimum > -math.inf else ""
        raise InputError(f"{problem}; write {len(default)} finite number(s){limit}")
    return numbers


def make_rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation matrix for the angles in a URDF [rad]: about the fixed axes x, then y, then z."""
    # A permutation of the axes turns a rotation about z into one about x or y.
    about_x = np.roll(rotate_about_z(roll), (1, 1), axis=(0, 1))
    about_y = np.roll(rotate_about_z(pitch), (-1, -1), axis=(0, 1))
    return np.asarray(rotate_about_z(yaw) @ about_y @ about_x)


def read_origin(path: Path, element: Element) -> Pose:
    """Return the pose in the `origin` of an element of a URDF."""
    origin = next(element.iter("origin"), Element("origin"))
    rotation = make_rotation(*parse_numbers(path, origin, "rpy", (0.0, 0.0, 0.0)))
    return Pose(rotation, np.array(parse_numbers(path, origin, "xyz", (0.0, 0.0, 0.0))))


@dataclass(frozen=True, eq=False)
class JointChain:
    """Chain of `n` revolute joints from the base of an arm to the flange.

    The z axis of the frame of each joint is its axis. The frame of the flange is that of `FlangeConfig`.

    Attributes:
        joints: Names of the joints.
        offsets: Pose of each joint at position 0 in the frame of the joint before, or of the base.
        X_nF: Pose of the flange in the frame of the last joint.
        lower, upper: Joint limits in the URDF, `(n,)` each [rad]; ±2π for a joint without limits, and NaN for
            missing limits.
        velocity, effort: Limits in the URDF, `(n,)` each [rad/s] and [Nm], NaN for missing limits.
        places: For each link that belongs to the arm, the number of joints before the link, and the pose of
            the link in the frame of the last of these joints, or of the base.
        left_out: Names of the links that do not belong to the arm: those beyond the flange, and side branches
            with joints, such as a gripper.
    """

    joints: tuple[str, ...]
    offsets: tuple[Pose, ...]
    X_nF: Pose
    lower: Array
    upper: Array
    velocity: Array
    effort: Array
    places: Mapping[str, tuple[int, Pose]]
    left_out: tuple[str, ...]

    def compute_frames(self, q: Array) -> list[Pose]:
        """Return the frames of base, joints and flange in the frame of the base at `q` `(n,)` [rad]."""
        frames = [Pose.identity()]
        for offset, angle in zip(self.offsets, q.tolist(), strict=True):
            X_B = frames[-1] @ offset
            frames.append(Pose(X_B.rotation @ rotate_about_z(angle), X_B.position))
        return [*frames, frames[-1] @ self.X_nF]

    @property
    def reach(self) -> float:
        """Sum of the distances between joints, from the second joint to the flange [m]."""
        return float(sum(np.linalg.norm(X.position) for X in (*self.offsets[2:], self.X_nF)))


def locate_flange(flange: FlangeConfig) -> Pose:
    """Return the pose of the flange in the frame of its link."""
    rotation = make_rotation(*np.radians(flange.rotation_deg))
    return Pose(rotation, flange.offset * rotation[:, 2])


@lru_cache(maxsize=16)
def read_chain(urdf: str, flange: FlangeConfig) -> JointChain:
    """Return the chain of joints of an arm.

    Raises:
        InputError: The URDF has no such flange, or no chain of revolute joints that the executive can plan;
            the message names the link or joint.
    """
    path = find_model(urdf)
    robot = read_robot(path)
    name = path.name
    for tag in ("joint", "link"):
        links = Counter(element.get("name", "") for element in robot.findall(tag))
        for each, count in links.items():
            if count > 1 or not 1 <= len(each) <= MAX_NAME_LENGTH:
                problem = f'the model {name} has {count} {tag}(s) with the name "{each}"'
                raise InputError(f"{problem}; each needs its own name of 1 to {MAX_NAME_LENGTH} characters")
    if flange.link not in links:
        hint = suggest_choice(flange.link, links, "Links of the model")
        raise WrongFlange(f'the model {name} has no link "{flange.link}". {hint}')
    joints = _read_joints(path, robot, links)
    elements: list[Element] = []
    link = flange.link
    while link in joints:
        elements.insert(0, joints[link])
        link = _get_link(joints[link], "parent")
        if len(elements) > len(joints):
            raise InputError(f'the model {name} has a loop of joints through the link "{link}"; remove one')
    base = link
    X = Pose.identity()
    offsets: list[Pose] = []
    places = {base: (0, X)}
    moving: list[Element] = []
    for joint in elements:
        X = X @ read_origin(path, joint)
        kind = joint.get("type", "")
        if kind in MOVABLE_KINDS:
            R_axis = _align_z(path, joint)
            offsets.append(Pose(X.rotation @ R_axis, X.position))
            moving.append(joint)
            X = Pose(R_axis.T, np.zeros(3))
            if joint.find("mimic") is not None:
                kind = "moved by another joint (<mimic>)"
        if kind not in (*MOVABLE_KINDS, "fixed"):
            raise InputError(
                f'the joint "{joint.get("name")}" of the model {name} is {kind or "without type"}; '
                f"the joints between base and flange must be revolute, continuous or fixed, each with a motor"
            )
        places[_get_link(joint, "child")] = (len(moving), X)
    if len(moving) < 2:
        problem = f'the model {name} has {len(moving)} joint(s) up to the link "{flange.link}"'
        raise InputError(f"{problem}; an arm has two or more: correct their types, or flange.link")
    for joint_name, offset in zip([j.get("name") for j in moving], offsets, strict=True):
        if (length := float(np.linalg.norm(offset.position))) > MAX_LINK_LENGTH:
            advice = "lengths in a URDF are in metres"
            raise InputError(f'the joint "{joint_name}" of the model {name} is {length:.3g} m away: {advice}')
    left_out = _add_side_branches(path, joints, places, flange.link)
    if len(places) > MAX_LINK_COUNT:
        raise InputError(f"the arm in {name} has {len(places)} links; join them to at most {MAX_LINK_COUNT}")
    X_nF = X @ locate_flange(flange)
    _require_tool_axis(path, flange, moving[-1], X_nF)
    lower, upper, velocity, effort = np.array([_read_limits(path, joint) for joint in moving]).T
    names = tuple(joint.get("name", "") for joint in moving)
    return JointChain(names, tuple(offsets), X_nF, lower, upper, velocity, effort, places, left_out)


def _read_joints(path: Path, robot: Element, links: Collection[str]) -> dict[str, Element]:
    """Return the joints by child link; raise InputError for a joint whose links do not exist."""
    joints: dict[str, Element] = {}
    for joint in robot.findall("joint"):
        for role in ("parent", "child"):
            if (link := _get_link(joint, role)) not in links:
                joint_name = f'the joint "{joint.get("name", "")}" of the model {path.name}'
                problem = f'{joint_name} has the {role} "{link}", which is no link of the model'
                raise InputError(f"{problem}; correct the {role}")
        child = _get_link(joint, "child")
        if child in joints:
            names = f'"{joints[child].get("name")}" and "{joint.get("name")}"'
            raise InputError(f'the link "{child}" of the model {path.name} has two joints before it: {names}')
        joints[child] = joint
    return joints


def _get_link(joint: Element, role: str) -> str:
    """Return the name of the `parent` or `child` link of a joint."""
    element = joint.find(role)
    return "" if element is None else element.get("link", "")


def _add_side_branches(
    path: Path, joints: Mapping[str, Element], places: dict[str, tuple[int, Pose]], flange_link: str
) -> tuple[str, ...]:
    """Add the places of fixed side branches, and return the links of all other branches."""
    children: dict[str, list[str]] = {}
    for child, joint in joints.items():
        children.setdefault(_get_link(joint, "parent"), []).append(child)

    def list_branch(link: str) -> list[str]:
        branch = [link]
        for each in branch:  # The loop goes on with the links that it appends.
            branch += children.get(each, [])
        return branch

    left_out: list[str] = []
    for parent in list(places):
        for child in children.get(parent, []):
            if child in places:
                continue
            branch = list_branch(child)
            if parent == flange_link or any(joints[link].get("type") != "fixed" for link in branch):
                left_out += branch
                continue
            for link in branch:
                count, X = places[_get_link(joints[link], "parent")]
                places[link] = (count, X @ read_origin(path, joints[link]))
    return tuple(left_out)


def _align_z(path: Path, joint: Element) -> Array:
    """Return a rotation `(3, 3)` whose z axis is the axis of a joint."""
    element = joint.find("axis")
    element = Element("axis") if element is None else element
    axis = np.array(parse_numbers(path, element, "xyz", (1.0, 0.0, 0.0)))
    length = float(np.linalg.norm(axis))
    if not 1e-6 < length < 1e6:
        place = f'the joint "{joint.get("name")}" of the model {path.name}'
        raise InputError(f"{place} has the axis {axis}; write its direction, with a length of 1")
    return align_z(axis)


def align_z(axis: Array) -> Array:
    """Return a rotation `(3, 3)` whose z axis has the direction of a vector `(3,)`."""
    z = axis / np.linalg.norm(axis)
    x = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _require_tool_axis(path: Path, flange: FlangeConfig, joint: Element, X_nF: Pose) -> None:
    """Raise InputError unless the axis of the last joint is the z axis of the flange, in either direction."""
    z = X_nF.rotation[:, 2]
    distance = math.hypot(X_nF.position[0], X_nF.position[1])
    if abs(z[2]) > math.cos(MAX_AXIS_ANGLE) and distance < MAX_AXIS_DISTANCE:
        return
    angle = math.degrees(math.acos(float(np.clip(z[2], -1.0, 1.0))))
    raise WrongFlange(
        f'the z axis of the flange "{flange.link}" of the model {path.name} must be the axis of the joint '
        f'"{joint.get("name")}", which turns the tool; it is turned by {angle:.1f} degrees and '
        f"{distance * 1000:.1f} mm away: name another link, or correct flange.rotation_deg"
    )


def _read_limits(path: Path, joint: Element) -> tuple[float, float, float, float]:
    """Return lower and upper position, velocity and effort of a joint, NaN for missing ones."""
    element = joint.find("limit")
    limit = Element("limit") if element is None else element
    values = {
        key: parse_numbers(path, limit, key, (0.0,))[0] if key in limit.attrib else math.nan
        for key in ("lower", "upper", "velocity", "effort")
    }
    lower = values["lower"]
    upper = values["upper"]
    if joint.get("type") == "continuous":
        lower = -math.tau
        upper = math.tau
    elif lower == upper == 0.0:
        lower = math.nan
        upper = math.nan
    place = f'the joint "{joint.get("name")}" of the model {path.name}'
    if max(abs(lower), abs(upper)) > MAX_JOINT_POSITION:
        problem = f"{place} has the limits {lower:g} to {upper:g} rad"
        raise InputError(f"{problem}; angles in a URDF are in radians")
    if lower > upper:
        raise InputError(f"{place} has a lower limit of {lower:g} rad above its upper limit of {upper:g} rad")
    velocity = values["velocity"] if values["velocity"] > 0 else math.nan
    effort = values["effort"] if values["effort"] > 0 else math.nan
    return lower, upper, velocity, effort


FLANGE_ROTATIONS_DEG = ((0, 0, 0), (180, 0, 0), (0, 90, 0), (0, -90, 0), (-90, 0, 0), (90, 0, 0))
"""Rotations from a link to the flange among which one makes z the axis of the last joint [degree]."""


def propose_flange(urdf: str, link: str = "") -> FlangeConfig:
    """Return a flange at a link of a URDF; without a link, at the end of the longest chain of joints.

    A frame without shapes, such as `tool0`, is preferred among the links after the last joint. A chain ends
    before several joints branch off, as in a gripper.

    Raises:
        InputError: The chain has an error, or no link can be the flange; the message names the reason.
    """
    path = find_model(urdf)
    robot = read_robot(path)
    links = {each.get("name", ""): each for each in robot.findall("link")}
    joints = _read_joints(path, robot, list(links))
    moving_parents = [_get_link(joint, "parent") for joint in joints.values() if joint.get("type") != "fixed"]

    def count_joints(end: str) -> int:
        """Return the number of revolute joints from the base to a link, 0 for a branch of a gripper."""
        count = 0
        for _ in joints:
            if end not in joints:
                break
            parent = _get_link(joints[end], "parent")
            if moving_parents.count(parent) > 1:
                return 0
            count += joints[end].get("type") in MOVABLE_KINDS
            end = parent
        return count

    counts = {name: count_joints(name) for name in links}
    longest = [name for name, count in counts.items() if count == max(counts.values(), default=0) > 0]
    longest.sort(key=lambda each: links[each].find("collision") is not None)
    candidates = [link] if link else longest
    errors = [InputError(f"the model {path.name} has no chain of revolute joints without branches")]
    for rotation in FLANGE_ROTATIONS_DEG:
        for each in candidates:
            try:
                flange = FlangeConfig(link=each, rotation_deg=rotation)
                read_chain(urdf, flange)
                return flange
            except InputError as error:
                errors.append(error)
    # A wrong flange may only be the consequence of the rotations that were tried.
    raise next((error for error in errors[1:] if not isinstance(error, WrongFlange)), errors[-1])
