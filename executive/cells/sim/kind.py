"""Checks of the cell file of a simulated cell, without the modules that only a run needs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from executive.cell.config import CellConfig
from executive.cell.protocols import Routes
from executive.cell.workcell import CellOptions, KeyPath, Workcell
from executive.cells.sim.models import compute_mass, find_model_errors
from executive.cells.sim.object_positions import find_object_count_errors
from executive.cells.sim.poses import find_pose_errors
from executive.events import Emit
from executive.motion.arms import find_arm_errors, find_places_out_of_reach
from executive.perception.detectors.detector_registry import find_detectable_labels, find_detector_errors


class SimCellChecks:
    """Checks of a cell file; base class of the simulated cell and of its kind."""

    compute_mass = staticmethod(compute_mass)

    @staticmethod
    def check(config: CellConfig, cell_folder: Path) -> Iterable[tuple[KeyPath, str]]:
        """Return key and message of each requirement of a cell file that the simulated cell cannot fulfil.

        The requirements concern the arm and its reach, the models, the detectors, the room for the objects,
        the clearance of the poses, and the view of the cameras.
        """
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

    @staticmethod
    def labels(config: CellConfig, cell_folder: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return the classes that each detector knows, or None if unknown; no detector model is loaded."""
        return find_detectable_labels(config.detectors, cell_folder)


class SimCellKind(SimCellChecks):
    """The kind of the simulated cells; implements `executive.cell.workcell.CellKind`."""

    def __call__(
        self, config: CellConfig, *, seed: int, routes: Routes, emit: Emit, options: CellOptions
    ) -> Workcell:
        """Return a simulated cell."""
        # A check of a mission needs neither the simulator's arm and camera nor the ledger.
        from executive.cells.sim.cell import SimCell

        return SimCell(config, seed=seed, routes=routes, emit=emit, options=options)


SIM_CELL_KIND = SimCellKind()
"""Object of the entry point."""


def find_missing_depth_sensors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each camera without a depth sensor if the cell localizes by depth."""
    for name, camera in config.cameras.items():
        if config.localization == "depth" and camera.depth is None:
            message = f'localization "depth" needs a camera with depth, and {name} has none; give it a '
            yield ("localization",), message + 'section "depth: {}", or use "plane"'
