"""Measured envelope of a detector: error rates, and the conditions under which they were measured.

The error rates are stored in files `CELL.measured.json`. They apply to a detector with the fingerprint of the
measurement, in frames whose workspace resembles the measured frames in brightness, contrast and colour.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeAlias

import cv2
import numpy as np
from pydantic import Field, ValidationError

from executive.cell.config import CellConfig
from executive.cell.device_config import Section
from executive.cell.devices import is_rehearsal, load_driver_kind
from executive.cell.frame import ErrorRates, Frame, assume_rates
from executive.errors import InputError
from executive.perception.camera_model import compute_calibration, compute_hull_mask
from executive.perception.detectors.detector_registry import find_detector_kinds

MIN_PIXELS = 400
"""Minimum number of visible pixels of the workspace for the computation of statistics."""
MIN_FRACTION_OF_PARTIAL_VIEW = 0.03
"""Minimum fraction of an image that shows the workspace if the image may show only a part of it; objects then
cover less than half of the pixels, and the medians are those of the table."""
ABSOLUTE_TOLERANCE = 6.0
"""Minimum tolerance below and above the measured range of a statistic [grey level]."""
RELATIVE_TOLERANCE = 0.08
"""Minimum tolerance below and above the measured range of a statistic, as a fraction of the range limit."""
MIN_WITNESS_RATE = 0.98
"""Minimum fraction of the objects of a class that the witness of an empty table must find; below, images do
not prove that the table is empty."""
MEASUREMENT_SUFFIX = ".measured.json"
"""Suffix of a measurement file, after the name of the cell."""
MAX_FILE_SIZE = 1_000_000
"""Maximum size of a measurement file [byte]."""
DEFAULT_ARM_PLACE = "iiwa14 at [0.0, 0.0, 0.0], 0 degrees"
"""Arm of measurements that name none: the one in the images with which the shipped detectors were trained."""
MEASUREMENT_MINUTES = 2
"""Typical duration of a measurement on two cores [min]."""


class FrameRange(Section):
    """Minimum and maximum of each statistic over the measured frames [grey level].

    Medians describe the colour of the table even if objects cover a part of the table.

    Attributes:
        brightness: Median over the pixels of the mean of the three colours.
        contrast: Median absolute deviation from the brightness.
        red, green, blue: Median of each colour over the pixels.
    """

    brightness: tuple[float, float]
    contrast: tuple[float, float]
    red: tuple[float, float]
    green: tuple[float, float]
    blue: tuple[float, float]

    @staticmethod
    def compute(samples: Sequence[Mapping[str, float]]) -> FrameRange | None:
        """Return the ranges of the statistics of several frames; None if there are no frames."""
        if not samples:
            return None
        values = {name: [sample[name] for sample in samples] for name in FrameRange.model_fields}
        ranges = {name: (round(min(column), 1), round(max(column), 1)) for name, column in values.items()}
        return FrameRange.model_validate(ranges)

    def describe_difference(self, statistics: Mapping[str, float]) -> str:
        """Return a text with name, value and range of each statistic outside its range; "" if none."""
        differences = []
        for name, value in statistics.items():
            lower, upper = getattr(self, name)
            lower_tolerance = max(ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE * lower)
            upper_tolerance = max(ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE * upper)
            if not lower - lower_tolerance <= value <= upper + upper_tolerance:
                differences.append(f"{name} {value:.0f}, measured {lower:.0f} to {upper:.0f}")
        return "; ".join(differences)


def compute_frame_statistics(frame: Frame, cell: CellConfig) -> Mapping[str, float] | None:
    """Return the statistics of the workspace; None if a corner is not in view or few pixels are visible.

    The corners may be out of the partial view of a camera, but a larger part of the image must then show the
    workspace.
    """
    is_partial = next(iter(cell.cameras.values())).partial_views
    height, width = frame.image.shape[:2]
    corners = np.array([(x, y, 0.0) for x in cell.table.x for y in cell.table.y])
    mask = compute_hull_mask(corners, frame.matrix, frame.X_WC, (width, height), may_be_cut=is_partial)
    min_pixels = MIN_FRACTION_OF_PARTIAL_VIEW * width * height if is_partial else MIN_PIXELS
    mask &= frame.visible
    if np.count_nonzero(mask) < min_pixels:
        return None
    # Image noise would increase the contrast; the mean of 3 x 3 pixels removes most of the noise.
    colours = cv2.blur(frame.image, (3, 3))[mask].astype(float)
    grey = colours.mean(axis=1)
    brightness = float(np.median(grey))
    contrast = float(np.median(np.abs(grey - brightness)))
    values = (brightness, contrast, *np.median(colours, axis=0).tolist())
    return dict(zip(FrameRange.model_fields, values, strict=True))


class StoredErrorRates(Section):
    """Error rates of a detector in a measurement file; `executive.cell.frame` describes the fields."""

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


class WitnessCounts(Section):
    """How often the witness (`executive.perception.witness`) finds objects that no detection shows."""

    objects: dict[str, tuple[int, int]]
    """Number of found objects and of all objects, by class."""
    false_regions: int
    """Number of regions at which there was no object, in all images."""

    def describe_weakness(self) -> str:
        """Return a text with the classes of which the witness finds too few objects; "" if there are none."""
        counts = ", ".join(
            f"{found} of {total} {label}"
            for label, (found, total) in self.objects.items()
            if found < MIN_WITNESS_RATE * total
        )
        return counts and f"of objects without a detection, the image shows only {counts}"


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
    witness: WitnessCounts | None = None
    """Counts of the witness; None if they were not measured."""


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


def compute_fingerprint(config: CellConfig, detector: str, base: Path) -> Mapping[str, str]:
    """Return the fingerprint of a detector in its cell.

    The fingerprint contains weights and settings of the detector, the localization method, the classes and
    their sizes, and pose, intrinsics, image size, `table_view` and depth settings of the camera. It contains
    an arm other than the one in the training images, or at another place. It does not contain bins, the
    number of objects, light, colours, and classes that look like another class. Paths in the cell file are
    relative to `base`.
    """
    section = config.detectors[detector]
    options = {
        key: Path(value).name if isinstance(value, str) and os.path.isfile(base / value) else value
        for key, value in section.options.items()
        if key != "threads"
    }
    find_weights = getattr(find_detector_kinds()[section.kind].load(), "weights", None)
    weights = find_weights(section, base) if find_weights else None
    camera = next(iter(config.cameras.values()))
    matrix, X_MC = compute_calibration(camera)
    poses = {name: config.arm.poses_deg[name] for name in camera.scan_poses if camera.mount == "wrist"}
    place = f"{config.arm.arm} at {list(config.arm.base.position)}, {config.arm.base.yaw_deg:g} degrees"
    return {
        "detector": f"{section.kind} {json.dumps(options, sort_keys=True)}",
        "weights": _digest(weights) if weights and weights.is_file() else "",
        "threshold": f"{section.threshold:g}",
        "localization": config.localization,
        **{
            f"class {label}": f"{kind.height * 1000:.1f} mm high, radius {kind.radius * 1000:.1f} mm"
            for label, kind in config.objects.items()
            if not kind.looks_like
        },
        "camera pose": f"{camera.mount} {X_MC.to_rounded_list(4)} {json.dumps(poses)}",
        "camera lens": f"{matrix.round(2).tolist()}",
        "camera image": f"{camera.width} x {camera.height}, searched {list(camera.table_view)}",
        "camera depth": "" if camera.depth is None else camera.depth.model_dump_json(),
        **({} if place == DEFAULT_ARM_PLACE else {"arm": place}),
    }


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


Envelope: TypeAlias = tuple[ErrorRates, FrameRange | None]
"""Error rates of one detector (measured, or assumed with an `assumption_reason`), and the ranges of the frame
statistics in the measurement, in which the error rates apply; None if unknown or not measured."""


def rate_frame(frame: Frame, *, detector: str, envelope: Envelope, config: CellConfig) -> ErrorRates:
    """Return the error rates of a detector for a frame: those of its envelope.

    Outside the measured conditions, the rates are assumed; `config` declares the workspace.
    """
    error_rates, frame_range = envelope
    statistics = compute_frame_statistics(frame, config) if frame_range else None
    if frame_range and statistics and (difference := frame_range.describe_difference(statistics)):
        reason = (
            f"the workspace differs from all images with which detector {detector} was measured: "
            f"{difference}; {describe_measurement_command(config)}"
        )
        rates = assume_rates(error_rates.threshold, reason)
        # A depth image shows objects in any light and colour.
        return replace(rates, blindness=reason if frame.depth is None else "")
    return error_rates


def find_envelopes(config: CellConfig, base: Path, folders: Sequence[Path]) -> dict[str, Envelope]:
    """Return the envelope of each measurable detector of a cell, by name.

    A measurement in another cell also applies if it has the same fingerprint as the detector. Paths in the
    cell file are relative to `base`; `folders` contain measurement files `CELL.measured.json`.
    """
    names = list(find_measurable_detectors(config))
    measurements, problems = read_folders(folders) if names else ([], [])
    envelopes = {}
    advice = describe_measurement_command(config)
    for name in names:
        threshold = config.detectors[name].threshold
        fingerprint = compute_fingerprint(config, name, base)
        match = next((entry for _, entry in measurements if entry.fingerprint == fingerprint), None)
        if match is not None:
            rates = match.rates.build_error_rates(threshold)
            blindness = match.witness.describe_weakness() if match.witness else ""
            envelopes[name] = (replace(rates, blindness=blindness), match.frames)
            continue
        own_entries = (entry for cell, entry in measurements if (cell, entry.detector) == (config.cell, name))
        cause = "was never measured in this cell"
        if outdated := next(own_entries, None):
            changes = dict(outdated.fingerprint.items() ^ fingerprint.items())
            cause = f"was measured before a change of {', '.join(sorted(changes))}"
        cause = f"detector {name} {cause}, so high error rates are assumed"
        envelopes[name] = (assume_rates(threshold, "; ".join([cause, advice, *problems])), None)
    return envelopes


def describe_measurement_command(config: CellConfig) -> str:
    """Return a clause for messages: the advice to measure a detector, with the command."""
    return f"measure it with `executive evaluate --cell {config.cell}` (about {MEASUREMENT_MINUTES} min)"


def find_measurable_detectors(config: CellConfig) -> Iterator[str]:
    """Yield the names of the detectors that can be measured: their kind is installed and not fake.

    The detectors of a driver without physics read the true positions of the objects.
    """
    kinds = {} if is_rehearsal(load_driver_kind(config.kind)) else find_detector_kinds()
    for name, section in config.detectors.items():
        if section.kind in kinds and not getattr(kinds[section.kind].load(), "is_fake", False):
            yield name
