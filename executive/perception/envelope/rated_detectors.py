"""Detectors of a cell with measured error rates, or with assumed error rates if there is no measurement."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from executive.cell.config import CellConfig
from executive.cell.detection import ErrorRates, assume_rates
from executive.cell.frame import Frame
from executive.cell.protocols import Clock
from executive.perception.detectors.detector_registry import build_detectors, find_detector_kinds
from executive.perception.detectors.requests import ChangedRequest, ClosableDetector
from executive.perception.envelope.frame_statistics import FrameRange, compute_frame_statistics
from executive.perception.envelope.measurement import compute_fingerprint, list_changes, read_folders

FAKE_KIND = "fake"
"""Kind of cell whose detectors are not measured, because they read the true positions of the objects."""
MEASUREMENT_MINUTES = 2
"""Typical duration of a measurement on two cores [min]."""


@dataclass(frozen=True)
class DetectorEnvelope:
    """Error rates of one detector, and the measured conditions to which the error rates apply.

    Attributes:
        error_rates: Measured error rates, or assumed error rates (with an `assumption_reason`).
        frame_range: Ranges of the frame statistics in the measurement; None if unknown or not measured.
    """

    error_rates: ErrorRates
    frame_range: FrameRange | None = None


@dataclass(frozen=True, eq=False)
class RatedDetector:
    """Detector whose answers carry the error rates of its envelope; implements `ClosableDetector`.

    Attributes:
        detector: The detector.
        envelope: Error rates of the detector, and the measured conditions.
        config: The cell file, which declares the workspace.
        name: Name of the detector in the cell file.
    """

    detector: ClosableDetector
    envelope: DetectorEnvelope
    config: CellConfig
    name: str

    def request(self, frame: Frame, view: str) -> ChangedRequest:
        """Start the detection; outside the measured conditions, the answer has assumed error rates."""
        error_rates, frame_range = self.envelope.error_rates, self.envelope.frame_range
        statistics = compute_frame_statistics(frame, self.config) if frame_range else None
        if frame_range and statistics and (difference := frame_range.describe_difference(statistics)):
            reason = (
                f"the workspace differs from all images with which detector {self.name} was measured: "
                f"{difference}; {describe_measurement_command(self.config)}"
            )
            error_rates = assume_rates(error_rates.threshold, reason)
        request = self.detector.request(frame, view)
        return ChangedRequest(request, lambda answer: replace(answer, error_rates=error_rates))

    def close(self) -> None:
        """Close the detector."""
        self.detector.close()


def build_rated_detectors(
    config: CellConfig, *, clock: Clock, base: Path, seed: int, folders: Sequence[Path]
) -> dict[str, ClosableDetector]:
    """Return the detectors of a cell by name, in the order of the cell file, with their error rates.

    Args:
        config: The cell file.
        clock: Clock of the run.
        base: Folder to which paths in the cell file are relative.
        seed: Random seed of the detectors.
        folders: Folders with measurement files `CELL.measured.json`.

    Raises:
        InputError: A detector cannot be built.
    """
    camera = next(iter(config.cameras.values()))
    detectors = build_detectors(config.detectors, camera=camera, clock=clock, base=base, seed=seed)
    envelopes = find_envelopes(config, base, folders)
    return {
        name: RatedDetector(detector, envelopes[name], config, name) if name in envelopes else detector
        for name, detector in detectors.items()
    }


def find_envelopes(config: CellConfig, base: Path, folders: Sequence[Path]) -> dict[str, DetectorEnvelope]:
    """Return the envelope of each measurable detector of a cell, by name.

    A measurement in another cell also applies if it has the same fingerprint as the detector. Paths in the
    cell file are relative to `base`; `folders` contain measurement files `CELL.measured.json`.
    """
    names = list(find_measurable_detectors(config))
    measurements, problems = read_folders(folders) if names else ([], [])
    envelopes, advice = {}, describe_measurement_command(config)
    for name in names:
        threshold = config.detectors[name].threshold
        fingerprint = compute_fingerprint(config, name, base)
        match = next((entry for _, entry in measurements if entry.fingerprint == fingerprint), None)
        if match is not None:
            envelopes[name] = DetectorEnvelope(match.rates.build_error_rates(threshold), match.frames)
            continue
        own_entries = (entry for cell, entry in measurements if (cell, entry.detector) == (config.cell, name))
        cause = "was never measured in this cell"
        if outdated := next(own_entries, None):
            changes = list_changes(outdated.fingerprint, fingerprint)
            cause = f"was measured before a change of {changes}"
        cause = f"detector {name} {cause}, so high error rates are assumed"
        envelopes[name] = DetectorEnvelope(assume_rates(threshold, "; ".join([cause, advice, *problems])))
    return envelopes


def describe_measurement_command(config: CellConfig) -> str:
    """Return a clause for messages: the advice to measure a detector, with the command."""
    return f"measure it with `executive evaluate --cell {config.cell}` (about {MEASUREMENT_MINUTES} min)"


def find_unmeasured_detectors(
    config: CellConfig, base: Path, folders: Sequence[Path]
) -> Iterator[tuple[tuple[str, str], str]]:
    """Yield each detector without an applicable measurement: its keys in the cell file, and the reason."""
    for name, envelope in find_envelopes(config, base, folders).items():
        if envelope.error_rates.assumption_reason:
            yield ("detectors", name), envelope.error_rates.assumption_reason


def find_measurable_detectors(config: CellConfig) -> Iterator[str]:
    """Yield the names of the detectors that can be measured: their kind is installed and not fake."""
    kinds = {} if config.kind == FAKE_KIND else find_detector_kinds()
    for name, section in config.detectors.items():
        if section.kind in kinds and not getattr(kinds[section.kind].load(), "is_fake", False):
            yield name
