"""The values that skills, cells and records hand each other: frames, detections, targets, bins."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.cell.error_rates import ErrorRates
from executive.geometry import Array, Pose

Box = tuple[float, float, float, float]
"""Left, top, right, bottom [pixel] in a frame's image; pixel i covers [i, i + 1)."""

REACH = 0.03
"""How far an object extends around its centre [m], about."""
SURROUNDINGS = REACH * np.array([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)], dtype=float)
"""Steps from the centre of an object to places on it that must be in view for it to be found."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One camera image with everything needed to use it later, wherever the camera is then.

    Attributes:
        id: Number of the frame in this run, unique over all cameras.
        camera: Name of the camera.
        image: `(H, W, 3)` uint8, RGB.
        depth: `(H, W)` [m] along the optical axis, NaN where the sensor gave none; None for a camera
            without depth.
        matrix: Camera matrix `(3, 3)` [pixel].
        X_WC: Camera pose in the world at capture, OpenCV convention (z forward, y down).
        stamp: Capture time on the run's clock [s].
        visible: `(H, W)` bool, False where the arm hides the scene, from its kinematics.
        epoch: Change count of the table at capture (see `Ledger.epoch`).
    """

    id: int
    camera: str
    image: NDArray[np.uint8]
    depth: Array | None
    matrix: Array
    X_WC: Pose
    stamp: float
    visible: NDArray[np.bool_]
    epoch: int

    def visible_share(self, box: Box) -> float:
        """Return the share of a box (0 to 1) in which the arm does not hide the scene."""
        height, width = self.visible.shape
        left, right = (min(max(round(x), 0), width) for x in box[::2])
        top, bottom = (min(max(round(y), 0), height) for y in box[1::2])
        part = self.visible[top:bottom, left:right]
        return float(part.mean()) if part.size else 0.0

    def shows(self, points: Array, area: Box, inset: float = 0.0) -> NDArray[np.bool_]:
        """Tell `(N,)` which points `(N, 3)` [m] of the world lie in a part of the image [pixel].

        `inset` is how far from its border they must lie [pixel].
        """
        pixels, ahead = self._pixels(points)
        left, top, right, bottom = area
        inside = (pixels >= (left + inset, top + inset)) & (pixels < (right - inset, bottom - inset))
        return np.asarray(ahead & inside.all(axis=1))

    def bares(self, points: Array) -> NDArray[np.bool_]:
        """Tell `(N,)` before which points `(N, 3)` [m], and an object there, there is nothing of the arm."""
        bare = np.ones(len(points), dtype=bool)
        height, width = self.visible.shape
        for step in SURROUNDINGS:
            pixels, ahead = self._pixels(points + step)
            columns, rows = pixels.astype(int).clip(0, (width - 1, height - 1)).T
            bare &= ahead & self.visible[rows, columns]
        return bare

    def _pixels(self, points: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return where points appear `(N, 2)` [pixel], and which lie before the camera."""
        in_camera = self.X_WC.inverse().apply(points) @ self.matrix.T
        depth = in_camera[:, 2:]
        return in_camera[:, :2] / np.where(depth > 0, depth, np.inf), depth[:, 0] > 0

    def opencv(self) -> tuple[Array, Array, Array]:
        """Return the camera as OpenCV takes it: matrix `(3, 3)`, rvec `(3,)` [rad] and tvec `(3,)` [m].

        `cv2.projectPoints(points, rvec, tvec, matrix, None)` then gives world points in OpenCV's pixels.
        Those have their centres at whole numbers: add a half for the coordinates used here, where pixel
        i covers [i, i + 1).
        """
        matrix = self.matrix.copy()
        matrix[:2, 2] -= 0.5
        X_CW = self.X_WC.inverse()
        return matrix, X_CW.rotation_vector, X_CW.position


@dataclass(frozen=True)
class Detection:
    """One object a detector believes to see.

    Attributes:
        label: Class name.
        confidence: 0 to 1.
        box: Bounding box of the whole object [pixel] in the frame's image.
        rival: Confidence of the second class for this box, 0 to 1; 0 if unknown.
    """

    label: str
    confidence: float
    box: Box
    rival: float = 0.0

    @property
    def centre(self) -> tuple[float, float]:
        """Centre of the box [pixel]."""
        left, top, right, bottom = self.box
        return (left + right) / 2, (top + bottom) / 2


@dataclass(frozen=True)
class Answer:
    """What a detector says about a frame; an empty answer is one too.

    Attributes:
        detector: Name of the detector that gave it, as in the cell file.
        found: Everything at or above its floor, most confident first.
        error_rates: Error rates of that detector.
    """

    detector: str
    found: tuple[Detection, ...]
    error_rates: ErrorRates


@dataclass(frozen=True, eq=False)
class Detections:
    """What one look found; an empty one is a look too.

    Attributes:
        frame: The image looked at.
        found: Detections at or above the threshold, most confident first.
        detector: Name of the detector that answered.
        error_rates: Error rates of that detector.
        view: Name of the part of the frame that was searched: `table` or `full`.
        area: That part [pixel].
        doubtful: Detections below the threshold or less than twice as likely as another class.
        unknown: Detections at or above the threshold with labels that the cell does not know.
    """

    frame: Frame
    found: tuple[Detection, ...]
    detector: str
    error_rates: ErrorRates
    view: str
    area: Box
    doubtful: tuple[Detection, ...] = ()
    unknown: tuple[Detection, ...] = ()

    def shows(self, points: Array, inset: float = 0.0) -> NDArray[np.bool_]:
        """Tell `(N,)` which points `(N, 3)` [m] of the world lie in the searched part of the image.

        `inset` is how far from its border they must lie [pixel].
        """
        return self.frame.shows(points, self.area, inset)

    def searched(self, points: Array) -> NDArray[np.bool_]:
        """Tell `(N,)` which points `(N, 3)` [m] it shows with nothing of the arm before an object there."""
        return self.shows(points) & self.frame.bares(points)


@dataclass(frozen=True, eq=False)
class Glimpse:
    """A detection that does not count as one.

    It is below the threshold, or `contradiction` is evidence against its class. `position` is `(3,)` [m].
    """

    detection: Detection
    position: Array
    contradiction: str = ""


Item = str
"""Identity of one physical object in the ledger, for instance `cube-2`."""


@dataclass(frozen=True, eq=False)
class Target:
    """A detection localized in the world and bound to an item.

    Attributes:
        item: The object it is believed to be.
        label: Class name.
        position: Centre of the object `(3,)` [m] in the world, at half its known height.
        confidence: The detection's, 0 to 1.
        frame: Id of the frame it was seen in.
        epoch: Change count of the table when it was seen.
        stamp: Time it was seen [s].
    """

    item: Item
    label: str
    position: Array
    confidence: float
    frame: int
    epoch: int
    stamp: float


BIN_THICKNESS = 0.005
"""Thickness of a bin's floor and walls [m]."""


@dataclass(frozen=True, eq=False)
class Bin:
    """A container objects are sorted into.

    Attributes:
        name: Its name in the cell file.
        position: Centre of its floor `(3,)` [m].
        size: Inner length, width and wall height `(3,)` [m].
        slots: Drop positions over the floor `(N, 2)` [m], used in turn.
    """

    name: str
    position: Array
    size: Array
    slots: Array

    def contains(self, position: Array, margin: float = 0.0) -> bool:
        """Tell whether a point `(3,)` [m] lies over the floor, or at most `margin` [m] beside it."""
        return bool(np.all(np.abs(position[:2] - self.position[:2]) <= self.size[:2] / 2 + margin))


@dataclass(frozen=True)
class ObjectClass:
    """What the cell knows of a class of objects.

    Attributes:
        label: Class name, as the detector says it.
        height: Height of the object as it lies on the table [m].
        radius: Radius of the circle around its outline seen from above [m].
        ring: Distance from its middle at which to touch it [m]; more than 0 for parts with a hole.
        mass: [kg]
    """

    label: str
    height: float
    radius: float
    ring: float = 0.0
    mass: float = 0.1


@dataclass(frozen=True)
class Load:
    """What the tool holds.

    Attributes:
        kind: Its class.
        bears: The pull that its seal bears [N].
    """

    kind: ObjectClass
    bears: float = math.inf


@dataclass(frozen=True)
class Obstacle:
    """Something that stands upright in the cell, taken as a cylinder from the table to its top.

    Attributes:
        x, y: Where its axis is [m].
        radius: [m]
        top: Height of its top [m].
        name: What it is, for the text of an error.
    """

    x: float
    y: float
    radius: float
    top: float
    name: str
