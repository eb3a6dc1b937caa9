"""Checks of the cell file of a simulated cell, without the modules that only a run needs."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig
from executive.cell.protocols import Routes, StepClock
from executive.cell.workcell import CellOptions, Workcell
from executive.drivers.sim.camera import SimCamera, find_missing_depth_sensors, get_camera_pose
from executive.drivers.sim.collision import ClearanceChecker
from executive.drivers.sim.models import compute_mass, find_model_errors
from executive.drivers.sim.scene import find_object_count_errors
from executive.drivers.sim.world import World
from executive.events import Emit
from executive.geometry import Array
from executive.motion.arms import find_arm_errors, find_places_out_of_reach
from executive.perception.detectors.detector_registry import find_detectable_labels, find_detector_errors
from executive.station.view_check import find_view_errors
from executive.text.validate import KeyPath

POINTS_PER_SIDE = 9
"""Number of positions of the flattest object along each side of the workspace for the check of occlusion."""


def find_pose_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each pose without clearance, and each pose or bin that occludes the table.

    In each named pose, arm and tool must keep the margin to table, bins and the arm itself, because otherwise
    no motion can end in the pose. From each scan pose, the camera must see the whole workspace; a camera with
    partial views must see it from all its scan poses together.
    """
    with contextlib.closing(ClearanceChecker(config)) as checker:
        for name, pose in config.arm.poses_deg.items():
            if violation := checker.find_violation(np.radians(pose)):
                margin = f"the minimum clearance is {config.motion.margin:.3f} m"
                message = f'the pose "{name}" brings {violation}; {margin}'
                yield ("arm", "poses_deg", name), message
        yield from _find_occluding_poses_and_bins(config, checker.world)


def _find_occluding_poses_and_bins(config: CellConfig, world: World) -> Iterator[tuple[KeyPath, str]]:
    camera = SimCamera(world, config, StepClock(lambda: 0.0), seed=0)

    def find_hidden(pose: str, points: Array) -> NDArray[np.bool_]:
        """Return the mask `(N,)` of the points `(N, 3)` [m] at which arm or bins hide an object."""
        world.set_joint_positions(np.radians(config.arm.poses_deg[pose]))
        frame = camera.capture()
        min_height = min(model.height for model in config.objects.values())
        centres = points + np.array([0.0, 0.0, min_height / 2])
        bodies = _find_occluding_bodies(world, centres, frame.X_WC.position)
        return ~frame.compute_unoccluded_mask(centres) | np.isin(bodies, list(world.bin_bodies.values()))

    view_errors = list(find_view_errors(config, find_hidden))
    yield from view_errors
    if view_errors or camera.config.partial_views:
        return
    name = camera.name
    for index, pose in enumerate(camera.scan_poses):
        if pose not in config.arm.poses_deg:
            continue
        world.set_joint_positions(np.radians(config.arm.poses_deg[pose]))
        if not camera.sees_table():
            message = f'in the pose "{pose}" the arm hides a part of the workspace from the camera {name}'
            yield ("cameras", name, "scan_poses", index), message
        elif bin := _find_occluding_bin(config, world, get_camera_pose(world, camera.config).position):
            yield (
                ("bins", bin, "position"),
                f'the bin "{bin}" hides a part of the workspace from the camera {name} in the pose "{pose}"; '
                "move or lower the bin",
            )


def _find_occluding_bodies(world: World, points: Array, camera_position: Array) -> list[int]:
    """Return the body that hides each point `(N, 3)` [m] from the camera; -1 for none."""
    hits = world.client.rayTestBatch(points.tolist(), [tuple(camera_position)] * len(points))
    return [hit[0] for hit in hits]


def _find_occluding_bin(config: CellConfig, world: World, camera_position: Array) -> str | None:
    """Return a bin that occludes the centre of the flattest object somewhere in the workspace, or None."""
    xs, ys = (np.linspace(*side, POINTS_PER_SIDE) for side in (config.table.x, config.table.y))
    height = min(model.height for model in config.objects.values()) / 2
    points = np.array([(x, y, height) for x in xs for y in ys])
    hit_bodies = {*_find_occluding_bodies(world, points, camera_position)}
    return next((name for name, body in world.bin_bodies.items() if body in hit_bodies), None)


class SimCellKind:
    """The kind of the simulated cells; implements `executive.cell.workcell.CellKind`."""

    compute_mass = staticmethod(compute_mass)
    driver_options: ClassVar[Mapping[str, str]] = {"scene": "file", "gui": "flag"}

    def __call__(
        self, config: CellConfig, *, seed: int, routes: Routes, emit: Emit, options: CellOptions
    ) -> Workcell:
        # A check of a mission needs neither the arm nor the ledger, whose import takes 0.3 s.
        from executive.drivers.sim.cell import SimCell

        return SimCell(config, seed=seed, routes=routes, emit=emit, options=options)

    def check(self, config: CellConfig, cell_folder: Path) -> Iterable[tuple[KeyPath, str]]:
        if arm_errors := tuple(find_arm_errors(config)):
            return arm_errors
        model_errors = tuple(find_model_errors(config))
        return (
            *model_errors,
            *find_missing_depth_sensors(config),
            *find_detector_errors(config.detectors, cell_folder),
            *find_places_out_of_reach(config),
            *find_object_count_errors(config),
            # The check of the poses builds a world, which is impossible if a model is missing.
            *(() if model_errors else find_pose_errors(config)),
        )

    def labels(self, config: CellConfig, cell_folder: Path) -> Mapping[str, tuple[str, ...] | None]:
        return find_detectable_labels(config.detectors, cell_folder)


SIM_CELL_KIND = SimCellKind()
"""Object of the entry point."""
