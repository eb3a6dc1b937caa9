"""Stored measurements of detectors (files `CELL.measured.json`), and fingerprints of detectors."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError

from executive.cell.config import CameraConfig, CellConfig, DetectorConfig, Section
from executive.cell.detection import ErrorRates
from executive.errors import InputError
from executive.perception.camera_model import compute_calibration
from executive.perception.detectors.detector_registry import find_detector_kinds
from executive.perception.envelope.frame_statistics import FrameRange

MEASUREMENT_SUFFIX = ".measured.json"
"""Suffix of a measurement file, after the name of the cell."""
MAX_FILE_SIZE = 1_000_000
"""Maximum size of a measurement file [byte]."""


Fingerprint = Mapping[str, str]
"""Declared properties of detector and cell that affect the error rates: text by name of the property."""


class StoredErrorRates(Section):
    """Error rates of a detector in a measurement file; `executive.cell.detection` describes the fields."""

    miss_rate: float = Field(gt=0, lt=1)
    confusion_rate: float = Field(gt=0, lt=1)
    false_detections: float = Field(gt=0)
    jitter: float = Field(gt=0)
    repeated: float = Field(ge=0, lt=1)
    bias: float = Field(ge=0)

    def build_error_rates(self, threshold: float) -> ErrorRates:
        """Return these rates for a detector with `threshold` as the minimum confidence of its detections."""
        return ErrorRates(threshold, **self.model_dump())


class ErrorCounts(Section):
    """Numbers of objects, missed and misclassified objects, and false detections, in a part of the scenes."""

    objects: int
    missed: int
    confused: int
    false_detections: int


class Measurement(Section):
    """Errors of one detector in one cell, and the conditions under which they were measured."""

    detector: str
    """Name of the detector in the cell."""
    fingerprint: dict[str, str]
    """Values of the properties that affect the error rates, by the name of the property."""
    command: str
    """Command line of the measurement."""
    seconds: float
    """Duration of the measurement [s]."""
    images: int
    """Number of measured images."""
    rates: StoredErrorRates
    """`miss_rate`, `confusion_rate`, `false_detections`: upper 95 % bounds; `repeated`: Laplace estimate;
    `jitter`, `bias`: standard deviations."""
    classes: dict[str, ErrorCounts]
    """Errors by class; a false detection counts for the class that the detector reported."""
    counts: dict[str, ErrorCounts]
    """Errors by number of objects in the scene."""
    frames: FrameRange | None
    """Ranges of the statistics of the measured frames; None if no frame showed the whole workspace."""


class MeasurementFile(Section):
    """Content of a file `CELL.measured.json`."""

    version: Literal[1] = 1
    measurements: tuple[Measurement, ...] = ()


def read_measurements(path: Path) -> tuple[Measurement, ...]:
    """Return the measurements in a file; no measurements if the file does not exist.

    Raises:
        InputError: The file cannot be read or is invalid.
    """
    if not path.is_file():
        return ()
    try:
        if path.stat().st_size > MAX_FILE_SIZE:
            raise InputError(f"{path} is larger than {MAX_FILE_SIZE} bytes; it is not a measurement file")
        return MeasurementFile.model_validate_json(path.read_bytes()).measurements
    except (OSError, ValidationError) as error:
        problem = f"the measurements in {path} cannot be read: {str(error).splitlines()[0]}"
        advice = "remove the file and measure again with `executive evaluate --cell`"
        raise InputError(f"{problem}; {advice}") from error


def read_folders(folders: Sequence[Path]) -> tuple[list[tuple[str, Measurement]], list[str]]:
    """Return all stored measurements, each with the name of its cell, and messages about unreadable files."""
    measurements: list[tuple[str, Measurement]] = []
    problems = []
    for file in (file for folder in folders for file in sorted(folder.glob(f"*{MEASUREMENT_SUFFIX}"))):
        try:
            cell = file.name.removesuffix(MEASUREMENT_SUFFIX)
            measurements += [(cell, measurement) for measurement in read_measurements(file)]
        except InputError as error:
            problems.append(str(error))
    return measurements, problems


def is_measured(weights: Path, folder: Path) -> bool:
    """Return True if a detector with this model file was measured in a cell of a folder."""
    fingerprints = [measurement.fingerprint for _, measurement in read_folders([folder])[0]]
    return _digest(weights) in [fingerprint.get("weights") for fingerprint in fingerprints]


def format_measurements(measurements: Iterable[Measurement], new: Measurement) -> str:
    """Return the text of a measurement file in which `new` replaces the measurement of its detector."""
    others = [measurement for measurement in measurements if measurement.detector != new.detector]
    ordered = sorted((*others, new), key=lambda measurement: measurement.detector)
    content = MeasurementFile(measurements=tuple(ordered)).model_dump(mode="json")
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def compute_fingerprint(config: CellConfig, detector: str, base: Path) -> Fingerprint:
    """Return the fingerprint of a detector in its cell.

    The fingerprint contains weights and settings of the detector, the localization method, the classes and
    their sizes, and pose, intrinsics, image size, `table_view` and depth settings of the camera. It does not
    contain bins, the number of objects, light, colours, and classes that look like another class. Paths in
    the cell file are relative to `base`.
    """
    section = config.detectors[detector]
    options = {key: value for key, value in section.options.items() if key != "threads"}
    return {
        "detector": f"{section.kind} {json.dumps(options, sort_keys=True)}",
        "weights": _digest_weights(section, base),
        "threshold": f"{section.threshold:g}",
        "localization": config.localization,
        **{
            f"class {label}": f"{kind.height * 1000:.1f} mm high, radius {kind.radius * 1000:.1f} mm"
            for label, kind in config.objects.items()
            if not kind.looks_like
        },
        **_describe_camera(next(iter(config.cameras.values())), config),
    }


def list_changes(measured: Fingerprint, current: Fingerprint) -> str:
    """Return the names of the properties that differ between two fingerprints; "" if none."""
    names = dict.fromkeys([*measured, *current])
    return ", ".join(name for name in names if measured.get(name) != current.get(name))


def _digest_weights(section: DetectorConfig, base: Path) -> str:
    """Return a digest of the model file of a detector; "" for a detector without a model file."""
    find_weights = getattr(find_detector_kinds()[section.kind].load(), "weights", None)
    path = find_weights(section, base) if find_weights else None
    return _digest(path) if path and path.is_file() else ""


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def _describe_camera(camera: CameraConfig, config: CellConfig) -> dict[str, str]:
    """Return the properties of a camera that affect error rates."""
    matrix, X_MC = compute_calibration(camera)
    poses = {name: config.arm.poses_deg[name] for name in camera.scan_poses if camera.mount == "wrist"}
    return {
        "camera pose": f"{camera.mount} {X_MC.to_rounded_list(4)} {json.dumps(poses)}",
        "camera lens": f"{matrix.round(2).tolist()}",
        "camera image": f"{camera.width} x {camera.height}, searched {list(camera.table_view)}",
        "camera depth": "" if camera.depth is None else camera.depth.model_dump_json(),
    }
