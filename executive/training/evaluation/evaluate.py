"""Measuring a detector on labelled images."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from executive.cell.config import DetectorConfig, TableConfig
from executive.cell.detection import Answer, Detection
from executive.cell.frame import Box
from executive.cell.protocols import Localizer
from executive.errors import Unavailable
from executive.perception.envelope.frame_statistics import FrameRange, FrameStatistics, measure_frame
from executive.training.evaluation.asking import CellDetector
from executive.training.evaluation.figures import Distribution, Evaluation
from executive.training.evaluation.matching import BoxMatch, is_ignored, match
from executive.training.evaluation.misses import WorstMisses
from executive.training.evaluation.tally import RepeatedErrors, Tally
from executive.training.labelled_image import LabelledImage
from executive.training.samples import Samples

MIN_CONFIDENCE = 0.01
"""Confidence from which boxes of a model file count for the mean average precision."""
MODEL_NAME = "model"
"""Name of the detector of a model file."""


def evaluate(
    detector: CellDetector,
    samples: Iterable[LabelledImage],
    *,
    threshold: float | None = None,
    localizer: Localizer | None = None,
    worst: WorstMisses | None = None,
    table: TableConfig | None = None,
) -> Evaluation:
    """Return the accuracy of a detector on labelled images; ignored objects are neither found nor missed.

    Args:
        detector: The detector.
        samples: The images.
        threshold: Confidence from which a detection counts; None for the detector's own.
        localizer: Computes positions from detections, for comparison with the true positions.
        worst: Gathers the worst mistakes.
        table: Declares the workspace whose brightness, contrast and colours are measured; None: they are not.
    """
    tally, precision, repeats = Tally(localizer), AveragePrecision(), RepeatedErrors(localizer)
    frames: list[FrameStatistics] = []
    latencies: list[float] = []
    answered: Counter[str] = Counter()
    unavailable, why = 0, ""
    for number, sample in enumerate(samples, 1):
        frame = sample.to_frame(number)
        try:
            answer, latency = detector.ask(frame)
        except Unavailable as error:
            unavailable, why = unavailable + 1, str(error)
            continue
        answered[answer.detector] += 1
        latencies.append(latency)
        precision.add([one for one in answer.found if not is_ignored(one, sample)], sample)
        min_confidence = answer.error_rates.threshold if threshold is None else threshold
        matches = _match(answer, sample, min_confidence)
        tally.add(matches, sample, frame)
        if sample.second_image is not None:
            with contextlib.suppress(Unavailable):
                second, _ = detector.ask(replace(frame, image=sample.second_image))
                repeats.add(matches, _match(second, sample, min_confidence), sample, frame)
        if table is not None and (statistics := measure_frame(frame, table)):
            frames.append(statistics)
        if worst is not None:
            worst.add(matches, sample)
    map50, map50_95 = precision.result()
    return Evaluation(
        threshold=detector.threshold if threshold is None else threshold,
        images=unavailable + answered.total(),
        objects=tally.objects,
        precision=tally.precision,
        recall=tally.recall,
        map50=map50,
        map50_95=map50_95,
        centre=Distribution.of(tally.centre),
        position=Distribution.of(tally.position),
        localized=Distribution.of(tally.localized),
        # The first look warms up caches and connections.
        latency=Distribution.of(latencies[1:] or latencies),
        by_class=tally.by_class(),
        confusion=tally.table(),
        unavailable=unavailable,
        why=why,
        answered_by=dict(answered),
        by_count={count: dict(errors) for count, errors in tally.by_count.items()},
        reliability=tally.estimate_error_rates(repeats),
        frames=FrameRange.of(frames),
    )


def _match(answer: Answer, sample: LabelledImage, min_confidence: float) -> list[BoxMatch]:
    """Return the matches of the detections that count."""
    found = [one for one in answer.found if one.confidence >= min_confidence]
    return match([one for one in found if not is_ignored(one, sample)], sample)


def label_file(model: Path) -> Path:
    """Return the label file of a model `NAME.onnx`: `NAME.labels.txt` if it exists, else `labels.txt`."""
    own = model.with_suffix(".labels.txt")
    return own if own.is_file() else model.with_name("labels.txt")


def model_detector(model: Path, labels: Path) -> DetectorConfig:
    """Return the section of a cell file for an exported RF-DETR.

    Args:
        model: The ONNX file.
        labels: The text file that lists its class names.
    """
    files = {"model_path": str(model.absolute()), "labels": str(labels.absolute())}
    return DetectorConfig.model_validate({"kind": "rfdetr", "floor": MIN_CONFIDENCE, **files})


def evaluate_folder(model: Path, labels: Path, folder: Path, threshold: float) -> Evaluation:
    """Return the accuracy of an exported RF-DETR on a folder of labelled images.

    Args:
        model: The ONNX file.
        labels: The text file that lists its class names.
        folder: A split, or a data set whose `test` or else `valid` split is used.
        threshold: Confidence from which a detection counts.

    Raises:
        InputError: Model, labels or images cannot be read.
    """
    detector = CellDetector({MODEL_NAME: model_detector(model, labels)}, MODEL_NAME, base=Path())
    with contextlib.closing(detector):
        return evaluate(detector, Samples(folder), threshold=threshold)


class AveragePrecision:
    """Collects detections; computes the mean average precision over all classes in the images."""

    def __init__(self) -> None:
        # The import takes half a second and 120 MB, so only an evaluation makes it.
        import supervision
        from supervision.metrics import MeanAveragePrecision

        self._kind = supervision.Detections
        self._metric = MeanAveragePrecision()
        self._numbers: dict[str, int] = {}
        self._has_objects = False

    def add(self, found: Sequence[Detection], sample: LabelledImage) -> None:
        """Count the answer to one image, every box from the detector's floor on."""
        predicted = self._detections([one.box for one in found], [one.label for one in found])
        predicted.confidence = np.array([one.confidence for one in found], dtype=float)
        self._metric.update([predicted], [self._detections(sample.boxes, sample.labels)])
        self._has_objects |= bool(sample.labels)

    def result(self) -> tuple[float, float]:
        """Return it at an IoU of 0.5, and its mean over IoUs of 0.5 to 0.95; zeros without objects."""
        if not self._has_objects:
            return 0.0, 0.0
        result = self._metric.compute()
        return float(result.map50), float(result.map50_95)

    def _detections(self, boxes: Sequence[Box], labels: Sequence[str]) -> Any:
        numbers = [self._numbers.setdefault(label, len(self._numbers)) for label in labels]
        return self._kind(np.array(boxes, float).reshape(-1, 4), class_id=np.array(numbers, dtype=int))
