"""Evaluation of a detector on labelled images, and its worst mistakes."""

from __future__ import annotations

import contextlib
import heapq
import math
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig, DetectorConfig
from executive.cell.device_config import CameraConfig
from executive.cell.frame import Box, Detection, Frame
from executive.cell.protocols import Localizer
from executive.errors import Unavailable
from executive.perception.detectors.detector_registry import build_kinds, close_kind
from executive.perception.detectors.envelope import FrameRange, WitnessCounts, compute_frame_statistics
from executive.perception.detectors.views import compute_overlaps
from executive.perception.witness import find_unexplained
from executive.training.dataset import LabelledImage
from executive.training.metrics import (
    BoxMatch,
    Distribution,
    ErrorStatistics,
    Evaluation,
    is_ignored,
    match_detections,
)

MIN_CONFIDENCE = 0.01
"""Minimum confidence of the detections of a model file; the average precision needs low confidences."""
MODEL_NAME = "model"
"""Name of the detector that is built from a model file."""
WHOLE_IMAGE_CAMERA = CameraConfig(
    mount="fixed", position=(0, 0, 1), look_at=(0, 0, 0), up=(1, 0, 0), fov_deg=60,
    table_view=(0, 0, 64, 64), scan_poses=("none",),
).model_copy(update={"table_view": (0, 0, 1 << 20, 1 << 20)})  # fmt: skip
"""Camera for images of any size; `model_copy` does not validate the size of `table_view`."""
MAX_COLUMN_COUNT = 6
"""Maximum number of tiles in a row of the sheet."""
TILE_SIZE = 240
"""Side of a tile [pixel]."""
CAPTION_HEIGHT = 40
"""Height of a caption [pixel]."""
HEADER_HEIGHT = 34
"""Height of the header of the sheet [pixel]."""
GAP = 10
"""Distance between two tiles [pixel]."""
MAX_TEXT_LENGTH = 36
"""Maximum number of characters of a line of a caption."""
CROP_SCALE = 2.2
"""Side of the crop of the image, as a multiple of the longer side of the mistake's box."""
MIN_CROP_SIZE = 40.0
"""Minimum side of the crop [pixel of the image]."""
LINE_THICKNESS = 2
"""Thickness of the lines [pixel]."""
LEGEND = "boxes: detected, corners: ground truth"
"""Text in the header that explains the lines."""
BACKGROUND_COLOUR = (32, 38, 43)
"""Colour of the background, RGB."""
TEXT_COLOUR = (255, 255, 255)
"""Colour of texts, RGB."""
TRUE_COLOUR = "#56B4E9"
"""Colour of true boxes."""
DETECTED_COLOUR = "#E69F00"
"""Colour of detected boxes."""
Picture = NDArray[np.uint8]
"""An image `(H, W, 3)`, RGB."""


def evaluate(
    detector: EvaluatedDetector, samples: Iterable[LabelledImage], *, threshold: float | None = None,
    localizer: Localizer | None = None, mistakes: list[Mistake] | None = None, cell: CellConfig | None = None,
) -> Evaluation:  # fmt: skip
    """Return the accuracy of a detector on labelled images; ignored objects do not count.

    Args:
        detector: The detector.
        samples: The images.
        threshold: Minimum confidence of a detection; None: the threshold of the detector.
        localizer: Computes positions, which are compared with the true positions; None: no comparison.
        mistakes: The worst mistakes so far, to which those in the images are added; None: no collection.
        cell: Cell whose workspace is measured: brightness, contrast and colours; None: no measurement.
    """
    errors = ErrorStatistics(localizer)
    average_precision = AveragePrecision()
    statistics_of_frames: list[Mapping[str, float]] = []
    witness = None if cell is None else WitnessCounts(objects={}, false_regions=0)
    latencies: list[float] = []
    unavailable_reasons: list[str] = []
    min_confidence = detector.threshold if threshold is None else threshold
    for number, sample in enumerate(samples, 1):
        frame = sample.to_frame(number)
        try:
            detections, latency = detector.detect(frame)
        except Unavailable as error:
            unavailable_reasons.append(str(error) or repr(error))
            continue
        latencies.append(latency)
        average_precision.add([entry for entry in detections if not is_ignored(entry, sample)], sample)
        matches = _match_confident(detections, sample, min_confidence)
        second_matches = None
        if sample.repeated_image is not None:
            with contextlib.suppress(Unavailable):
                second_detections, _ = detector.detect(replace(frame, image=sample.repeated_image))
                second_matches = _match_confident(second_detections, sample, min_confidence)
        errors.add(matches, second_matches, sample, frame)
        if cell is not None and (frame_statistics := compute_frame_statistics(frame, cell)):
            statistics_of_frames.append(frame_statistics)
        if cell is not None and witness is not None:
            witness = _add_witness_counts(witness, sample, frame, cell)
        if mistakes is not None:
            collect_mistakes(mistakes, matches, sample)
    map50, map50_95 = average_precision.compute()
    metrics_by_class = {label: errors.compute_metrics([label]) for label in errors.labels}
    return Evaluation(
        threshold=min_confidence,
        images=len(unavailable_reasons) + len(latencies),
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
        unavailable=len(unavailable_reasons),
        why=unavailable_reasons[-1] if unavailable_reasons else "",
        answered_by={detector.name: len(latencies)} if latencies else {},
        by_count={count: dict(counts) for count, counts in errors.counts_by_object_count.items()},
        reliability=errors.estimate_error_rates(),
        frames=FrameRange.compute(statistics_of_frames),
        witness=witness,
    )


def _match_confident(
    detections: Sequence[Detection], sample: LabelledImage, min_confidence: float
) -> list[BoxMatch]:
    """Return the matches of detections with at least `min_confidence`; ignored objects are excluded."""
    confident = [entry for entry in detections if entry.confidence >= min_confidence]
    return match_detections([entry for entry in confident if not is_ignored(entry, sample)], sample)


def _add_witness_counts(
    counts: WitnessCounts, sample: LabelledImage, frame: Frame, cell: CellConfig
) -> WitnessCounts:
    """Return the counts with an image: searched with all objects known, then without each visible object.

    An object at another one does not count: with the other one known, it is no region of its own.
    """
    boxes = [*sample.boxes, *sample.ignored_boxes]
    has_neighbour = (compute_overlaps(boxes)[0] > 0).sum(axis=1) > 1
    false_count = counts.false_regions + len(find_unexplained(frame, boxes, cell, ()))
    objects = dict(counts.objects)
    for index, label in enumerate(sample.labels):
        if sample.is_fully_visible(index) and not has_neighbour[index]:
            regions = find_unexplained(frame, boxes[:index] + boxes[index + 1 :], cell, ())
            overlaps = compute_overlaps([boxes[index], *(region.box for region in regions)])[0][0, 1:]
            found_count, total = objects.get(label, (0, 0))
            objects[label] = (found_count + bool((overlaps > 0).any()), total + 1)
    return WitnessCounts(objects=dict(sorted(objects.items())), false_regions=false_count)


class AveragePrecision:
    """Mean average precision (mAP) over all classes in the images."""

    def __init__(self) -> None:
        # The import takes half a second, for which the refusal of wrong inputs must not wait.
        from supervision.metrics import MeanAveragePrecision

        self._metric = MeanAveragePrecision()
        self._class_ids: dict[str, int] = {}

    def add(self, detections: Sequence[Detection], sample: LabelledImage) -> None:
        """Add the detections in one image; the detections may have any confidence."""
        boxes = [detection.box for detection in detections]
        predicted = self._to_detections(boxes, [detection.label for detection in detections])
        predicted.confidence = np.array([detection.confidence for detection in detections], dtype=float)
        self._metric.update([predicted], [self._to_detections(sample.boxes, sample.labels)])

    def compute(self) -> tuple[float, float]:
        """Return mAP at IoU 0.5, and the mean of mAP over IoUs from 0.5 to 0.95; zeros without objects."""
        result = self._metric.compute()
        return max(float(result.map50), 0.0), max(float(result.map50_95), 0.0)

    def _to_detections(self, boxes: Sequence[Box], labels: Sequence[str]) -> Any:
        """Return boxes and labels as `supervision.Detections`."""
        import supervision as sv  # See `__init__`.

        ids = [self._class_ids.setdefault(label, len(self._class_ids)) for label in labels]
        return sv.Detections(np.array(boxes, float).reshape(-1, 4), class_id=np.array(ids, dtype=int))


class EvaluatedDetector:
    """Detector of a cell file whose accuracy is evaluated.

    Args:
        configs: Detectors of the cell file by name; the evaluated detector may call other detectors.
        name: Name of the detector to evaluate.
        base: Folder to which paths in the options of detectors are relative.
        camera: Camera of the frames; None: the detector searches whole images.
        view: Searched view of `camera`, `table` or `full`.
        classes: Classes of the cell; detections of other classes are dropped, as in a run. None: all classes.

    Raises:
        InputError: A detector cannot be built.
    """

    def __init__(
        self,
        configs: Mapping[str, DetectorConfig], name: str, *, base: Path, camera: CameraConfig | None = None,
        view: str = "table", classes: Collection[str] | None = None,
    ) -> None:  # fmt: skip
        self.name = name
        self.threshold = configs[name].threshold
        self._view = view if camera else "full"
        self._classes = classes
        self._kinds = build_kinds(configs, camera=camera or WHOLE_IMAGE_CAMERA, cell_folder=base, seed=0)

    def detect(self, frame: Frame) -> tuple[list[Detection], float]:
        """Return the detections in a frame, and the time that the detector needed [ms].

        Raises:
            Unavailable: The detector gave no usable answer.
        """
        start_time = time.perf_counter()
        detections = self._kinds[self.name].detect(frame, self._view)
        latency = (time.perf_counter() - start_time) * 1000
        classes = self._classes
        return [entry for entry in detections if classes is None or entry.label in classes], latency

    def close(self) -> None:
        """Release the resources of the detectors."""
        for kind in self._kinds.values():
            close_kind(kind)


def find_label_file(model: Path) -> Path:
    """Return the label file of a model `NAME.onnx`: `NAME.labels.txt` if it exists, else `labels.txt`."""
    file = model.with_suffix(".labels.txt")
    return file if file.is_file() else model.with_name("labels.txt")


def make_model_config(model: Path, labels: Path) -> DetectorConfig:
    """Return the detector configuration of an exported RF-DETR: an ONNX file and a file of class names."""
    files = {"model_path": str(model.absolute()), "labels": str(labels.absolute())}
    return DetectorConfig.model_validate({"kind": "rfdetr", "floor": MIN_CONFIDENCE, **files})


@dataclass(frozen=True, eq=False)
class Mistake:
    """Detection error: missed object, false detection, wrong class, or offset of a correct detection.

    Attributes:
        severity: Visible fraction of a missed object (halved if truncated), confidence of a wrong detection,
            or offset of a correct box divided by the longer side of the true box; 0 to 1.
        text: Short description of the mistake.
        box: Box around the mistake [pixel].
        sample: The labelled image.
        detections: All detections in the image at or above the threshold.
    """

    severity: float
    text: str
    box: Box
    sample: LabelledImage
    detections: tuple[Detection, ...]


def collect_mistakes(
    mistakes: list[Mistake], matches: Sequence[BoxMatch], sample: LabelledImage, max_count: int = 24
) -> None:
    """Add the mistakes in one image to `mistakes`, and keep the most severe `max_count`, sorted."""
    candidates = (*mistakes, *find_mistakes(matches, sample))
    mistakes[:] = heapq.nlargest(max_count, candidates, key=lambda mistake: mistake.severity)


def find_mistakes(matches: Sequence[BoxMatch], sample: LabelledImage) -> Iterator[Mistake]:
    """Yield the mistakes in one image, including the position errors of correct detections."""
    detections = tuple(match.detection for match in matches)
    detected_objects = {match.object_index for match in matches}
    for index, label in enumerate(sample.labels):
        if index not in detected_objects:
            fraction = sample.get_visible_fraction(index)
            truncation = "" if sample.is_fully_inside(index) else ", truncated"
            visibility = "" if fraction >= 0.995 else f", {fraction:.0%} visible"
            text = f"{label} missed{visibility}{truncation}"
            yield Mistake(fraction / (2 if truncation else 1), text, sample.boxes[index], sample, detections)
    for match in matches:
        severity = match.detection.confidence
        text = f"{match.detection.label} {severity:.2f}"
        if match.is_correct:
            offset = float(np.hypot(*match.offset))
            size = max(match.box[2] - match.box[0], match.box[3] - match.box[1], 1.0)
            severity = min(offset / size, 1.0)
            text = f"{match.detection.label} off by {offset:.1f} px"
        elif match.object_index is None:
            text = f"false detection: {text}"
        else:
            text = f"{sample.labels[match.object_index]} detected as {text}"
        left, top, right, bottom = zip(match.box, match.detection.box, strict=True)
        enclosing_box = (min(left), min(top), max(right), max(bottom))
        yield Mistake(severity, text, enclosing_box, sample, detections)


def draw_sheet(mistakes: Sequence[Mistake], title: str) -> Picture:
    """Return a picture with one tile per mistake; title and legend are in the header."""
    column_count = min(MAX_COLUMN_COUNT, max(len(mistakes), 3))
    row_count = max(math.ceil(len(mistakes) / column_count), 1)
    column_width = TILE_SIZE + GAP
    row_height = TILE_SIZE + CAPTION_HEIGHT + GAP
    size = (HEADER_HEIGHT + row_count * row_height, GAP + column_count * column_width, 3)
    sheet = np.full(size, BACKGROUND_COLOUR, np.uint8)
    _write_text(sheet, f"{title}: {LEGEND if mistakes else 'no mistakes'}", GAP, HEADER_HEIGHT - GAP)
    for index, mistake in enumerate(mistakes):
        row, column = divmod(index, column_count)
        left = GAP + column * column_width
        top = HEADER_HEIGHT + row * row_height
        bottom = top + TILE_SIZE
        sheet[top:bottom, left : left + TILE_SIZE] = _draw_tile(mistake)
        _write_text(sheet, f"{index + 1}. {mistake.text}"[:MAX_TEXT_LENGTH], left, bottom + 15)
        _write_text(sheet, mistake.sample.file[:MAX_TEXT_LENGTH], left, bottom + 32)
    return sheet


def _draw_tile(mistake: Mistake) -> Picture:
    """Return a crop around a mistake with true and detected boxes, `(TILE_SIZE, TILE_SIZE, 3)` RGB."""
    import supervision as sv  # See `AveragePrecision`.

    left, top, right, bottom = mistake.box
    crop_size = max(CROP_SCALE * max(right - left, bottom - top), MIN_CROP_SIZE)
    crop_corner = np.array([left + right - crop_size, top + bottom - crop_size]) / 2
    zoom = TILE_SIZE / crop_size
    # The centre of pixel i is at i + 0.5 in the coordinates of boxes, and at i in the coordinates of OpenCV.
    shift = zoom * (0.5 - crop_corner) - 0.5
    matrix = np.array([[zoom, 0.0, shift[0]], [0.0, zoom, shift[1]]])
    image = mistake.sample.image[..., ::-1]  # The annotators expect BGR.
    tile: Any = cv2.warpAffine(image, matrix, (TILE_SIZE, TILE_SIZE), flags=cv2.INTER_CUBIC)
    detected_boxes = [detection.box for detection in mistake.detections]
    for annotator, boxes, colour in (
        (sv.BoxAnnotator, detected_boxes, DETECTED_COLOUR),
        (sv.BoxCornerAnnotator, mistake.sample.boxes, TRUE_COLOUR),
    ):
        tile_boxes = ((np.array(boxes).reshape(-1, 2, 2) - crop_corner) * zoom).reshape(-1, 4)
        detections = sv.Detections(tile_boxes, class_id=np.zeros(len(boxes), int))
        tile = annotator(sv.Color.from_hex(colour), LINE_THICKNESS).annotate(tile, detections)
    return np.asarray(tile[..., ::-1], dtype=np.uint8)


def _write_text(picture: Picture, text: str, left: int, baseline: int) -> None:
    cv2.putText(picture, text, (left, baseline), cv2.FONT_HERSHEY_SIMPLEX, 0.42, TEXT_COLOUR, 1, cv2.LINE_AA)
