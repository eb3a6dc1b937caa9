"""Evaluation of a detector on labelled images."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from executive.cell.config import CellConfig, DetectorConfig
from executive.cell.detection import Answer, Detection
from executive.cell.frame import Box
from executive.cell.protocols import Localizer
from executive.errors import Unavailable
from executive.perception.envelope.frame_statistics import FrameRange, compute_frame_statistics
from executive.training.dataset import LabelledImage
from executive.training.evaluation.cell_detector import CellDetector
from executive.training.evaluation.error_statistics import ErrorStatistics, RepeatedErrors
from executive.training.evaluation.matching import BoxMatch, is_ignored, match_detections
from executive.training.evaluation.metrics import Distribution, Evaluation
from executive.training.evaluation.worst_mistakes import WorstMistakes

MIN_CONFIDENCE = 0.01
"""Minimum confidence of the detections of a model file; the average precision needs low confidences."""
MODEL_NAME = "model"
"""Name of the detector that is built from a model file."""


def evaluate(
    detector: CellDetector, samples: Iterable[LabelledImage], *, threshold: float | None = None,
    localizer: Localizer | None = None, mistakes: WorstMistakes | None = None, cell: CellConfig | None = None,
) -> Evaluation:  # fmt: skip
    """Return the accuracy of a detector on labelled images; ignored objects do not count.

    Args:
        detector: The detector.
        samples: The images.
        threshold: Minimum confidence of a detection; None: the threshold of the detector.
        localizer: Computes positions, which are compared with the true positions; None: no comparison.
        mistakes: Collects the missed objects and detections with the worst errors; None: no collection.
        cell: Cell whose workspace is measured: brightness, contrast and colours; None: no measurement.
    """
    errors, repeated_errors = ErrorStatistics(localizer), RepeatedErrors(localizer)
    average_precision = AveragePrecision()
    statistics_of_frames: list[Mapping[str, float]] = []
    latencies: list[float] = []
    answer_counts: Counter[str] = Counter()
    unavailable_count, unavailable_reason = 0, ""
    for number, sample in enumerate(samples, 1):
        frame = sample.to_frame(number)
        try:
            answer, latency = detector.detect(frame)
        except Unavailable as error:
            unavailable_count, unavailable_reason = unavailable_count + 1, str(error) or repr(error)
            continue
        answer_counts[answer.detector] += 1
        latencies.append(latency)
        average_precision.add([entry for entry in answer.confident if not is_ignored(entry, sample)], sample)
        min_confidence = answer.error_rates.threshold if threshold is None else threshold
        matches = _match_confident(answer, sample, min_confidence)
        errors.add(matches, sample, frame)
        if sample.repeated_image is not None:
            with contextlib.suppress(Unavailable):
                second_answer, _ = detector.detect(replace(frame, image=sample.repeated_image))
                second_matches = _match_confident(second_answer, sample, min_confidence)
                repeated_errors.add(matches, second_matches, sample, frame)
        if cell is not None and (frame_statistics := compute_frame_statistics(frame, cell)):
            statistics_of_frames.append(frame_statistics)
        if mistakes is not None:
            mistakes.add(matches, sample)
    map50, map50_95 = average_precision.compute()
    metrics_by_class = {label: errors.compute_metrics([label]) for label in errors.labels}
    return Evaluation(
        threshold=detector.threshold if threshold is None else threshold,
        images=unavailable_count + answer_counts.total(),
        **vars(errors.compute_metrics(errors.labels)),
        map50=map50,
        map50_95=map50_95,
        centre=Distribution.compute(errors.centre_errors),
        position=Distribution.compute(errors.position_errors),
        localized=Distribution.compute(errors.localization_errors),
        # The first request is slower: it fills caches and opens connections.
        latency=Distribution.compute(latencies[1:] or latencies),
        by_class={label: metrics for label, metrics in metrics_by_class.items() if metrics.objects},
        confusion=errors.make_confusion_matrix(),
        unavailable=unavailable_count,
        why=unavailable_reason,
        answered_by=dict(answer_counts),
        by_count={count: dict(counts) for count, counts in errors.counts_by_object_count.items()},
        reliability=errors.estimate_error_rates(repeated_errors),
        frames=FrameRange.compute(statistics_of_frames),
    )


def _match_confident(answer: Answer, sample: LabelledImage, min_confidence: float) -> list[BoxMatch]:
    """Return the matches of detections with at least `min_confidence`; ignored objects are excluded."""
    confident = [entry for entry in answer.confident if entry.confidence >= min_confidence]
    return match_detections([entry for entry in confident if not is_ignored(entry, sample)], sample)


def find_label_file(model: Path) -> Path:
    """Return the label file of a model `NAME.onnx`: `NAME.labels.txt` if it exists, else `labels.txt`."""
    file = model.with_suffix(".labels.txt")
    return file if file.is_file() else model.with_name("labels.txt")


def make_model_config(model: Path, labels: Path) -> DetectorConfig:
    """Return the detector configuration of an exported RF-DETR: an ONNX file and a file of class names."""
    files = {"model_path": str(model.absolute()), "labels": str(labels.absolute())}
    return DetectorConfig.model_validate({"kind": "rfdetr", "floor": MIN_CONFIDENCE, **files})


def evaluate_model(
    model: Path, labels: Path, images: Iterable[LabelledImage], threshold: float
) -> Evaluation:
    """Return the accuracy of an exported RF-DETR on labelled images.

    Args:
        model: The ONNX file.
        labels: The text file with the class names.
        images: The images.
        threshold: Minimum confidence of a detection.

    Raises:
        InputError: Model, labels or images cannot be read.
    """
    detector = CellDetector({MODEL_NAME: make_model_config(model, labels)}, MODEL_NAME, base=Path())
    with contextlib.closing(detector):
        return evaluate(detector, images, threshold=threshold)


class AveragePrecision:
    """Mean average precision (mAP) over all classes in the images."""

    def __init__(self) -> None:
        # The import takes half a second and 120 MB; only an evaluation needs the package.
        from supervision.metrics import MeanAveragePrecision

        self._metric = MeanAveragePrecision()
        self._class_ids: dict[str, int] = {}
        self._has_objects = False

    def add(self, detections: Sequence[Detection], sample: LabelledImage) -> None:
        """Add the detections in one image; the detections may have any confidence."""
        boxes = [detection.box for detection in detections]
        predicted = self._to_detections(boxes, [detection.label for detection in detections])
        predicted.confidence = np.array([detection.confidence for detection in detections], dtype=float)
        self._metric.update([predicted], [self._to_detections(sample.boxes, sample.labels)])
        self._has_objects |= bool(sample.labels)

    def compute(self) -> tuple[float, float]:
        """Return mAP at IoU 0.5, and the mean of mAP over IoUs from 0.5 to 0.95; zeros without objects."""
        if not self._has_objects:
            return 0.0, 0.0
        result = self._metric.compute()
        return float(result.map50), float(result.map50_95)

    def _to_detections(self, boxes: Sequence[Box], labels: Sequence[str]) -> Any:
        """Return boxes and labels as `supervision.Detections`."""
        import supervision as sv

        ids = [self._class_ids.setdefault(label, len(self._class_ids)) for label in labels]
        return sv.Detections(np.array(boxes, float).reshape(-1, 4), class_id=np.array(ids, dtype=int))
