"""Stored measurements of detectors: the files `CELL.measured.json`."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError

from executive.cell_config import Section
from executive.error_rates import ErrorRates
from executive.errors import InputError
from executive.vision.envelope.frame_statistics import FrameRange

SUFFIX = ".measured.json"
"""Suffix of a measurement file; the name of the cell comes before it."""
MAX_FILE_SIZE = 1_000_000
"""Largest measurement file [byte]."""


class Rates(Section):
    """Error rates of a detector; see `executive.error_rates.ErrorRates`."""

    misses: float = Field(gt=0, lt=1)
    confused: float = Field(gt=0, lt=1)
    invented: float = Field(gt=0)
    jitter: float = Field(gt=0)
    repeated: float = Field(ge=0, lt=1)
    bias: float = Field(ge=0)

    def build_error_rates(self, threshold: float) -> ErrorRates:
        """Return these rates together with the confidence from which detections count."""
        return ErrorRates(threshold, **self.model_dump())


class ErrorCounts(Section):
    """Errors on the objects of one class, or in scenes with the same number of objects."""

    objects: int
    missed: int
    confused: int
    invented: int


class Measurement(Section):
    """Errors of one detector in one cell, and the conditions under which they were measured."""

    detector: str
    """Name of the detector in the cell."""
    fingerprint: dict[str, str]
    """See `executive.vision.envelope.fingerprint`."""
    command: str
    """Command line that repeats the measurement."""
    seconds: float
    """Duration of the measurement [s]."""
    images: int
    rates: Rates
    """Upper 95 % bounds `misses`, `confused` and `invented`; Laplace estimate `repeated`; standard deviations
    `jitter` and `bias`."""
    classes: dict[str, ErrorCounts]
    """Errors by class; a false detection counts for the class that it was given."""
    counts: dict[str, ErrorCounts]
    """Errors by the number of objects in the scene."""
    frames: FrameRange | None
    """Ranges of the statistics of the frames; None if no frame showed the whole workspace."""


class MeasurementFile(Section):
    """Content of a file `CELL.measured.json`."""

    version: Literal[1] = 1
    measurements: tuple[Measurement, ...] = ()


def read_measurements(path: Path) -> tuple[Measurement, ...]:
    """Return the measurements in a file; none if there is no such file.

    Raises:
        InputError: The file cannot be read or has another form.
    """
    if not path.is_file():
        return ()
    try:
        if path.stat().st_size > MAX_FILE_SIZE:
            raise InputError(f"{path} is larger than {MAX_FILE_SIZE} bytes; it is not a measurement file")
        return MeasurementFile.model_validate_json(path.read_bytes()).measurements
    except (OSError, ValidationError) as error:
        raise InputError(
            f"the measurements in {path} cannot be read: {str(error).splitlines()[0]}; remove the file and "
            "measure again with `executive evaluate --cell`"
        ) from error


def text_with_measurement(measurements: Iterable[Measurement], new: Measurement) -> str:
    """Return the text of a file with a new measurement, in place of an older one of the same detector."""
    others = [one for one in measurements if one.detector != new.detector]
    ordered = sorted((*others, new), key=lambda one: one.detector)
    content = MeasurementFile(measurements=tuple(ordered)).model_dump(mode="json")
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"
