"""How good a detector is: what it finds, what it imagines, and how far off its boxes are."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from executive.geometry import Array, Pose
from executive.messages import Box, Detection
from executive.vision.camera_model import on_plane
from executive.vision.detectors.onnx_model import OnnxModel, read_labels
from executive.vision.detectors.views import iou
from executive.vision.samples import LabelledImage, read_samples

MATCH = 0.5
"""Overlap (intersection over union) from which a box is the object's."""
FLOOR = 0.01
"""Confidence from which boxes count for the mean average precision."""
INSIDE = 0.5
"""Distance from the image's border [pixel] from which an object is wholly in view."""


class Model(Protocol):
    """Anything that finds objects in one image."""

    @property
    def labels(self) -> Sequence[str]:
        """The classes it knows."""

    def detect(self, image: NDArray[np.uint8], floor: float) -> list[Detection]:
        """Return what it finds in `image` `(H, W, 3)` RGB at or above `floor`, most confident first."""


@dataclass(frozen=True)
class Spread:
    """How a measured quantity is distributed, all in its unit.

    Attributes:
        median, p95, p99, worst: Its quantiles.
    """

    median: float
    p95: float
    p99: float
    worst: float

    @staticmethod
    def of(values: Sequence[float]) -> Spread | None:
        """Return the spread of some values, None where there are none."""
        if not len(values):
            return None
        median, p95, p99, worst = np.percentile(values, [50, 95, 99, 100])
        return Spread(float(median), float(p95), float(p99), float(worst))


@dataclass(frozen=True)
class Evaluation:
    """What was measured.

    Attributes:
        threshold: Confidence from which a detection counted.
        images: Number of images.
        objects: Number of objects on them.
        precision: Share of the detections that are right in class and place.
        recall: Share of the objects that were found.
        map50: Mean average precision at an overlap of 0.5.
        map50_95: The same, averaged over overlaps from 0.5 to 0.95.
        recall_by_class: Recall of each class.
        centre: Distance between the centres of found and true box [pixel].
        position: That in the world, at the height of the object [mm]; None without a renderer's truth.
        latency: Time of one detection [ms].
    """

    threshold: float
    images: int
    objects: int
    precision: float
    recall: float
    map50: float
    map50_95: float
    recall_by_class: dict[str, float]
    centre: Spread | None
    position: Spread | None
    latency: Spread | None

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain values."""
        return asdict(self)


def evaluate_folder(
    model_path: Path, labels: Path | Sequence[str], folder: Path, threshold: float, camera: str | None = None
) -> Evaluation:
    """Return how good an exported RF-DETR is on a folder of labelled images.

    Args:
        model_path: The ONNX file.
        labels: Its class names, or the text file that lists them.
        folder: A split, or a data set whose `test` or else `valid` split is used.
        threshold: Confidence from which a detection counts.
        camera: Only images of this camera, where the data set knows its cameras.

    Raises:
        InputError: Model, labels or images cannot be read.
    """
    names = read_labels(labels) if isinstance(labels, Path) else labels
    samples = read_samples(folder)
    if camera is not None:
        samples = (sample for sample in samples if sample.truth.get("camera") == camera)
    return evaluate(OnnxModel(model_path, names), samples, threshold)


def evaluate(model: Model, samples: Iterable[LabelledImage], threshold: float) -> Evaluation:
    """Return how good a model is on labelled images; ignored objects may be found or not."""
    tally = _Tally(threshold)
    precision_curve = _MeanAveragePrecision(model.labels)
    images = 0
    for sample in samples:
        began = time.perf_counter()
        found = model.detect(sample.image, FLOOR)
        tally.latencies.append((time.perf_counter() - began) * 1000)
        found = [one for one in found if not _is_ignored(one, sample)]
        precision_curve.add(found, sample)
        tally.add([one for one in found if one.confidence >= threshold], sample)
        images += 1
    map50, map50_95 = precision_curve.result()
    return Evaluation(
        threshold=threshold,
        images=images,
        objects=sum(tally.objects.values()),
        precision=tally.hits / max(tally.hits + tally.false, 1),
        recall=tally.hits / max(sum(tally.objects.values()), 1),
        map50=map50,
        map50_95=map50_95,
        recall_by_class={
            label: tally.found.get(label, 0) / count for label, count in sorted(tally.objects.items())
        },
        centre=Spread.of(tally.centres),
        position=Spread.of(tally.positions),
        latency=Spread.of(tally.latencies),
    )


def match(found: Sequence[Detection], sample: LabelledImage) -> Iterator[tuple[Detection, int | None]]:
    """Yield each detection with the number of the object it is, or None.

    Greedy, the most confident first: each takes the object of its class that it overlaps most, if none
    has taken it.
    """
    free = set(range(len(sample.labels)))
    for detection in sorted(found, key=lambda one: -one.confidence):
        rivals = [
            (iou(detection.box, sample.boxes[i]), i) for i in free if sample.labels[i] == detection.label
        ]
        overlap, best = max(rivals, default=(0.0, -1))
        if overlap >= MATCH:
            free.discard(best)
            yield detection, best
        else:
            yield detection, None


@dataclass
class _Tally:
    """Running counts over the images."""

    threshold: float
    hits: int = 0
    false: int = 0
    objects: dict[str, int] = field(default_factory=dict)
    found: dict[str, int] = field(default_factory=dict)
    centres: list[float] = field(default_factory=list)
    positions: list[float] = field(default_factory=list)
    latencies: list[float] = field(default_factory=list)

    def add(self, found: Sequence[Detection], sample: LabelledImage) -> None:
        for label in sample.labels:
            self.objects[label] = self.objects.get(label, 0) + 1
        for detection, number in match(found, sample):
            if number is None:
                self.false += 1
                continue
            self.hits += 1
            self.found[detection.label] = self.found.get(detection.label, 0) + 1
            box = sample.boxes[number]
            offset = _centre(detection.box) - _centre(box)
            self.centres.append(float(np.hypot(*offset)))
            if "positions" in sample.truth and _is_whole(box, sample):
                self.positions.append(_position_error(detection, number, sample))


class _MeanAveragePrecision:
    """The mean average precision, as supervision computes it."""

    def __init__(self, labels: Sequence[str]) -> None:
        # Half a second and 120 MB: only who evaluates pays for it.
        import supervision
        from supervision.metrics import MeanAveragePrecision

        self._detections = supervision.Detections
        self._metric = MeanAveragePrecision()
        self._numbers = {label: number for number, label in enumerate(labels)}
        self._images = 0

    def add(self, found: Sequence[Detection], sample: LabelledImage) -> None:
        known = [i for i, label in enumerate(sample.labels) if label in self._numbers]
        predicted = self._detections(
            xyxy=np.array([one.box for one in found], dtype=float).reshape(-1, 4),
            confidence=np.array([one.confidence for one in found], dtype=float),
            class_id=np.array([self._numbers[one.label] for one in found], dtype=int),
        )
        true = self._detections(
            xyxy=np.array([sample.boxes[i] for i in known], dtype=float).reshape(-1, 4),
            class_id=np.array([self._numbers[sample.labels[i]] for i in known], dtype=int),
        )
        self._metric.update([predicted], [true])
        self._images += 1

    def result(self) -> tuple[float, float]:
        if not self._images:
            return 0.0, 0.0
        result = self._metric.compute()
        return float(result.map50), float(result.map50_95)


def _is_ignored(detection: Detection, sample: LabelledImage) -> bool:
    """Tell whether a detection is one of the objects that may be found or not."""
    best = max((iou(detection.box, box) for box in sample.ignored), default=0.0)
    return best >= MATCH and all(iou(detection.box, box) < best for box in sample.boxes)


def _is_whole(box: Box, sample: LabelledImage) -> bool:
    height, width = sample.image.shape[:2]
    left, top, right, bottom = box
    return min(left, top, width - right, height - bottom) >= INSIDE


def _position_error(detection: Detection, number: int, sample: LabelledImage) -> float:
    """Return how far [mm] a detection is localized from where the true box's centre would be."""
    truth = sample.truth
    true = np.array(truth["positions"][number])
    left, top, right, bottom = truth["part"]
    height, width = sample.image.shape[:2]
    pixel = np.array([left, top]) + _centre(detection.box) * [(right - left) / width, (bottom - top) / height]
    X_WC = Pose.of(truth["X_WC"][:3], truth["X_WC"][3:])
    return float(np.linalg.norm(on_plane(np.array(truth["matrix"]), X_WC, pixel, true[2]) - true) * 1000)


def _centre(box: Box) -> Array:
    left, top, right, bottom = box
    return np.array([(left + right) / 2, (top + bottom) / 2])
