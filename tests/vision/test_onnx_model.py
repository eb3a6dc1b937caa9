"""RF-DETR's outputs become detections; wrong files are refused."""

from __future__ import annotations

import numpy as np
import pytest

from executive.errors import InputError
from executive.messages import Detection
from executive.vision.detectors.embedded import LABELS, MODEL
from executive.vision.detectors.onnx_model import OnnxModel, read_labels


@pytest.fixture(scope="module")
def model():
    return OnnxModel(MODEL, read_labels(LABELS), threads=1)


class Outputs:
    """Stands for the runtime's session: the same outputs for every input, which it keeps."""

    def __init__(self, boxes, logits):
        self.outputs = [np.array([boxes], np.float32), np.array([logits], np.float32)]
        self.input = None

    def run(self, names, inputs):
        assert names == ["dets", "labels"]
        self.input = inputs["input"]
        return self.outputs


def decoded(model, monkeypatch, boxes, logits, image, floor=0.25):
    session = Outputs(boxes, logits)
    monkeypatch.setattr(model, "_session", session)
    return model.detect(image, floor), session.input


IMAGE = np.zeros((100, 200, 3), np.uint8)


def test_boxes_are_scaled_to_the_image_and_the_background_is_dropped(model, monkeypatch):
    found, _ = decoded(model, monkeypatch, [[0.5, 0.5, 0.1, 0.2]], [[2.0, -9, -9, 9]], IMAGE)
    assert found == [Detection("cube", pytest.approx(1 / (1 + np.exp(-2))), pytest.approx((90, 40, 110, 60)))]


def test_boxes_are_clipped_to_the_image(model, monkeypatch):
    found, _ = decoded(model, monkeypatch, [[0.0, 1.0, 0.2, 0.2]], [[-9, 2.0, -9, -9]], IMAGE)
    assert found[0].box == pytest.approx((0, 90, 20, 100))


def test_what_is_under_the_floor_is_dropped_and_the_most_confident_comes_first(model, monkeypatch):
    boxes = [[0.2, 0.5, 0.1, 0.2], [0.5, 0.5, 0.1, 0.2], [0.8, 0.5, 0.1, 0.2]]
    logits = [[0.0, -9, -9, -9], [-9, -9, 3.0, -9], [-2.0, -9, -9, -9]]
    found, _ = decoded(model, monkeypatch, boxes, logits, IMAGE)
    assert [one.label for one in found] == ["duck", "cube"]


def test_the_input_is_normalized_rgb_of_the_models_size(model, monkeypatch):
    red = np.zeros((50, 50, 3), np.uint8)
    red[..., 0] = 255
    _, given = decoded(model, monkeypatch, [[0.5] * 4], [[-9.0] * 4], red)
    assert given.shape == (1, 3, model.size, model.size)
    assert given[0, 0] == pytest.approx((1 - 0.485) / 0.229, abs=1e-5)
    assert given[0, 2] == pytest.approx((0 - 0.406) / 0.225, abs=1e-5)


def test_the_wrong_number_of_labels_is_refused(tmp_path):
    with pytest.raises(InputError, match="has 3 classes and 2 labels were given: cat, dog"):
        OnnxModel(MODEL, ("cat", "dog"))


def test_a_file_that_is_no_model_is_refused(tmp_path):
    (tmp_path / "model.onnx").write_bytes(b"not a model")
    with pytest.raises(InputError, match="not a model that onnxruntime can run"):
        OnnxModel(tmp_path / "model.onnx", ("cube",))
