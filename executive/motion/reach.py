"""Reach of an arm in its cell: places that it cannot reach, a better place of its base, stops at a touch."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from executive.cell.arm import Goal
from executive.cell.arm_config import BaseConfig
from executive.cell.config import CellConfig
from executive.errors import Unreachable
from executive.geometry import Array, make_tool_down_pose, rotate_about_z
from executive.motion.configurations import (
    COARSE_ANGLE_STEP,
    MIN_COSINE_ON_LINE,
    compute_stopping_distance,
    find_configuration_pairs,
)
from executive.motion.joints import JointLimits, Kinematics, build_planning_kinematics, wrap_angles
from executive.text.validate import KeyPath

WORKSPACE = "the workspace"
"""Name of the workspace in messages."""
POINTS_PER_SIDE = 5
"""Number of points along each side of the workspace that the tool must reach."""
RADIUS_STEP = 0.02
"""Distance between the distances from the base at which the reach is computed [m]."""
MAX_RADIUS = 1.6
"""Largest of these distances [m]; no arm for a table reaches farther."""
ANGLES = np.radians(np.arange(0, 360, 5))
"""Directions from the axis of the first joint in which the reach is computed [rad]."""
BASE_SHIFTS = np.arange(-0.4, 0.401, 0.02)
"""Shifts of the base along x and y among which a better place is searched [m]."""
BASE_RADIUS = 0.12
"""Radius of the base of an arm [m], which must not stand in the workspace or in a bin."""
MIN_SPEED = 0.001
"""Smallest speed of a descent that a cell file permits [m/s]."""
SPEED_STEP = 0.005
"""Resolution of the advised descent speed [m/s]."""


@dataclass(frozen=True, eq=False)
class Place:
    """A place of a cell that the tool must reach from above.

    Attributes:
        key_path: Key of the place in the cell file.
        name: Name for messages.
        points: Horizontal positions `(N, 2)` [m].
        height: Height of the tool at the end of its descent [m].
        length: Length of the descent [m].
    """

    key_path: KeyPath
    name: str
    points: Array
    height: float
    length: float


def format_bin(name: str) -> str:
    """Return the name of a bin for messages."""
    return f'the bin "{name}"'


def list_places(config: CellConfig) -> list[Place]:
    """Return workspace, bins and safe place of a cell.

    In the workspace, the tool reaches the lowest class; elsewhere, it descends from travel height to the
    height at which it releases the highest load.
    """
    xs = np.linspace(*config.table.x, POINTS_PER_SIDE)
    ys = np.linspace(*config.table.y, POINTS_PER_SIDE)
    workspace = np.array([(x, y) for x in xs for y in ys])
    min_height = min(section.height for section in config.objects.values())
    places = [Place(("table",), WORKSPACE, workspace, min_height, config.motion.descent)]
    surfaces: list[tuple[KeyPath, str, Array, float]] = [
        (("bins", name, "position"), format_bin(name), bin.build_bin(name).slots, bin.position[2])
        for name, bin in config.bins.items()
    ]
    safe_position = np.array([config.safe_place[:2]])
    surfaces.append((("safe_place",), "the safe place", safe_position, config.safe_place[2]))
    for key_path, name, points, surface_height in surfaces:
        height = surface_height + config.max_hold_height
        length = max(0.0, config.travel_height - height)
        places.append(Place(key_path, name, points, height, length))
    return places


def find_places_out_of_reach(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each place or named pose of the cell file that the arm cannot reach.

    The tool must reach each point of each place in one inverse kinematics branch. Each named pose must be
    within the joint limits.
    """
    ranges = config.arm.limits.position_ranges_deg
    for name, pose in config.arm.poses_deg.items():
        for joint, (angle, (lower, upper)) in enumerate(zip(pose, ranges, strict=True), start=1):
            if not lower <= angle <= upper:
                limit = f"{upper:g}" if lower == -upper else f"{lower:g} to {upper:g}"
                message = f'joint {joint} of the pose "{name}" is at {angle:g} degrees; its limit is {limit}'
                yield ("arm", "poses_deg", name), message
    kinematics = build_planning_kinematics(config)
    advice = ""
    for place in list_places(config):
        if errors := _find_unreachable_points(kinematics, place):
            advice = advice or f"; {measure_reach(config, kinematics).advise()}"
            share = len(errors) / len(place.points)
            part = f" ({share:.0%} of it)" if share < 1 else ""
            yield place.key_path, f"{place.name} is out of reach{part}: {errors[0]}{advice}"


def _find_unreachable_points(kinematics: Kinematics, place: Place) -> list[Unreachable]:
    """Return an error for each point of a place at which the tool cannot descend."""
    q_start = np.zeros(len(kinematics.joint_range.lower))
    errors = []
    for x, y in place.points.tolist():
        try:
            find_configuration_pairs(kinematics, Goal((x, y, place.height)), place.length, q_start)
        except Unreachable as error:
            errors.append(error)
    return errors


class Reach(NamedTuple):
    """Reach of an arm in its cell.

    Attributes:
        fractions: Reachable fraction of each place of the cell, by name.
        best_base: Nearest place of the base with the largest fractions.
        best_fractions: Reachable fractions with the base there.
        is_reached: Returns the mask `(...)` of the horizontal positions `(..., 2)` [m] at which the tool
            reaches down to the workspace; false everywhere if the axis of the first joint is not vertical.
    """

    fractions: dict[str, float]
    best_base: BaseConfig
    best_fractions: dict[str, float]
    is_reached: Callable[[Array], NDArray[np.bool_]]

    def advise(self) -> str:
        """Return a clause for messages: what the arm reaches from the best place of its base."""
        if self.best_fractions == self.fractions:
            return "no other place of the base is better"
        x, y, _ = self.best_base.position
        yaw = f" and yaw_deg {self.best_base.yaw_deg:g}" if self.best_base.yaw_deg else ""
        parts = [f"{value:.0%} of {name}" for name, value in self.best_fractions.items() if value < 1]
        reached = f"only {' and '.join(parts)}, and all of the rest" if parts else "everything"
        return f"with arm.base.position [{x:g}, {y:g}, ...]{yaw}, it reaches {reached}"


def measure_reach(config: CellConfig, kinematics: Kinematics) -> Reach:
    """Return the reach of an arm.

    A better place of its base is one from which the first joint can turn to the places of the cell, with the
    yaw of the base, else with a yaw that turns the middle of the range of the joint to the workspace.
    """
    places = list_places(config)
    axis, direction = _find_first_axis(kinematics)
    descents = {(place.height, place.length) for place in places}
    masks = {each: _find_reachable_turns(config, kinematics, axis, direction, *each) for each in descents}

    def find_reached(place: Place, points: Array) -> NDArray[np.bool_]:
        """Return the mask `(...)` of reachable points `(..., 2)` [m], seen from the axis of the joint."""
        mask = masks[place.height, place.length]
        rows = np.round(np.linalg.norm(points, axis=-1) / RADIUS_STEP).astype(int)
        columns = np.round(np.arctan2(points[..., 1], points[..., 0]) / ANGLES[1]).astype(int)
        return np.asarray(mask[rows.clip(1, len(mask)) - 1, columns % len(ANGLES)])

    def rate(move: tuple[float, Array]) -> float:
        turn, shift = move
        rotation = rotate_about_z(turn)[:2, :2]
        reached = [find_reached(place, (place.points - axis - shift) @ rotation) for place in places]
        return round(sum(float(mask.mean()) for mask in reached), 6)

    shifts = [np.array([dx, dy]) for dx in BASE_SHIFTS for dy in BASE_SHIFTS]
    shifts.sort(key=lambda shift: float(np.linalg.norm(shift)))
    moves = [(0.0, shift) for shift in shifts if _is_free(config, axis + shift)] or [(0.0, np.zeros(2))]
    middle = np.angle((masks[places[0].height, places[0].length] @ np.exp(1j * ANGLES)).sum())
    ways = places[0].points.mean(axis=0) - axis - np.array([shift for _, shift in moves])
    azimuths = np.arctan2(ways[:, 1], ways[:, 0])
    turns = ANGLES[1] * np.round(wrap_angles(azimuths - middle) / ANGLES[1])
    moves += [(float(turn), shift) for turn, (_, shift) in zip(turns, moves, strict=True)]
    turn, shift = max(moves, key=rate)
    base = config.arm.base
    position = axis + shift + rotate_about_z(turn)[:2, :2] @ (base.position[:2] - axis)
    yaw = math.degrees(wrap_angles(np.array(math.radians(base.yaw_deg) + turn)))
    best = BaseConfig(position=(*position.round(3).tolist(), base.position[2]), yaw_deg=round(yaw, 3))
    arm = config.arm.model_copy(update={"base": best})
    fractions = _compute_fractions(places, kinematics)
    best_kinematics = build_planning_kinematics(config.model_copy(update={"arm": arm}))
    best_fractions = _compute_fractions(places, best_kinematics)
    if sum(best_fractions.values()) <= sum(fractions.values()):
        best = base
        best_fractions = fractions
    return Reach(fractions, best, best_fractions, lambda points: find_reached(places[0], points - axis))


def _compute_fractions(places: Sequence[Place], kinematics: Kinematics) -> dict[str, float]:
    """Return the reachable fraction of each place, by name."""
    return {
        place.name: 1 - len(_find_unreachable_points(kinematics, place)) / len(place.points)
        for place in places
    }


def _find_first_axis(kinematics: Kinematics) -> tuple[Array, float]:
    """Return the position `(2,)` [m] of the first axis, and its direction: 1.0 up, -1.0 down, 0.0 tilted."""
    qs = np.zeros((3, len(kinematics.joint_range.lower)))
    qs[:, 0] = math.tau / 3 * np.arange(3)
    poses = [kinematics.compute_tool_pose(q) for q in qs]
    turn = poses[1].rotation @ poses[0].rotation.T
    direction = float(np.sign(turn[1, 0])) if turn[2, 2] > MIN_COSINE_ON_LINE else 0.0
    return np.mean([pose.position[:2] for pose in poses], axis=0), direction


def _find_reachable_turns(
    config: CellConfig, kinematics: Kinematics, axis: Array, direction: float, height: float, length: float
) -> NDArray[np.bool_]:
    """Return the mask `(N, A)` of distances and `ANGLES` from the first axis at which the tool can descend.

    The distances are multiples of `RADIUS_STEP` from 1; the last row is for all larger distances.
    """
    mask = np.zeros((round(MAX_RADIUS / RADIUS_STEP), len(ANGLES)), dtype=bool)
    if direction == 0:
        return mask
    # The solutions in one direction are turned to all others, so that the first joint must be free there.
    ranges = ((-360.0, 360.0), *config.arm.limits.position_ranges_deg[1:])
    free_limits = {
        "min_position_deg": tuple(lower for lower, _ in ranges),
        "position_deg": tuple(upper for _, upper in ranges),
    }
    arm = config.arm.model_copy(update={"limits": config.arm.limits.model_copy(update=free_limits)})
    free_kinematics = build_planning_kinematics(config.model_copy(update={"arm": arm}))
    smallest = kinematics.joint_range.lower[0]
    largest = kinematics.joint_range.upper[0]
    q_start = np.zeros(len(ranges))
    for row in range(len(mask) - 1):
        x = axis[0] + RADIUS_STEP * (row + 1)
        poses = [make_tool_down_pose((x, axis[1], z)) for z in (height + length, height)]
        try:
            (upper_qs, lower_qs), _ = free_kinematics.solve_all(poses, q_start, COARSE_ANGLE_STEP)
        except Unreachable:
            continue
        # The last joint is free.
        upper_qs[:, -1] = kinematics.joint_range.lower[-1]
        lower_qs[:, -1] = kinematics.joint_range.lower[-1]
        is_inside = free_kinematics.joint_range.contains(np.array([upper_qs, lower_qs])).all(axis=0)
        first = lower_qs[is_inside, :1]
        change = wrap_angles(upper_qs[is_inside, :1] - first)
        turned = smallest + (first + direction * ANGLES - smallest) % math.tau
        ends = np.array([turned, turned + change])
        mask[row] = ((smallest <= ends) & (ends <= largest)).all(axis=0).any(axis=0)
    return mask


def _is_free(config: CellConfig, base: Array) -> bool:
    """Return True if a base at a position `(2,)` [m] stands neither in the workspace nor in a bin."""
    table = np.array([config.table.x, config.table.y])
    areas = [(table[:, 0], table[:, 1])]
    for bin in config.bins.values():
        centre = np.array(bin.position[:2])
        half_size = np.array(bin.size[:2]) / 2
        areas.append((centre - half_size, centre + half_size))
    gaps = [np.maximum(np.maximum(low - base, base - high), 0.0) for low, high in areas]
    return all(float(np.linalg.norm(gap)) > BASE_RADIUS for gap in gaps)


def find_braking_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield an error if the tool cannot stop within the distance at which it senses a surface."""
    speed = config.motion.descent_speed
    touch_distance = config.tool.touch_distance
    stop_limits = _compute_stop_limits(config)
    if (distance := _compute_braking_distance(speed, stop_limits)) > touch_distance:
        braking = f"at {speed:g} m/s, the arm {config.arm.arm} needs {distance * 1000:.2f} mm to stop"
        sensing = f"the tool senses a surface only {touch_distance * 1000:g} mm before it presses on it"
        advice = f"choose at most {find_fitting_speed(config):g} m/s"
        yield ("motion", "descent_speed"), f"{braking}, but {sensing}; {advice}"


def find_fitting_speed(config: CellConfig) -> float:
    """Return the largest speed of a descent [m/s], up to that of the cell, from which the tool can stop."""
    stop_limits = _compute_stop_limits(config)
    speed = config.motion.descent_speed
    slower_speeds = [MIN_SPEED, *np.arange(SPEED_STEP, speed, SPEED_STEP).round(3).tolist(), speed]
    touch_distance = config.tool.touch_distance
    fitting = [s for s in slower_speeds if _compute_braking_distance(s, stop_limits) <= touch_distance]
    return max(fitting, default=MIN_SPEED)


def _compute_braking_distance(speed: float, stop_limits: Sequence[tuple[float, float]]) -> float:
    return max((compute_stopping_distance(speed, *each) for each in stop_limits), default=0.0)


def _compute_stop_limits(config: CellConfig) -> list[tuple[float, float]]:
    """Return the maximum acceleration [m/s²] and jerk [m/s³] of the braking tool at points of the workspace.

    They are those of the configuration that is nearest to the pose `home`.
    """
    kinematics = build_planning_kinematics(config)
    limits = JointLimits.from_config(config.arm.limits)
    workspace = list_places(config)[0]
    q_start = np.radians(config.arm.poses_deg["home"])
    stop_limits: list[tuple[float, float]] = []
    for x, y in workspace.points.tolist():
        try:
            goal = Goal((x, y, workspace.height))
            pairs = find_configuration_pairs(kinematics, goal, workspace.length, q_start)
        except Unreachable:
            continue  # `find_places_out_of_reach` reports the place.
        nearest = np.argmin(limits.compute_min_time(pairs.upper_qs - q_start))
        # Joint movement per distance of the tool [rad/m].
        rates = np.abs(pairs.upper_qs[nearest] - pairs.lower_qs[nearest]) / workspace.length + 1e-9
        stop_limits.append(
            (float(min(limits.stop_acceleration / rates)), float(min(limits.stop_jerk / rates)))
        )
    return stop_limits
