"""Camera and detectors of the fake cell: blank images, and detections of the true objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CameraConfig, DetectorConfig, TableConfig
from executive.cell.detection import Detection
from executive.cell.frame import Box, Frame
from executive.cell.protocols import Clock
from executive.cells.fake.world import FakeWorld
from executive.errors import Unavailable
from executive.geometry import Pose
from executive.perception.camera_model import MountedCamera, compute_hull_mask
from executive.perception.detectors.requests import PendingSearch

DEFAULT_CONFIDENCE = 0.9
"""Confidence of the detections of a fake detector, unless the threshold in the cell file is higher."""


class FakeCamera(MountedCamera):
    """A camera at the pose of the cell file, with blank images.

    Attributes:
        is_table_visible: Function that returns True if the whole workspace is in the image, by default
            without regard to occlusion; set by tests.
        occluded_regions: Regions of the image that frames mark as occluded [pixel]; set by tests.
        displacement_message: Message about a displacement of the camera, "" for none; set by tests.
    """

    def __init__(
        self,
        name: str,
        config: CameraConfig,
        table: TableConfig,
        get_flange_pose: Callable[[], Pose],
        clock: Clock,
        get_change_count: Callable[[], int],
    ) -> None:
        super().__init__(name, config, get_flange_pose, clock, get_change_count)
        self.is_table_visible: Callable[[], bool] = self._is_table_in_image
        self.occluded_regions: list[Box] = []
        self.displacement_message = ""
        self._corners = np.array([(x, y, 0.0) for x in table.x for y in table.y])

    def sees_table(self) -> bool:
        """Return the result of `is_table_visible`."""
        return self.is_table_visible()

    def describe_displacement(self, frame: Frame) -> str:
        """Return the value of `displacement_message`."""
        del frame
        return self.displacement_message

    def _capture_images(self) -> tuple[NDArray[np.uint8], None]:
        return np.zeros((self.config.height, self.config.width, 3), dtype=np.uint8), None

    def _compute_visibility_mask(self, X_WC: Pose) -> NDArray[np.bool_]:
        del X_WC
        mask = np.ones((self.config.height, self.config.width), dtype=bool)
        for left, top, right, bottom in self.occluded_regions:
            mask[int(top) : int(bottom), int(left) : int(right)] = False
        return mask

    def _is_table_in_image(self) -> bool:
        return compute_hull_mask(self._corners, self.matrix, self._compute_pose(), self._size) is not None


@dataclass(eq=False)
class FakeDetector:
    """A detector that finds every object in a view, unless a test replaces `make_answer`.

    Attributes:
        name: Name of the detector in the cell file.
        config: Section of the detector in the cell file.
        world: The world with the true objects.
        clock: Clock of the run.
        get_view_region: Returns the image region [pixel] of a view, which is `table` or `full`.
        make_answer: Returns the detections, or a message if the detector is unavailable. Its arguments are
            the number of the request (from 1) and the true detections.
        request_count: Number of requests so far.
    """

    name: str
    config: DetectorConfig
    world: FakeWorld
    clock: Clock
    get_view_region: Callable[[str], Box]
    make_answer: Callable[[int, Sequence[Detection]], Sequence[Detection] | str] = field(
        default=lambda _request_number, true_detections: true_detections
    )
    request_count: int = 0

    def request(self, frame: Frame, view: str) -> PendingSearch:
        """Return a request for the objects in a view of a frame, with the latency of the cell file."""
        self.request_count += 1
        left, top, right, bottom = self.get_view_region(view)
        true_detections = []
        for fake_object in self.world.objects:
            x, y, depth = frame.matrix @ frame.X_WC.inverse().apply(fake_object.position)
            if depth <= 0 or fake_object is self.world.held_object:
                continue
            column, row = x / depth, y / depth
            if left <= column < right and top <= row < bottom:
                half_side = frame.matrix[0, 0] / depth * self.world.classes[fake_object.label].radius
                box = (column - half_side, row - half_side, column + half_side, row + half_side)
                confidence = max(DEFAULT_CONFIDENCE, self.config.threshold)
                true_detections.append(Detection(fake_object.label, confidence, box))
        answer = self.make_answer(self.request_count, true_detections)
        future: Future[list[Detection]] = Future()
        if isinstance(answer, str):
            future.set_exception(Unavailable(answer))
        else:
            future.set_result(list(answer))
        due_time = self.clock.now + self.config.latency
        return PendingSearch(future, due_time, self.clock, self.name, self.config.error_rates)

    def close(self) -> None:
        """Do nothing: the detector holds no resources."""
