"""The values that skills, cells and records hand each other: frames, detections, targets, bins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.geometry import Array, Pose

Box = tuple[float, float, float, float]
"""Left, top, right, bottom [pixel] in a frame's image; pixel i covers [i, i + 1)."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One camera image with everything needed to use it later, wherever the camera is then.

    Attributes:
        id: Number of the frame in this run, unique over all cameras.
        camera: Name of the camera.
        image: `(H, W, 3)` uint8, RGB.
        depth: `(H, W)` [m] along the optical axis, or None for a camera without depth.
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


@dataclass(frozen=True)
class Detection:
    """One object a detector believes to see.

    Attributes:
        label: Class name.
        confidence: 0 to 1.
        box: Bounding box of the whole object [pixel] in the frame's image.
    """

    label: str
    confidence: float
    box: Box

    @property
    def centre(self) -> tuple[float, float]:
        """Centre of the box [pixel]."""
        left, top, right, bottom = self.box
        return (left + right) / 2, (top + bottom) / 2


@dataclass(frozen=True, eq=False)
class Detections:
    """A detector's answer about one frame; an empty one is an answer too.

    Attributes:
        frame: The image looked at.
        found: Detections at or above the threshold, most confident first.
        view: Name of the part of the frame that was searched: `table` or `full`.
        area: That part [pixel].
    """

    frame: Frame
    found: tuple[Detection, ...]
    view: str
    area: Box

    def searched(self, position: Array) -> bool:
        """Tell whether a point `(3,)` [m] of the world lay in the searched part, the arm not before it."""
        x, y, z = self.frame.matrix @ self.frame.X_WC.inverse().apply(position)
        if z <= 0:
            return False
        column, row = x / z, y / z
        left, top, right, bottom = self.area
        if not (left <= column < right and top <= row < bottom):
            return False
        return bool(self.frame.visible[int(row), int(column)])


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

    def contains(self, position: Array) -> bool:
        """Tell whether a point `(3,)` [m] lies over the floor."""
        return bool(np.all(np.abs(position[:2] - self.position[:2]) <= self.size[:2] / 2))


@dataclass(frozen=True)
class ObjectClass:
    """What the cell knows of a class of objects.

    Attributes:
        label: Class name, as the detector says it.
        height: Height of the object as it lies on the table [m].
        radius: Radius of the circle around its outline seen from above [m].
    """

    label: str
    height: float
    radius: float
