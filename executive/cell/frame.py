"""Camera images, the detections in them, and error rates of detectors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from executive.events import Event
from executive.geometry import Array, Pose, Yaw

Box = tuple[float, float, float, float]
"""Left, top, right and bottom side [pixel] of a box in an image; pixel i covers [i, i + 1)."""

TYPICAL_OBJECT_POINTS = 0.03 * np.array([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
"""Points `(5, 3)` [m] of a typical object relative to its centre: the centre and four outline points."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One camera image with the pose of the camera at capture.

    Attributes:
        id: Number of the frame in this run, unique over all cameras.
        camera: Name of the camera.
        image: Image `(H, W, 3)` uint8, RGB.
        depth: Depth image `(H, W)` [m] along the optical axis, NaN for pixels without a measurement; None
            for a camera without a depth sensor.
        matrix: Camera matrix `(3, 3)` [pixel].
        X_WC: Camera pose in the world at capture, in the convention of OpenCV (z forward, y down).
        stamp: Capture time on the clock of the run [s].
        visible: Mask `(H, W)`, False for pixels that the arm may occlude at its measured joint positions, and
            for pixels at the border of an image with a partial view (`CameraConfig.partial_views`).
        change_count: Number of robot actions that may have moved objects before the capture.
    """

    id: int
    camera: str
    image: NDArray[np.uint8]
    depth: Array | None
    matrix: Array
    X_WC: Pose
    stamp: float
    visible: NDArray[np.bool_]
    change_count: int

    def compute_visible_fraction(self, box: Box) -> float:
        """Return the fraction of a box (0 to 1) that the arm does not occlude."""
        height, width = self.visible.shape
        left, right = (min(max(round(x), 0), width) for x in box[::2])
        top, bottom = (min(max(round(y), 0), height) for y in box[1::2])
        crop = self.visible[top:bottom, left:right]
        return float(crop.mean()) if crop.size else 0.0

    def compute_area_mask(self, points: Array, area: Box, margin: float = 0.0) -> NDArray[np.bool_]:
        """Return a mask `(N,)` of the points whose projections lie in a region of the image.

        Args:
            points: Points in the world `(N, 3)` [m].
            area: Region of the image [pixel].
            margin: Minimum distance of a projection from the border of the region [pixel].
        """
        x, y, is_in_front = self._project(points)
        left, top, right, bottom = area
        is_inside_x = (left + margin <= x) & (x < right - margin)
        is_inside_y = (top + margin <= y) & (y < bottom - margin)
        return np.asarray(is_in_front & is_inside_x & is_inside_y)

    def compute_unoccluded_mask(self, points: Array) -> NDArray[np.bool_]:
        """Return a mask `(N,)` of the points `(N, 3)` [m] where the arm would hide no part of an object.

        A typical object is assumed at each point. A point outside the image counts as the nearest pixel.
        """
        mask = np.ones(len(points), dtype=bool)
        height, width = self.visible.shape
        for offset in TYPICAL_OBJECT_POINTS:
            x, y, is_in_front = self._project(points + offset)
            columns = x.astype(int).clip(0, width - 1)
            rows = y.astype(int).clip(0, height - 1)
            mask &= is_in_front & self.visible[rows, columns]
        return mask

    def compute_depth(self, position: Array) -> float:
        """Return the distance [m] of a world point `(3,)` [m] from the camera, along the optical axis."""
        return float(self.X_WC.inverse().apply(position)[2])

    def to_opencv(self) -> tuple[Array, Array, Array]:
        """Return the camera parameters of OpenCV: matrix `(3, 3)`, rvec `(3,)` [rad] and tvec `(3,)` [m].

        Add 0.5 to each result of `cv2.projectPoints(points, rvec, tvec, matrix, None)`, because pixel centres
        have integer coordinates in OpenCV; in this project, pixel i covers [i, i + 1).
        """
        matrix = self.matrix.copy()
        matrix[:2, 2] -= 0.5
        X_CW = self.X_WC.inverse()
        return matrix, X_CW.rotation_vector, X_CW.position

    def _project(self, points: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return x, y `(N,)` [pixel] of points `(N, 3)` [m], and a mask of points in front of the camera."""
        X_CW = self.X_WC.inverse()
        x, y, depth = self.matrix @ X_CW.rotation @ points.T + (self.matrix @ X_CW.position)[:, None]
        # A division by infinity avoids warnings for points behind the camera.
        divisor = np.where(depth > 0, depth, np.inf)
        return x / divisor, y / divisor, depth > 0


@dataclass(frozen=True)
class FrameCaptured(Event):
    """A frame was captured. The journal does not contain this event, because the image is too large.

    Attributes:
        frame: The frame with its image.
    """

    is_recorded = False
    frame: Frame


@dataclass(frozen=True)
class ErrorRates:
    """Error rates of a detector in its cell, measured by `executive evaluate` or assumed.

    Attributes:
        threshold: Confidence below which a detection is doubtful, 0 to 1.
        miss_rate: Fraction of the completely visible objects that the detector misses in a frame.
        confusion_rate: Fraction of the detected objects that get a wrong class.
        false_detections: Mean number of false detections (false positives) per frame.
        jitter: Standard deviation of the random error of a box's centre along each axis of the image [pixel].
        repeated: Fraction of the errors that occur again in a second frame from the same camera pose.
        bias: Standard deviation of the systematic error of an object's position, along each axis [m].
        assumption_reason: Reason why the rates are assumed; "" if they are measured.
        blindness: Reason why the image cannot prove that the table is empty, or "".
    """

    threshold: float
    miss_rate: float
    confusion_rate: float
    false_detections: float
    jitter: float
    repeated: float = 0.0
    bias: float = 0.0
    assumption_reason: str = ""
    blindness: str = ""


def assume_rates(threshold: float, reason: str) -> ErrorRates:
    """Return conservative error rates for a detector without a measurement under the current conditions.

    In unusual scenes, the embedded detector missed 4 % of the objects, confused 5 % of the objects, and
    repeated most errors in each frame of a scene. Each assumed rate is at least as high.
    """
    return ErrorRates(
        threshold, miss_rate=0.15, confusion_rate=0.05, false_detections=0.2, jitter=2.0, repeated=0.8,
        bias=0.002, assumption_reason=reason,
    )  # fmt: skip


@dataclass(frozen=True)
class Detection:
    """One object that a detector reports.

    Attributes:
        label: Class name.
        confidence: Confidence, 0 to 1.
        box: Bounding box of the whole object in the image [pixel].
        second_confidence: Confidence of the second most probable class of the box, 0 to 1; 0 if unknown.
        outline: Polygon around the object in the image, x and y of each vertex [pixel]; None if unknown.
    """

    label: str
    confidence: float
    box: Box
    second_confidence: float = 0.0
    outline: tuple[tuple[float, float], ...] | None = None
    omits_none: ClassVar[bool] = True

    @property
    def centre(self) -> tuple[float, float]:
        """Centre x and y of the box [pixel]."""
        left, top, right, bottom = self.box
        return (left + right) / 2, (top + bottom) / 2

    def shift(self, x: float, y: float) -> Detection:
        """Return the detection with box and outline shifted by `x` and `y` [pixel]."""
        left, top, right, bottom = self.box
        box = (left + x, top + y, right + x, bottom + y)
        outline = self.outline and tuple((u + x, v + y) for u, v in self.outline)
        return replace(self, box=box, outline=outline)


@dataclass(frozen=True, eq=False)
class Region:
    """A region of an image that shows neither the empty table nor a known object.

    Attributes:
        box: Bounding box of the region in the image [pixel].
        position: Centre of the region on the table `(3,)` [m].
        text: Sentence that describes the region.
    """

    box: Box
    position: Array
    text: str


class BinAppearance(NamedTuple):
    """What a frame shows of a bin.

    Attributes:
        contradiction: "" if the bin is as declared, otherwise a sentence; None if too little is in view.
        area: Area that differs from the floor of the bin [m²]; None if too little of the floor is in view.
        is_whole: True if the whole floor is in view.
    """

    contradiction: str | None = None
    area: float | None = None
    is_whole: bool = False


@dataclass(frozen=True, eq=False)
class TrueFrame(Frame):
    """A frame of a fake or simulated world with ground truth.

    Attributes:
        true_detections: Detections, with confidence 1, of all objects that a perfect detector finds.
    """

    true_detections: tuple[Detection, ...]


@dataclass(frozen=True)
class Answer:
    """Result of a detector for one frame: its detections, grouped by certainty.

    Attributes:
        detector: Name of the detector in the cell file.
        confident: Confident detections of known classes, most confident first.
        error_rates: Error rates of the detector.
        doubtful: Detections with a confidence below the threshold, or with a second class that has more than
            half of the confidence of the first class.
        unknown: Detections with labels that the cell file does not declare, above the threshold.
    """

    detector: str
    confident: tuple[Detection, ...]
    error_rates: ErrorRates
    doubtful: tuple[Detection, ...] = ()
    unknown: tuple[Detection, ...] = ()

    def describe_doubt(self, detection: Detection) -> str:
        """Return the message that no detection is confident; `detection` is the best doubtful detection."""
        doubt = f"below the threshold {self.error_rates.threshold:.2f}"
        if detection.confidence >= self.error_rates.threshold:
            doubt = f"and {detection.second_confidence:.2f} for another class"
        return (
            f"detector {self.detector} found nothing certain: at best a {detection.label} "
            f"with confidence {detection.confidence:.2f}, {doubt}"
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Detections(Answer):
    """Detections of a detector in one frame, with the frame and the searched region of its image.

    Attributes:
        frame: The searched frame.
        view: Name of the searched region of the image: `table` (the workspace) or `full`.
        area: Searched region of the image: left, top, right and bottom side [pixel].
    """

    frame: Frame
    view: str
    area: Box

    def compute_searched_mask(self, points: Array) -> NDArray[np.bool_]:
        """Return a mask `(N,)` of the world points `(N, 3)` [m] that are searched and unoccluded."""
        mask = self.frame.compute_area_mask(points, self.area)
        mask[mask] = self.frame.compute_unoccluded_mask(points[mask])
        return mask


@dataclass(frozen=True, eq=False)
class Observation:
    """A detection localized in the world.

    Attributes:
        detection: The detection.
        position: Centre of the object `(3,)` [m] in the world.
        std: Standard deviation of the random error of the position along each axis [m].
        stamp: Capture time of the image [s].
        is_confident: False if the detection is in `Answer.doubtful`, or if `contradiction` is not empty.
        contradiction: Sentence that states how the size or height contradicts the detected class, or "".
        yaw: Angle of the object in the world; None if it is unknown.
    """

    detection: Detection
    position: Array
    std: float
    stamp: float
    is_confident: bool = True
    contradiction: str = ""
    yaw: Yaw | None = None

    def __post_init__(self) -> None:
        # The ledger keeps the same array, which no skill may change.
        self.position.flags.writeable = False
