"""Detectors of a cell that report their error rates: measured, or assumed if no measurement applies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from executive.cell.config import CellConfig
from executive.cell.error_rates import ErrorRates, assume_rates
from executive.cell.frame import Frame
from executive.cell.protocols import Clock
from executive.errors import InputError
from executive.perception.detectors.registry import build_detectors, find_detector_kinds
from executive.perception.detectors.requests import ChangedRequest
from executive.perception.detectors.setting import ClosableDetector
from executive.perception.envelope.fingerprint import describe_change, take_fingerprint
from executive.perception.envelope.frame_statistics import FrameRange, measure_frame
from executive.perception.envelope.measurement import SUFFIX, Measurement, read_measurements

FAKE = "fake"
"""Kind of cell whose detectors are not measured: they know which objects there are."""
MEASURING_MINUTES = 2
"""Usual duration of a measurement on two cores [min]."""


@dataclass(frozen=True)
class DetectorEnvelope:
    """Error rates of one detector and the conditions for them.

    Attributes:
        error_rates: Measured error rates, or assumed ones if `error_rates.doubt` is not "".
        frame_range: Measured ranges of the frame statistics; None if unknown or if no measurement applies.
    """

    error_rates: ErrorRates
    frame_range: FrameRange | None = None


@dataclass(frozen=True, eq=False)
class RatedDetector:
    """Detector whose answers carry the error rates of its envelope; implements `ClosableDetector`.

    Attributes:
        detector: The detector.
        envelope: Its error rates and the conditions for them.
        config: Its cell; the image of the workspace is compared with the measured frames.
        name: Name of the detector.
    """

    detector: ClosableDetector
    envelope: DetectorEnvelope
    config: CellConfig
    name: str

    def request(self, frame: Frame, view: str) -> ChangedRequest:
        """Start to search `frame`; rates are assumed if the frame lies outside the measured ranges."""
        error_rates, frame_range = self.envelope.error_rates, self.envelope.frame_range
        statistics = measure_frame(frame, self.config.table) if frame_range else None
        if frame_range and statistics and (difference := frame_range.describe_difference(statistics)):
            reason = (
                f"the workspace looks different from all images that detector {self.name} was measured on: "
                f"{difference}; {advise_measuring(self.config)}"
            )
            error_rates = assume_rates(error_rates.threshold, reason)
        asked = self.detector.request(frame, view)
        return ChangedRequest(asked, lambda answer: replace(answer, error_rates=error_rates))

    def close(self) -> None:
        """Close the detector."""
        self.detector.close()


def build_rated_detectors(
    config: CellConfig, *, clock: Clock, base: Path, seed: int, folders: Sequence[Path]
) -> dict[str, ClosableDetector]:
    """Return the detectors of a cell by name, in the order of the cell file, with their error rates.

    Args:
        config: The cell.
        clock: Clock of the run.
        base: Folder to which paths in the cell file are relative.
        seed: Random seed of the detectors.
        folders: Folders with files `CELL.measured.json`.

    Raises:
        InputError: A detector cannot be built.
    """
    camera = next(iter(config.cameras.values()))
    built = build_detectors(config.detectors, camera=camera, clock=clock, base=base, seed=seed)
    envelopes = find_envelopes(config, base, folders)
    return {
        name: RatedDetector(one, envelopes[name], config, name) if name in envelopes else one
        for name, one in built.items()
    }


def find_envelopes(config: CellConfig, base: Path, folders: Sequence[Path]) -> dict[str, DetectorEnvelope]:
    """Return the envelope of each measurable detector of a cell, by name.

    A measurement applies if its fingerprint equals that of the detector, even if made in another cell.

    Args:
        config: The cell.
        base: Folder to which paths in the cell file are relative.
        folders: Folders with files `CELL.measured.json`.
    """
    names = list(measurable_detectors(config))
    stored, problems = _read_all(folders) if names else ([], [])
    envelopes = {}
    for name in names:
        threshold = config.detectors[name].threshold
        current = take_fingerprint(config, name, base)
        match = next((one for _, one in stored if one.fingerprint == current), None)
        if match is not None:
            envelopes[name] = DetectorEnvelope(match.rates.build_error_rates(threshold), match.frames)
            continue
        older = next((one for cell, one in stored if (cell, one.detector) == (config.cell, name)), None)
        change = describe_change(older.fingerprint, current) if older else ""
        was = f"was measured before a change of {change}" if change else "was never measured in this cell"
        reason = f"detector {name} {was}, so high error rates are assumed; {advise_measuring(config)}"
        envelopes[name] = DetectorEnvelope(assume_rates(threshold, "; ".join([reason, *problems])))
    return envelopes


def advise_measuring(config: CellConfig) -> str:
    """Return the command that measures the detectors of a cell, as a part of a sentence."""
    return f"measure it with `executive evaluate --cell {config.cell}` (about {MEASURING_MINUTES} min)"


def find_unmeasured(
    config: CellConfig, base: Path, folders: Sequence[Path]
) -> Iterator[tuple[tuple[str, str], str]]:
    """Yield each detector without a valid measurement: its keys in the cell file, and the reason."""
    for name, envelope in find_envelopes(config, base, folders).items():
        if envelope.error_rates.doubt:
            yield ("detectors", name), envelope.error_rates.doubt


def measurable_detectors(config: CellConfig) -> Iterator[str]:
    """Yield the names of the detectors whose errors can be measured: those installed and not fake."""
    kinds = find_detector_kinds()
    for name, section in config.detectors.items():
        is_known = config.kind != FAKE and section.kind in kinds
        if is_known and not getattr(kinds[section.kind].load(), "is_fake", False):
            yield name


def _read_all(folders: Sequence[Path]) -> tuple[list[tuple[str, Measurement]], list[str]]:
    """Return each stored measurement with the name of its cell, and the problems of unreadable files."""
    stored: list[tuple[str, Measurement]] = []
    problems = []
    for file in (file for folder in folders for file in sorted(folder.glob(f"*{SUFFIX}"))):
        try:
            stored += [(file.name.removesuffix(SUFFIX), one) for one in read_measurements(file)]
        except InputError as error:
            problems.append(str(error))
    return stored, problems
