"""Kinematics of the arm of a cell, by the solver that the arm file names, and the check of the reach."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from executive.cell.arm import Goal
from executive.cell.arm_config import ArmFile
from executive.cell.config import CellConfig
from executive.errors import InputError, Unreachable
from executive.geometry import Array
from executive.motion.configurations import find_configuration_pairs
from executive.motion.joints import Kinematics
from executive.plugins import list_entries
from executive.text.findings import suggest_choice
from executive.text.validate import KeyPath

IK_SOLVER_GROUP = "executive.ik_solvers"
"""Group of the entry points of the solvers that an arm file can name."""
SAMPLING_MARGIN = 0.001
"""Addition to the margin of the cell, because only samples of a motion are checked [m]."""


class KinematicsFactory(Protocol):
    """A solver: function or class that builds the kinematics of an arm."""

    def __call__(
        self, arm: ArmFile, tool_length: float, min_link_distance: float | None = None
    ) -> Kinematics:
        """Return the kinematics of an arm with a tool.

        Args:
            arm: The arm file.
            tool_length: Distance from the flange to the tool centre point [m].
            min_link_distance: Minimum distance between links of the wrist [m], which may make the range of
                the joints narrower than the limits, or None.

        Raises:
            InputError: The solver cannot solve this arm.
        """


def find_arm_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key and the message of an error if the solver is not installed or cannot solve the arm."""
    try:
        build_kinematics(config)
    except InputError as error:
        yield ("arm", "solver"), str(error)


def build_kinematics(config: CellConfig, min_link_distance: float | None = None) -> Kinematics:
    """Return the kinematics of the arm of a cell file, with a minimum distance [m] between its links.

    Raises:
        InputError: The solver is not installed, or cannot solve the arm.
    """
    arm = config.arm
    solvers = list_entries(IK_SOLVER_GROUP, "solver")
    if arm.solver not in solvers:
        hint = suggest_choice(arm.solver, solvers, "Installed solvers")
        raise InputError(f'the solver "{arm.solver}" of the arm {arm.arm} is not installed. {hint}')
    factory: KinematicsFactory = solvers[arm.solver].load()
    return factory(arm, config.tool.length, min_link_distance)


def build_planning_kinematics(config: CellConfig) -> Kinematics:
    """Return the kinematics of the arm of a cell file, whose links keep the margin of planned motions."""
    return build_kinematics(config, config.motion.margin + SAMPLING_MARGIN)


def find_places_out_of_reach(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each place or named pose of the cell file that the arm cannot reach.

    The tool must reach each slot of each bin and the safe place, from travel height down to the release
    height in one inverse kinematics branch. Each named pose must be within the joint limits.
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
    places: list[tuple[KeyPath, str, Array, float]] = [
        (("bins", name, "position"), f'the bin "{name}"', bin.build_bin(name).slots, bin.position[2])
        for name, bin in config.bins.items()
    ]
    safe_position = np.array([config.safe_place[:2]])
    places.append((("safe_place",), "the safe place", safe_position, config.safe_place[2]))
    for key_path, place_name, positions, surface_height in places:
        height = surface_height + config.max_hold_height
        approach_height = max(0.0, config.travel_height - height)
        try:
            for x, y in positions.tolist():
                find_configuration_pairs(kinematics, Goal((x, y, height)), approach_height, q_start)
        except Unreachable as error:
            yield key_path, f"{place_name} is out of reach: {error}"
