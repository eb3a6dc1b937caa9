"""Reach of an arm in its cell: places that it cannot reach, a better place of its base, stops at a touch."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from executive.cell.arm import Goal
from executive.cell.config import CellConfig
from executive.errors import Unreachable
from executive.geometry import Array, make_tool_down_pose, rotate_about_z
from executive.motion.configurations import (
    COARSE_ANGLE_STEP,
    compute_stopping_distance,
    find_configuration_pairs,
)
from executive.motion.joints import JointLimits, Kinematics, build_planning_kinematics
from executive.text.validate import KeyPath

WORKSPACE = "the workspace"
"""Name of the workspace in messages."""
POINTS_PER_SIDE = 5
"""Number of points along each side of the workspace that the tool must reach."""
RADIUS_STEP = 0.02
"""Distance between the distances from the base at which the reach is computed [m]."""
MAX_RADIUS = 1.6
"""Largest of these distances [m]; no arm for a table reaches farther."""
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
    xs, ys = (np.linspace(*side, POINTS_PER_SIDE) for side in (config.table.x, config.table.y))
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
    q_start = np.zeros(config.arm.joint_count)
    advice = ""
    for place in list_places(config):
        errors = []
        for x, y in place.points.tolist():
            try:
                find_configuration_pairs(kinematics, Goal((x, y, place.height)), place.length, q_start)
            except Unreachable as error:
                errors.append(error)
        if errors:
            advice = advice or f"; {measure_reach(config, kinematics).advise()}"
            share = len(errors) / len(place.points)
            part = f" ({share:.0%} of it)" if share < 1 else ""
            yield place.key_path, f"{place.name} is out of reach{part}: {errors[0]}{advice}"


class Reach(NamedTuple):
    """Reach of an arm in its cell.

    Attributes:
        fractions: Reachable fraction of each place of the cell, by name.
        best_base: Nearest place of the base with the largest fractions: x, y `(2,)` [m].
        best_fractions: Reachable fractions with the base there.
        radii: Distances `(N,)` [m] from the base at which the tool reaches down to the workspace.
    """

    fractions: dict[str, float]
    best_base: Array
    best_fractions: dict[str, float]
    radii: Array

    def advise(self) -> str:
        """Return a clause for messages: what the arm reaches from the best place of its base."""
        if sum(self.best_fractions.values()) <= sum(self.fractions.values()):
            return "no other place of the base is better"
        x, y = self.best_base.round(3).tolist()
        parts = [f"{value:.0%} of {name}" for name, value in self.best_fractions.items() if value < 1]
        reached = f"only {' and '.join(parts)}, and all of the rest" if parts else "everything"
        return f"with arm.base.position [{x:g}, {y:g}, ...], it reaches {reached}"


def measure_reach(config: CellConfig, kinematics: Kinematics) -> Reach:
    """Return the reach of an arm; the turn of its first joint is assumed to be free."""
    places = list_places(config)
    radii = RADIUS_STEP * np.arange(1, round(MAX_RADIUS / RADIUS_STEP), dtype=float)
    descents = {(place.height, place.length) for place in places}
    masks = {each: _find_reachable_radii(config, kinematics, radii, *each) for each in descents}

    def compute_fractions(base: Array) -> dict[str, float]:
        fractions = {}
        for place in places:
            distances = np.linalg.norm(place.points - base, axis=1)
            indices = np.round(distances / RADIUS_STEP).astype(int) - 1
            mask = np.append(masks[place.height, place.length], False)  # for all larger distances
            fractions[place.name] = float(mask[indices.clip(0, len(radii))].mean())
        return fractions

    base = np.array(config.arm.base.position[:2])
    shifts = [np.array([dx, dy]) for dx in BASE_SHIFTS for dy in BASE_SHIFTS]
    shifts.sort(key=lambda shift: float(np.linalg.norm(shift)))
    bases = [base + shift for shift in shifts if _is_free(config, base + shift)]
    best = max(bases or [base], key=lambda each: round(sum(compute_fractions(each).values()), 6))
    workspace_mask = masks[places[0].height, places[0].length]
    return Reach(compute_fractions(base), best, compute_fractions(best), radii[workspace_mask])


def _find_reachable_radii(
    config: CellConfig, kinematics: Kinematics, radii: Array, height: float, length: float
) -> NDArray[np.bool_]:
    """Return the mask `(N,)` of the distances `(N,)` [m] from the base at which the tool can descend."""
    base = config.arm.base
    direction = rotate_about_z(math.radians(base.yaw_deg))[:2, 0]
    q_start = np.zeros(config.arm.joint_count)
    mask = np.zeros(len(radii), dtype=bool)
    for index, radius in enumerate(radii.tolist()):
        x, y = np.array(base.position[:2]) + radius * direction
        poses = [make_tool_down_pose((x, y, z)) for z in (height + length, height)]
        try:
            (upper_qs, lower_qs), _ = kinematics.solve_all(poses, q_start, COARSE_ANGLE_STEP)
        except Unreachable:
            continue
        # The last joint is free, and the first joint turns to the place.
        free_joints = [0, len(q_start) - 1]
        upper_qs[:, free_joints] = lower_qs[:, free_joints] = kinematics.joint_range.lower[free_joints]
        is_inside = kinematics.joint_range.contains(upper_qs) & kinematics.joint_range.contains(lower_qs)
        mask[index] = is_inside.any()
    return mask


def _is_free(config: CellConfig, base: Array) -> bool:
    """Return True if a base at a position `(2,)` [m] stands neither in the workspace nor in a bin."""
    low, high = np.array([config.table.x, config.table.y]).T
    areas = [(low, high)]
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
