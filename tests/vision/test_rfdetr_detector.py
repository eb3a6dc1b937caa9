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
from executive.vision.detectors.setting import Setting

TABLE = (192, 100, 448, 356)
ONNX = str(MODEL)


class Clock:
    now = 0.0
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


def detector_around(model):
    return RfdetrDetector(model, DetectorConfig(kind="rfdetr"), setting())


def setting(base=None):
    return Setting("eye", camera(), Clock(), base, seed=0, other=None)


def search(detector, frame, view):
    """Return what the detector finds, waited for on its clock."""
    request = detector.request(frame, view)
    detector._setting.clock.now += 0.05
    assert request.ready
    try:
        return request.result().found
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
    assert search(detector_around(BrightSpots(256)), frame_with_spot(20, 20), "table") == ()


@pytest.mark.parametrize(("left", "top"), [(0, 0), (250, 100), (620, 460), (180, 240)])
def test_the_full_view_finds_an_object_anywhere_exactly_once(left, top):
    (found,) = search(detector_around(BrightSpots(256)), frame_with_spot(left, top), "full")
    assert found.box == pytest.approx((left, top, left + 20, top + 20))


def camera():
    return CameraConfig(
        mount="fixed", position=(0.5, 0, 1.2), look_at=(0.5, 0, 0), up=(1, 0, 0), fov_deg=55,
        table_view=TABLE, scan_poses=("home",),
    )  # fmt: skip


def configured(kind, **options):
    return DetectorConfig(kind=kind.__name__, **options)


def build(kind, base, **options):
    return kind.from_config(configured(kind, **options), setting(base))


def test_any_exported_model_can_be_used_by_path(tmp_path):
    (tmp_path / "model.onnx").symlink_to(MODEL)
    (tmp_path / "names.txt").write_text("one\ntwo\nthree\n")
    detector = build(RfdetrDetector, tmp_path, model_path="model.onnx", labels="names.txt", threshold=0.6)
    assert search(detector, frame_with_spot(300, 200), "table") == ()


def test_the_embedded_detector_needs_no_options(tmp_path):
    detector = build(EmbeddedDetector, tmp_path, threshold=0.6)
    assert search(detector, frame_with_spot(300, 200), "table") == ()


def test_an_answer_shows_after_the_latency_with_its_detector_and_the_cells_names():
    config = DetectorConfig(kind="rfdetr", threshold=0.6, misses=0.2)
    detector = RfdetrDetector(BrightSpots(256), config, setting(), {"spot": "cube"})
    clock = detector._setting.clock
    clock.now = 1.0
    request = detector.request(frame_with_spot(300, 200), "table")
    clock.now = 1.04
    assert not request.ready
    clock.now = 1.05
    answer = request.result()
    detector.close()
    assert (answer.detector, answer.reliability) == ("eye", config.reliability)
    assert [found.label for found in answer.found] == ["cube"]


WRONG = [
    (RfdetrDetector, {"labels": ["a"]}, "model_path", 'option "model_path".*field required'),
    (RfdetrDetector, {"model_path": ONNX, "labels": 3}, "labels", 'option "labels.*" .* valid'),
    (RfdetrDetector, {"model_path": ONNX, "labels": ["a"], "c": 1}, "c", 'option "c".*not permitted'),
    (RfdetrDetector, {"model_path": "m.onnx", "labels": ["a"]}, "model_path", "no model file .*m.onnx"),
    (RfdetrDetector, {"model_path": ONNX, "labels": "no.txt"}, "labels", "no label file .*no.txt"),
    (RfdetrDetector, {"model_path": ONNX, "labels": "empty.txt"}, "labels", "empty.txt is empty"),
    (RfdetrDetector, {"model_path": ONNX, "labels": ONNX}, "labels", "embedded.onnx cannot be read: .*utf-8"),
    (
        RfdetrDetector,
        {"model_path": ONNX, "labels": ["a"], "class_map": {"b": "cube"}},
        "class_map",
        "class_map .* names b, which the model does not know; it knows a",
    ),
    (EmbeddedDetector, {"model_path": ONNX}, "model_path", 'option "model_path".*its options: none'),
]


@pytest.mark.parametrize(("kind", "options", "option", "text"), WRONG)
def test_a_wrong_option_is_said_in_a_sentence_before_and_at_the_start(tmp_path, kind, options, option, text):
    (tmp_path / "empty.txt").touch()
    ((found, sentence),) = kind.check(configured(kind, **options), tmp_path, {})
    assert found == option
    with pytest.raises(InputError, match=text) as caught:
        build(kind, tmp_path, **options)
    assert str(caught.value) == sentence


def test_every_wrong_option_is_found_at_once(tmp_path):
    config = configured(RfdetrDetector, colour=1, threads=0, model_path="m.onnx", labels=["a"])
    assert [option for option, _ in RfdetrDetector.check(config, tmp_path, {})] == ["threads", "colour"]
    config = configured(RfdetrDetector, model_path="m.onnx", labels="no.txt")
    assert [option for option, _ in RfdetrDetector.check(config, tmp_path, {})] == ["model_path", "labels"]


def test_the_labels_are_the_cells_names_and_no_model_is_read_for_them(tmp_path):
    (tmp_path / "names.txt").write_text("one\ntwo\n")
    options = {"model_path": "missing.onnx", "labels": "names.txt", "class_map": {"one": "cube"}}
    assert RfdetrDetector.labels(configured(RfdetrDetector, **options), tmp_path) == ("cube", "two")
    assert EmbeddedDetector.labels(configured(EmbeddedDetector), tmp_path) == tuple(
        LABELS.read_text().split()
    )


@pytest.mark.parametrize("options", [{}, {"model_path": "m.onnx", "labels": "no.txt"}])
def test_labels_that_the_options_do_not_say_are_not_known(tmp_path, options):
    assert RfdetrDetector.labels(configured(RfdetrDetector, **options), tmp_path) is None
