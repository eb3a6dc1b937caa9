"""Arms that nobody has prepared: each URDF below some folders becomes the arm of a cell and plans a motion.

The benchmark does what a user would do: it writes an arm file, chooses the flange, places the base before the
table, and searches a home pose above the middle of the table. A folder that belongs to no installed Python
package is linked beside the arm file.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from time import process_time
from xml.etree.ElementTree import Element

import numpy as np
import yaml

from executive.arms.urdf import MOVABLE_KINDS, WrongFlange, find_package_folder, read_chain, read_robot
from executive.cell.arm import Goal
from executive.cell.arm_config import FlangeConfig
from executive.cell.config import CellConfig
from executive.errors import Blocked, ExecutiveError, InputError, Unreachable
from executive.geometry import Array
from executive.mission.cell_file import load_cell
from executive.motion.configurations import find_configuration_pairs
from executive.motion.joints import build_planning_kinematics
from executive.motion.planner import Planner
from executive.physics.arm_model import HULL_MARGIN, find_arm_model_errors, read_hulls
from executive.physics.collision import ClearanceChecker
from tests.benchmarks.report import Figures, run_command, show_progress

MIN_JOINT_COUNT = 4
"""Minimum number of joints of an arm; shorter chains are fingers."""
HAND = re.compile("grip|finger|jaw|hand|knuckle|thumb", re.IGNORECASE)
"""Part of the names of the joints of a hand."""
REACH_FRACTION = 0.55
"""Distance from the base to the middle of the table, relative to the reach of the arm."""
MIDDLE = (0.53, 0.0)
"""Middle of the table of the cell [m]."""
BASE_HEIGHTS = (0.0, 0.25)
"""Heights of the base over the table [m]: small arms stand on a pedestal."""
HOME_HEIGHTS = (0.3, 0.25, 0.2, 0.15)
"""Heights of the tool in the home pose [m]; the first one with a pose is used."""
GOAL = (0.05, -0.08, 0.08)
"""Goal of the motion relative to the middle of the table [m]."""
LIMITS = {"source": "assumed", "acceleration": 5, "jerk": 50, "stop_acceleration": 6, "stop_jerk": 100}
"""Limits that a URDF does not contain."""


def measure(folders: Sequence[Path], only: str = ".") -> Figures:
    """Plan a motion with the arm of each URDF below FOLDERS whose path matches the expression `--only`."""
    rows = []
    problems = []
    paths = sorted(path for folder in folders for path in folder.resolve().rglob("*.urdf"))
    for path in show_progress([path for path in paths if re.search(only, str(path))], "foreign arms"):
        start = process_time()
        row: Figures = {"urdf": path.name, "flange": "", "joints": 0, "duration [s]": None}
        with tempfile.TemporaryDirectory() as project:
            try:
                result = try_arm(path, _find_root(path, folders), Path(project), row)
            except ExecutiveError as error:
                result = str(error).partition("\n")[0].rpartition("]: ")[2]
            except Exception as error:  # An error of another class is a fault of the project.
                result = f"{type(error).__name__}: {error}"
                problems.append(f"{path.name}: {result}")
        rows.append(row | {"CPU time [s]": process_time() - start, "result": result})
    counts = {"urdfs": len(rows), "work": sum(row["result"] == "works" for row in rows)}
    return {**counts, "arms": rows, "problems": problems}


def _find_root(path: Path, folders: Sequence[Path]) -> Path:
    """Return the folder that contains a URDF."""
    return next(folder.resolve() for folder in folders if path.is_relative_to(folder.resolve()))


def try_arm(urdf: Path, root: Path, project: Path, row: Figures) -> str:
    """Return "works" if the arm of a URDF plans a motion in a cell, and complete its row.

    Raises:
        ExecutiveError: The message of the executive, if the arm does not work.
    """
    flange = choose_flange(urdf)
    chain = read_chain(str(urdf), flange)
    row |= {"flange": flange.link, "joints": len(chain.joints)}
    installed = {each: find_package_folder(each.name) for each in urdf.parents}
    package = next((each for each, found in installed.items() if found and found.resolve() == each), None)
    if package:
        name = f"package:{package.name}/{urdf.relative_to(package)}"
    else:
        name = f"{root.name}/{urdf.relative_to(root)}"
        shutil.copytree(root, project / "arms" / root.name, copy_function=_link)
    arm = {"arm": urdf.stem, "urdf": name, "flange": flange.model_dump(mode="json"), "limits": LIMITS}
    (project / "arms").mkdir(exist_ok=True)
    (project / "arms" / "arm.yaml").write_text(yaml.safe_dump(arm))
    poses = {"home": [0.0] * len(chain.joints), "aside": [0.0] * len(chain.joints)}
    cell = {
        "base": "cells/overhead.yaml",
        "cell": "foreign",
        "arm": {"file": "arms/arm.yaml", "poses_deg": poses},
    }
    path = project / "foreign.yaml"
    path.write_text(yaml.safe_dump(cell))
    x = max(0.0, MIDDLE[0] - REACH_FRACTION * chain.reach)
    errors: list[ExecutiveError] = []
    for z in BASE_HEIGHTS:
        config = load_cell(path, {"cell.arm.base": f"{{position: [{x}, 0, {z}]}}"})
        for _, message in find_arm_model_errors(config.arm):
            raise InputError(message)
        with contextlib.closing(ClearanceChecker(config)) as checker:
            try:
                home = find_home(config, checker)
            except ExecutiveError as error:
                errors.append(error)
                continue
            planner = Planner(config, checker.check)
            goal = np.add((*MIDDLE, 0.0), GOAL)
            motion = planner.plan(home, Goal(tuple(goal.tolist())))
            break
    else:
        raise errors[0]
    row["duration [s]"] = motion.duration
    end = planner.kinematics.compute_tool_pose(motion.state_at(motion.duration).q)
    distance = float(np.linalg.norm(end.position - goal))
    return "works" if distance < 1e-4 else f"the motion ends {distance:.4f} m beside its goal"


def _link(source: str, target: str) -> None:
    """Make a hard link of a file, or copy the file from another file system."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def choose_flange(urdf: Path) -> FlangeConfig:
    """Return the flange of an arm: the first link after its last joint whose z axis is the axis of the joint.

    Raises:
        InputError: The URDF has no arm, several arms, or is invalid.
    """
    robot = read_robot(urdf)
    joints_by_parent: dict[str, list[Element]] = {}
    for joint in robot.findall("joint"):
        joints_by_parent.setdefault(_get_link(joint, "parent"), []).append(joint)
    children = {_get_link(joint, "child") for joint in robot.findall("joint")}
    links = [link.get("name", "") for link in robot.findall("link")]
    if not (roots := [link for link in links if link not in children]):
        raise InputError(f"the model {urdf.name} has no link that is no child of a joint")
    root = roots[0]
    chains = [chain for chain in _list_chains(joints_by_parent, root, ()) if len(chain) >= MIN_JOINT_COUNT]
    if not chains:
        raise InputError(
            f"the model {urdf.name} has no chain of {MIN_JOINT_COUNT} revolute joints from {root}"
        )
    arm = [joints[0] for joints in itertools.takewhile(_are_equal, zip(*chains, strict=False))]
    if len(arm) < MIN_JOINT_COUNT:
        raise InputError(f"the model {urdf.name} has {len(chains)} chains of joints from {root}, not one arm")
    last_link = _get_link(arm[-1], "child")
    links = [last_link]
    for link in links:  # The loop goes on with the links that it appends.
        joints = joints_by_parent.get(link, [])
        links += [_get_link(joint, "child") for joint in joints if joint.get("type") == "fixed"]
    for link in sorted(links, key=lambda name: not re.search("tool0|flange|ee|tcp|link_?8", name)):
        with contextlib.suppress(WrongFlange):
            return _measure_flange(urdf, FlangeConfig(link=link))
    return _measure_flange(urdf, FlangeConfig(link=last_link, rotation_deg=_align(urdf, arm[-1])))


def _are_equal(joints: Sequence[Element]) -> bool:
    return all(joint is joints[0] for joint in joints)


def _list_chains(
    joints_by_parent: Mapping[str, Sequence[Element]], link: str, chain: tuple[Element, ...]
) -> Iterator[tuple[Element, ...]]:
    """Yield the revolute joints up to each last link, or up to the first joint of another type or a hand."""
    joints = joints_by_parent.get(link, [])
    if not joints:
        yield chain
    for joint in joints:
        kind = joint.get("type")
        is_hand = HAND.search(joint.get("name", "")) or joint.find("mimic") is not None
        if kind == "fixed":
            yield from _list_chains(joints_by_parent, _get_link(joint, "child"), chain)
        elif kind in MOVABLE_KINDS and not is_hand:
            yield from _list_chains(joints_by_parent, _get_link(joint, "child"), (*chain, joint))
        else:
            yield chain


def _get_link(joint: Element, role: str) -> str:
    return next((element.get("link", "") for element in joint.findall(role)), "")


def _align(urdf: Path, joint: Element) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [degree] of a frame whose z axis is the axis of a joint."""
    axis = next((element.get("xyz", "1 0 0") for element in joint.findall("axis")), "1 0 0")
    x, y, z = np.array([float(number) for number in axis.split()])
    pitch = math.degrees(math.atan2(math.hypot(x, y), z))
    return (0.0, pitch, math.degrees(math.atan2(y, x)) if pitch else 0.0)


def _measure_flange(urdf: Path, flange: FlangeConfig) -> FlangeConfig:
    """Return a flange whose z axis points out of the arm, and whose tool begins where the last link ends."""
    chain = read_chain(str(urdf), flange)
    places = {link: X_nL for link, (count, X_nL) in chain.places.items() if count == len(chain.joints)}
    hulls = read_hulls(str(urdf), flange)
    points = [places[link].apply(hulls[link]) for link in places if link in hulls]
    corners = np.concatenate([*points, np.zeros((1, 3))])
    offset = chain.offsets[-1]  # from the last joint but one, at which the hand begins
    direction = corners[:, 2].mean() + offset.position @ offset.rotation[:, 2]
    is_inward = direction * chain.X_nF.rotation[2, 2] < 0
    heights = chain.X_nF.inverse().apply(corners)[:, 2] * (-1 if is_inward else 1)
    roll, pitch, yaw = flange.rotation_deg
    return FlangeConfig(
        link=flange.link,
        rotation_deg=(roll + 180.0 * is_inward, pitch, yaw),
        offset=round(max(0.0, float(heights.max()) - HULL_MARGIN), 4),
    )


def find_home(config: CellConfig, checker: ClearanceChecker) -> Array:
    """Return joint positions `(n,)` [rad] without a collision, with the tool above the middle of the table.

    Raises:
        ExecutiveError: There are none.
    """
    kinematics = build_planning_kinematics(config)
    lower, upper = np.radians(config.arm.limits.position_ranges_deg).T
    error: ExecutiveError | None = None
    for height in HOME_HEIGHTS:
        try:
            pairs = find_configuration_pairs(kinematics, Goal((*MIDDLE, height)), 0.0, (lower + upper) / 2)
        except Unreachable as unreachable:
            error = error or unreachable
            continue
        for q in pairs.lower_qs:
            violation = checker.find_violation(q)
            if violation is None:
                return np.asarray(q)
            error = Blocked(f"the home pose would bring {violation}")
    raise error or Blocked("there is no home pose")


if __name__ == "__main__":
    run_command(measure)
