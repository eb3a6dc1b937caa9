"""Checks of a cell file that need the arm, the camera or the detectors, before a station is built."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from executive.cell.config import CellConfig, ObjectConfig
from executive.cell.devices import DriverKind, is_rehearsal, load_driver_kind
from executive.motion.joints import find_arm_errors
from executive.motion.planner import find_places_out_of_reach
from executive.perception.detectors.detector_registry import find_detectable_labels, find_detector_errors
from executive.station.view_check import find_view_errors
from executive.text.validate import KeyPath


@dataclass(frozen=True)
class CellChecker:
    """Checks cell files of one kind; implements `executive.mission.load.CellFileChecker`.

    Attributes:
        kind: Kind of the driver of the cells.
    """

    kind: DriverKind

    def check(self, config: CellConfig, cell_folder: Path) -> Iterator[tuple[KeyPath, str]]:
        """Yield key and message of each error that the validation of the cell file does not find.

        `cell_folder` is the folder of the cell file, to which paths in the file are relative.
        """
        if arm_errors := tuple(find_arm_errors(config)):
            yield from arm_errors
            return
        driver_errors = tuple(self.kind.check(config, cell_folder))
        yield from driver_errors
        yield from find_places_out_of_reach(config)
        if is_rehearsal(self.kind):
            yield from find_view_errors(config)
            return
        yield from find_detector_errors(config.detectors, cell_folder)
        # The import loads PyBullet, which takes 0.2 s; a cell without physics does not need it.
        from executive.station.pose_check import find_pose_errors

        yield from find_pose_errors(config)

    def labels(self, config: CellConfig, cell_folder: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return the labels that each detector of a cell file can report, by name of the detector.

        The labels of a detector are None if they are unknown before its first answer. Errors in the file are
        ignored, because `check` reports errors.
        """
        if is_rehearsal(self.kind):
            return dict.fromkeys(config.detectors)
        return find_detectable_labels(config.detectors, cell_folder)

    def compute_mass(self, section: ObjectConfig) -> float:
        """Return the mass of the objects of a class [kg], 0 if it is unknown.

        Raises:
            InputError: The model of the class is invalid.
        """
        compute_mass = getattr(self.kind, "compute_mass", None)
        return float(compute_mass(section)) if compute_mass else section.mass or 0.0


def load_checker(kind: str) -> CellChecker:
    """Return the checker of cell files with a value of the key `kind`.

    Raises:
        InputError: No package registers this kind, or its class cannot be loaded.
    """
    return CellChecker(load_driver_kind(kind))
