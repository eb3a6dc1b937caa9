"""RF-DETR's outputs become detections; wrong files are refused."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from executive.cell.detection import Detection
from executive.errors import InputError
from executive.perception.detectors.embedded import LABELS_PATH, MODEL_PATH
from executive.perception.detectors.onnx_model import OnnxModel, read_labels


@pytest.fixture(scope="module")
def model():
    return OnnxModel(MODEL_PATH, read_labels(LABELS_PATH), threads=1)


@pytest.fixture
def decoded(model, monkeypatch):
    """Returns what the model makes of the runtime's outputs for an image, and the input it gave for them."""

    def decoded(boxes, logits, image):
        given = []

        class Session:
            def run(self, names, inputs):
                given.append((names, inputs["input"]))
                return [np.array([boxes], np.float32), np.array([logits], np.float32)]

        monkeypatch.setattr(model, "_session", Session())
        found = model.detect(image, 0.25)
        ((names, put),) = given
        assert names == ["dets", "labels"]
        return found, put

    return decoded


IMAGE = np.zeros((100, 200, 3), np.uint8)


def test_boxes_are_scaled_and_clipped_to_the_image_and_the_background_is_dropped(decoded):
    found, _ = decoded([[0.5, 0.5, 0.1, 0.2]], [[2.0, -9, -9, 9]], IMAGE)
    assert found == [
        Detection(
            "cube",
            pytest.approx(1 / (1 + np.exp(-2))),
            pytest.approx((90, 40, 110, 60)),
            pytest.approx(1.234e-4, rel=1e-3),
        )
    ]
    (found,), _ = decoded([[0.0, 1.0, 0.2, 0.2]], [[-9, 2.0, -9, -9]], IMAGE)
    assert found.box == pytest.approx((0, 90, 20, 100))


def test_what_is_under_the_floor_is_dropped_and_the_most_confident_comes_first(decoded):
    boxes = [[x, 0.5, 0.1, 0.2] for x in (0.2, 0.5, 0.8)]
    logits = [[0.0, -9, -9, -9], [-9, -9, 3.0, -9], [-2.0, -9, -9, -9]]
    assert [one.label for one in decoded(boxes, logits, IMAGE)[0]] == ["duck", "cube"]


def test_the_input_is_normalized_rgb_of_the_models_size(model, decoded):
    red = np.full((50, 50, 3), (255, 0, 0), np.uint8)
    _, given = decoded([[0.5] * 4], [[-9.0] * 4], red)
    assert given.shape == (1, 3, model.input_size, model.input_size)
    assert given[0, 0] == pytest.approx((1 - 0.485) / 0.229, abs=1e-5)
    assert given[0, 2] == pytest.approx((0 - 0.406) / 0.225, abs=1e-5)


def test_a_larger_image_is_shrunk_to_the_mean_of_all_pixels_and_a_box_is_in_its_pixels(model, decoded):
    striped = np.zeros((4 * model.input_size, 4 * model.input_size, 3), np.uint8)
    striped[:, ::4] = 200
    (found,), given = decoded([[0.5, 0.5, 0.1, 0.2]], [[2.0, -9, -9, -9]], striped)
    assert given[0, 0] == pytest.approx((50 / 255 - 0.485) / 0.229, abs=1e-5)
    side = 4 * model.input_size
    assert found.box == pytest.approx((0.45 * side, 0.4 * side, 0.55 * side, 0.6 * side))


def test_a_file_that_is_no_model_of_these_classes_is_refused(tmp_path):
    with pytest.raises(InputError, match="has 3 classes, but there are 2 labels: cat, dog"):
        OnnxModel(MODEL_PATH, ("cat", "dog"))
    (tmp_path / "model.onnx").write_bytes(b"not a model")
    with pytest.raises(InputError, match="not a model that onnxruntime can run"):
        OnnxModel(tmp_path / "model.onnx", ("cube",))


def test_a_model_with_outputs_of_variable_size_is_refused(model, monkeypatch):
    def node(name, *shape):
        return SimpleNamespace(name=name, shape=shape)

    session = SimpleNamespace(
        get_inputs=lambda: [node("input", 1, 3, 256, 256)],
        get_outputs=lambda: [node("dets", 1, 50, 4), node("labels", 1, 50, "classes")],
    )
    monkeypatch.setattr(model, "_session", session)
    with pytest.raises(InputError, match="input or output of variable size; export it with fixed sizes"):
        model._check_shapes(Path("model.onnx"))
