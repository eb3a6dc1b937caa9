"""Report about an arm in a cell, from its URDF: joints, solver, reach, self-collisions, proposed poses."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.arms.urdf import JointChain, propose_flange, read_chain
from executive.cell.arm import Goal, Task
from executive.cell.arm_config import ArmConfig, ArmFile, BaseConfig
from executive.cell.config import CellConfig
from executive.errors import Blocked, InputError, Unreachable
from executive.geometry import Array
from executive.manipulation.tool_goals import make_slot_goal
from executive.motion.configurations import find_configuration_pairs
from executive.motion.joints import Kinematics, build_planning_kinematics, wrap_angles
from executive.motion.planner import Planner
from executive.motion.reach import POINTS_PER_SIDE, WORKSPACE, Reach, format_bin, list_places, measure_reach
from executive.station.camera import CellCamera, Robot
from executive.station.check import StillRobot, find_payload_errors
from executive.text.validate import join_keys

PROPOSED_LIMITS: Mapping[str, str | float] = {
    "source": "Position, velocity and effort: the URDF. Acceleration: 5 rad/s², cautious for arms of this "
    "size; replace it by the value of the data sheet. Jerk: ten times the acceleration. Braking: 1.2 times "
    "the acceleration, and twice the jerk.",
    "acceleration": 5.0,
    "jerk": 50.0,
    "stop_acceleration": 6.0,
    "stop_jerk": 100.0,
}
"""Limits of a new arm file [rad/s², rad/s³], which the torques of the arms UR5e, xArm6 and Panda permit."""
COMPARED_POSE_COUNT = 40
"""Number of tool poses for which an analytic solver is compared with the numerical one."""
POSE_GRID = (np.linspace(-0.1, 0.7, 9), np.linspace(-0.6, 0.6, 13), (0.05, 0.2, 0.35))
"""Positions of the tool for proposed poses: x and y from the base, z from the travel height [m]."""
TURN_WEIGHT = 1e-3
"""Weight of the largest joint position: of equally good configurations, the least turned one is best."""
MAX_CONFIGURATION_CHANGE = 1.2
"""Maximum difference of a joint, except the first and the last one, between similar configurations [rad]."""
JACOBIAN_STEP = 1e-5
"""Step of a joint for a numerical derivative [rad]."""
PIXELS_PER_METRE = 400
"""Resolution of the picture of the reach."""
DARK = (40, 40, 40)
"""Colour of lines and texts in the picture of the reach."""


@dataclass(frozen=True, eq=False)
class ArmReport:
    """What the URDF of an arm means in a cell.

    Attributes:
        config: The cell with the arm.
        chain: Joints of the arm.
        solver: Name of the solver, and how many poses it reaches, compared with the numerical search.
        reach: Reach of the arm.
        pairs: Names of the links that can collide with each other.
        poses_deg: Proposed joint positions by name [degree]: `home`, and `aside` on the other side.
        problems: Errors of the arm in the cell, without those about poses.
    """

    config: CellConfig
    chain: JointChain
    solver: str
    reach: Reach
    pairs: Sequence[tuple[str, str]]
    poses_deg: dict[str, list[float]]
    problems: Sequence[str]


def propose_arm(urdf: str, name: str, flange_link: str = "") -> dict[str, Any]:
    """Return the content of an arm file for a URDF, with cautious accelerations.

    Raises:
        InputError: The URDF describes no arm; the message names the link or joint.
    """
    flange = propose_flange(urdf, flange_link)
    flange_entry: dict[str, Any] = {"link": flange.link}
    if any(flange.rotation_deg):
        flange_entry["rotation_deg"] = [round(angle) for angle in flange.rotation_deg]
    return {"arm": name, "urdf": urdf, "flange": flange_entry, "limits": dict(PROPOSED_LIMITS)}


def place_arm(cell: CellConfig, arm: ArmFile, base: BaseConfig) -> CellConfig:
    """Return a cell with another arm, whose only pose is the middle of its joint ranges."""
    middle = tuple((lower + upper) / 2 for lower, upper in arm.limits.position_ranges_deg)
    content = {**arm.model_dump(), "base": base, "poses_deg": {"home": middle}}
    return cell.model_copy(update={"arm": ArmConfig.model_validate(content)})


def report_arm(config: CellConfig) -> ArmReport:
    """Return the report about the arm of a cell; existing poses do not count.

    Raises:
        InputError: The model of the arm is invalid.
    """
    from executive.physics.arm_model import find_arm_model_errors
    from executive.physics.collision import ClearanceChecker

    if model_errors := list(find_arm_model_errors(config.arm)):
        raise InputError("\n".join(f"{join_keys(keys)}: {message}" for keys, message in model_errors))
    chain = read_chain(config.arm.urdf, config.arm.flange)
    kinematics = build_planning_kinematics(config)
    reach = measure_reach(config, kinematics)
    with contextlib.closing(ClearanceChecker(config)) as checker:
        poses_deg = propose_poses(config, kinematics, checker)
        get_name = checker.world.get_link_name
        pairs = [(get_name(a), get_name(b)) for a, b in checker.self_collision_pairs]
        problems = [message for _, message in find_payload_errors(config, checker.world, poses_deg)]
    if not poses_deg:
        problems.append("no pose keeps the arm clear of everything and out of the view of the camera")
    solver = _describe_solver(config, kinematics)
    return ArmReport(config, chain, solver, reach, pairs, poses_deg, problems)


def propose_poses(config: CellConfig, kinematics: Kinematics, checker: Any) -> dict[str, list[float]]:
    """Return joint positions [degree] with the tool down and the table in view: `home` and `aside`.

    Each pose keeps the margin to everything, and is far from joint limits and singular configurations, `home`
    at positive y, and `aside` at negative y in a similar configuration, because the arm may have no way from
    one configuration to another. Without any such pose, the result is empty.
    """
    robot: Any = StillRobot(config)
    camera = CellCamera(config, robot, Robot(robot, robot), Robot(robot, robot), kinematics)
    lower, upper = np.radians(config.arm.limits.position_ranges_deg).T
    middle = (lower + upper) / 2
    base = np.array(config.arm.base.position)
    best: dict[str, tuple[float, Array]] = {}
    grid = np.array(np.meshgrid(*POSE_GRID)).reshape(3, -1).T.tolist()
    for x, y, z in sorted(grid, key=lambda point: point[1] < 0):
        name = "home" if y >= 0 else "aside"
        goal = Goal((base[0] + x, base[1] + y, config.travel_height + z))
        try:
            qs = find_configuration_pairs(kinematics, goal, 0.0, middle).lower_qs
        except Unreachable:
            continue
        if name == "aside" and "home" in best:
            change = wrap_angles(qs - best["home"][1])[:, 1:-1]
            qs = qs[np.abs(change).max(axis=1) <= MAX_CONFIGURATION_CHANGE]
        if not len(qs):
            continue
        scores = [_rate_configuration(kinematics, each, lower, upper) for each in qs]
        score = max(scores)
        q = qs[int(np.argmax(scores))]
        if score <= best.get(name, (0.0, q))[0] or checker.find_violation(q) is not None:
            continue
        robot.q = q
        if camera.sees_table():
            best[name] = (score, q)
    if "aside" in best:
        best.setdefault("home", best["aside"])
    return {name: np.degrees(best[name][1]).round(1).tolist() for name in ("home", "aside") if name in best}


def find_blocked_motions(config: CellConfig) -> Iterator[str]:
    """Yield a clause for each motion between pose, workspace and bin that the planner does not find.

    An arm may reach all places, but some of them only in configurations between which it has no way.
    """
    planner = Planner(config)
    workspace = list_places(config)[0]
    load = max(config.build_classes().values(), key=lambda each: each.height)
    hold_height = config.tool.get_hold_height(load)
    slots = {
        name: make_slot_goal(bin, 0, hold_height, load.height) for name, bin in config.build_bins().items()
    }
    task = Task(load, config.tool.compute_holding_force(load, config.tool.max_holding_force))
    for pose_name, pose in config.arm.poses_deg.items():
        for x, y in workspace.points[:: POINTS_PER_SIDE - 1].tolist():
            motion = f'from the pose "{pose_name}" to ({x:g}, {y:g}) m'
            goal = Goal((x, y, workspace.height), (), config.motion.descent, config.motion.descent_speed)
            try:
                q = planner.plan(np.radians(pose), goal).end
                for bin_name, slot in slots.items():
                    motion = f'from ({x:g}, {y:g}) m to the bin "{bin_name}"'
                    planner.plan(q, slot, task)
            except (Blocked, Unreachable) as error:
                yield f"there is no motion {motion}: {error}"


def _rate_configuration(kinematics: Kinematics, q: Array, lower: Array, upper: Array) -> float:
    """Return the distance of joint positions `(n,)` [rad] from the limits times that from a singularity.

    The factors are the part of the smallest joint range that is left, and the smallest singular value of the
    Jacobian of the tool's position [m/rad].
    """
    ranges = np.minimum(upper - lower, math.tau)  # A joint that turns all round has no limits.
    room = float((np.minimum(q - lower, upper - q) / ranges).min())
    tcps, _ = kinematics.compute_tcps_and_axes(np.vstack([q, q + JACOBIAN_STEP * np.eye(len(q))]))
    jacobian = (tcps[1:] - tcps[0]) / JACOBIAN_STEP
    distance = room * float(np.linalg.svd(jacobian, compute_uv=False).min())
    return distance - TURN_WEIGHT * float(np.abs(q).max())


def _describe_solver(config: CellConfig, kinematics: Kinematics) -> str:
    """Return the name of the solver; of an analytic one, with its coverage against the numerical search."""
    name = str(getattr(kinematics, "solver_name", config.arm.solver))
    if name == "numeric":
        return name
    numeric_arm = config.arm.model_copy(update={"solver": "numeric"})
    numeric = build_planning_kinematics(config.model_copy(update={"arm": numeric_arm}))
    base = np.array(config.arm.base.position)
    rng = np.random.default_rng(0)
    counts = {kinematics: 0, numeric: 0}
    for _ in range(COMPARED_POSE_COUNT):
        x, y, z = (base + rng.uniform((0.2, -0.5, 0.05), (0.8, 0.5, 0.4))).tolist()
        for solver in counts:
            with contextlib.suppress(Unreachable):
                find_configuration_pairs(solver, Goal((x, y, z)), 0.0, np.zeros(config.arm.joint_count))
                counts[solver] += 1
    numbers = f"{counts[kinematics]} of {COMPARED_POSE_COUNT} poses (numerical search: {counts[numeric]})"
    return f"{name}, which reaches {numbers}"


def draw_reach(report: ArmReport) -> NDArray[np.uint8]:
    """Return a picture `(H, W, 3)`, RGB, of the cell from above: reach, workspace, bins and bases."""
    config = report.config
    low = np.array([-0.5, -0.9])
    size = np.array([1.5, 1.8])
    height = int(size[0] * PIXELS_PER_METRE)
    width = int(size[1] * PIXELS_PER_METRE)
    image = np.full((height, width, 3), 255, np.uint8)

    def to_pixel(point: Sequence[float] | Array) -> tuple[int, int]:
        """Return column and row: x points up and y to the left, as seen from the base."""
        offset = (np.asarray(point)[:2] - low) * PIXELS_PER_METRE
        return width - int(offset[1]), height - int(offset[0])

    rows, columns = np.mgrid[:height, :width]
    points = np.stack([height - rows, width - columns], axis=-1) / PIXELS_PER_METRE + low
    image[report.reach.is_reached(points)] = (214, 236, 214)

    def write(text: str, point: Sequence[float] | Array) -> None:
        column, row = to_pixel(point)
        cv2.putText(image, text, (column + 10, row), cv2.FONT_HERSHEY_SIMPLEX, 0.45, DARK, 1, cv2.LINE_AA)

    table = np.array([config.table.x, config.table.y])
    cv2.rectangle(image, to_pixel(table[:, 0]), to_pixel(table[:, 1]), DARK, 2)
    write(f"workspace {report.reach.fractions[WORKSPACE]:.0%}", (table[0, 0], table[1, 1]))
    for name, bin in config.bins.items():
        centre = np.array(bin.position[:2])
        half = np.array(bin.size[:2]) / 2
        colour = [int(255 * value) for value in bin.colour]
        cv2.rectangle(image, to_pixel(centre - half), to_pixel(centre + half), colour, 2)
        write(f"{name} {report.reach.fractions[format_bin(name)]:.0%}", (centre[0], centre[1] + half[1]))
    base = config.arm.base.position
    best_base = report.reach.best_base.position
    if best_base != base:
        cv2.circle(image, to_pixel(best_base), 8, DARK, 2)
        write("best base", best_base)
    cv2.circle(image, to_pixel(base), 8, DARK, -1)
    write(f"base of {config.arm.arm} (green: in reach)", base)
    return image
