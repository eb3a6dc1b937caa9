"""A detector built around a model: crops, names and options."""

from __future__ import annotations

import numpy as np
import pytest

from executive.cell_config import CameraConfig, DetectorConfig
from executive.errors import InputError
from executive.geometry import Pose
from executive.messages import Detection, Frame
from executive.vision.detectors.embedded import LABELS, MODEL, EmbeddedDetector
from executive.vision.detectors.rfdetr import RfdetrDetector

TABLE = (192, 100, 448, 356)


class Clock:
    now = 0.05
    step = 1 / 240

    def sleep(self, duration):
        yield


class BrightSpots:
    """A model that finds the bounding box of what is brighter than half."""

    labels = ("spot",)

    def __init__(self, size):
        self.size = size
        self.shapes = []

    def detect(self, image, floor):
        self.shapes.append(image.shape)
        rows, columns = np.nonzero(image[..., 0] > 127)
        if not len(rows):
            return []
        box = (float(columns.min()), float(rows.min()), float(columns.max() + 1), float(rows.max() + 1))
        return [Detection("spot", 0.9, box)]


def frame_with_spot(left, top, size=20):
    image = np.zeros((480, 640, 3), np.uint8)
    image[top : top + size, left : left + size] = 255
    visible = np.ones((480, 640), bool)
    return Frame(1, "overhead", image, None, np.eye(3), Pose.identity(), 0.0, visible, 0)


def detector_around(model, class_map=None):
    config = DetectorConfig(kind="rfdetr")
    return RfdetrDetector(model, config, table_view=TABLE, clock=Clock(), class_map=class_map)


def search(detector, frame, view):
    request = detector.request(frame, view)
    assert request.ready
    try:
        return request.result()
    finally:
        detector.close()


@pytest.mark.parametrize("size", [256, 128])
def test_a_box_found_in_the_table_view_is_returned_in_the_frames_pixels(size):
    (found,) = search(detector_around(BrightSpots(size)), frame_with_spot(300, 200), "table")
    assert found.box == pytest.approx((300, 200, 320, 220), abs=256 / size)


def test_a_crop_larger_than_the_models_input_is_shrunk_before_the_model_sees_it():
    model = BrightSpots(128)
    search(detector_around(model), frame_with_spot(300, 200), "table")
    assert model.shapes == [(128, 128, 3)]


def test_the_table_view_does_not_show_what_lies_beside_it():
    assert search(detector_around(BrightSpots(256)), frame_with_spot(20, 20), "table") == []


@pytest.mark.parametrize(("left", "top"), [(0, 0), (250, 100), (620, 460), (180, 240)])
def test_the_full_view_finds_an_object_anywhere_exactly_once(left, top):
    (found,) = search(detector_around(BrightSpots(256)), frame_with_spot(left, top), "full")
    assert found.box == pytest.approx((left, top, left + 20, top + 20))


def test_the_class_map_renames_what_the_model_says():
    detector = detector_around(BrightSpots(256), {"spot": "cube"})
    assert detector.labels == ("cube",)
    (found,) = search(detector, frame_with_spot(300, 200), "table")
    assert found.label == "cube"


def camera():
    return CameraConfig(
        mount="fixed", position=(0.5, 0, 1.2), look_at=(0.5, 0, 0), up=(1, 0, 0), fov_deg=55,
        table_view=TABLE, scan_poses=("home",),
    )  # fmt: skip


def build(kind, base, **options):
    config = DetectorConfig(kind=kind.__name__, **options)
    return kind.from_config(config, camera=camera(), clock=Clock(), base=base)


def test_any_exported_model_can_be_used_by_path(tmp_path):
    (tmp_path / "model.onnx").symlink_to(MODEL)
    (tmp_path / "names.txt").write_text("one\ntwo\nthree\n")
    detector = build(
        RfdetrDetector, tmp_path, model_path="model.onnx", labels="names.txt", class_map={"one": "cube"}
    )
    detector.close()
    assert detector.labels == ("cube", "two", "three")


def test_the_embedded_detector_needs_no_options_and_knows_its_labels(tmp_path):
    detector = build(EmbeddedDetector, tmp_path, threshold=0.6)
    detector.close()
    assert detector.threshold == 0.6
    assert detector.labels == tuple(LABELS.read_text().split())


@pytest.mark.parametrize(
    ("kind", "options", "text"),
    [
        (RfdetrDetector, {"labels": ["a"]}, 'option "model_path".*field required'),
        (RfdetrDetector, {"model_path": "m", "labels": ["a"], "colour": 1}, 'option "colour".*not permitted'),
        (RfdetrDetector, {"model_path": "m.onnx", "labels": ["a"]}, "no model file .*m.onnx"),
        (RfdetrDetector, {"model_path": "m.onnx", "labels": "no.txt"}, "no label file .*no.txt"),
        (
            RfdetrDetector,
            {"model_path": "m.onnx", "labels": ["a"], "class_map": {"b": "cube"}},
            "class_map .* names b, which the model does not know; it knows a",
        ),
        (EmbeddedDetector, {"model_path": "m.onnx"}, 'option "model_path".*its options: none'),
    ],
)
def test_wrong_options_are_said_in_a_sentence(tmp_path, kind, options, text):
    with pytest.raises(InputError, match=text):
        build(kind, tmp_path, **options)
