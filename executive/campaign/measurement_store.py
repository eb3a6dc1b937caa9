"""Storage of measurements in the files from which runs take error rates."""

from __future__ import annotations

from pathlib import Path

from executive.campaign.evaluation import DetectorUnderTest
from executive.errors import InputError, explained
from executive.perception.envelope.fingerprint import take_fingerprint
from executive.perception.envelope.measurement import (
    SUFFIX,
    ErrorCounts,
    Measurement,
    format_measurements,
    read_measurements,
)
from executive.record.whole_file import write_whole
from executive.training.evaluation.figures import NOTHING, Evaluation


def store_evaluation(
    detector: DetectorUnderTest, evaluation: Evaluation, out: Path | None, *, command: str, seconds: float
) -> Path:
    """Write the errors of a detector in its cell into a file and return the path of the file.

    Measurements of other detectors in the file are kept.

    Args:
        detector: The detector and its cell.
        evaluation: Errors of the detector.
        out: The file; None: `CELL.measured.json` beside the cell file.
        command: Command line that repeats the evaluation.
        seconds: Duration of the evaluation [s].

    Raises:
        InputError: The detector gave no answer for any image, or the file cannot be read or written.
    """
    assert detector.cell is not None
    path = out or detector.base / f"{detector.cell.cell}{SUFFIX}"
    if evaluation.reliability is None:
        raise InputError(
            f"detector {detector.name} gave no answer for any image: {evaluation.why}; nothing was measured"
        )
    table = evaluation.confusion
    measurement = Measurement(
        detector=detector.name,
        fingerprint=dict(take_fingerprint(detector.cell, detector.name, detector.base)),
        command=command,
        seconds=round(seconds, 1),
        images=evaluation.images,
        rates=evaluation.reliability.rates,
        classes={
            label: ErrorCounts(
                objects=sum(row.values()),
                missed=row.get(NOTHING, 0),
                confused=sum(row.values()) - row.get(NOTHING, 0) - row.get(label, 0),
                invented=table.get(NOTHING, {}).get(label, 0),
            )
            for label, row in table.items()
            if label != NOTHING
        },
        counts={
            str(count): ErrorCounts(**{name: errors.get(name, 0) for name in ErrorCounts.model_fields})
            for count, errors in sorted(evaluation.by_count.items())
        },
        frames=evaluation.frames,
    )
    instead = "name another file with --out, and copy it into the folder of your cell file"
    with explained(InputError, f"the measurement {path} cannot be written", instead):
        write_whole(path, format_measurements(read_measurements(path), measurement))
    return path
