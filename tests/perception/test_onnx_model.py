"""RF-DETR's outputs become detections; wrong files are refused."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from onnx_files import make_model

from executive.errors import InputError, Unavailable
from executive.perception.detectors import rfdetr
from executive.perception.detectors.rfdetr import (
    LABELS_PATH,
    MODEL_PATH,
    OnnxModel,
    find_model_errors,
    read_labels,
)


@pytest.fixture(scope="module")
def model():
    return OnnxModel(MODEL_PATH, read_labels(LABELS_PATH), threads=1)


@pytest.fixture
def decode(model, monkeypatch):
    """Returns what the model makes of the runtime's outputs for an image, and the input it gave for them."""

    def decode(boxes, logits, image):
        given = {}

        def run(names, inputs):
            assert names == ["dets", "labels"]
            given.update(inputs)
            return [np.array([boxes], np.float32), np.array([logits], np.float32)]

        monkeypatch.setattr(model, "_session", SimpleNamespace(run=run))
        return model.detect(image, 0.25), given["input"]

    return decode


IMAGE = np.zeros((100, 200, 3), np.uint8)


def test_boxes_are_scaled_and_clipped_to_the_image_and_the_background_is_dropped(decode):
    (found,), _ = decode([[0.5, 0.5, 0.1, 0.2]], [[2.0, -9, -9, 9]], IMAGE)
    assert (found.label, found.box) == ("cube", pytest.approx((90, 40, 110, 60)))
    assert found.confidence == pytest.approx(1 / (1 + np.exp(-2)))
    assert found.second_confidence == pytest.approx(1.234e-4, rel=1e-3)
    (found,), _ = decode([[0.0, 1.0, 0.2, 0.2]], [[-9, 2.0, -9, -9]], IMAGE)
    assert found.box == pytest.approx((0, 90, 20, 100))


def test_what_is_under_the_floor_is_dropped_and_the_most_confident_comes_first(decode):
    boxes = [[x, 0.5, 0.1, 0.2] for x in (0.2, 0.5, 0.8)]
    logits = [[0.0, -9, -9, -9], [-9, -9, 3.0, -9], [-2.0, -9, -9, -9]]
    assert [one.label for one in decode(boxes, logits, IMAGE)[0]] == ["duck", "cube"]


def test_the_input_is_normalized_rgb_of_the_models_size(model, decode):
    red = np.full((50, 50, 3), (255, 0, 0), np.uint8)
    _, given = decode([[0.5] * 4], [[-9.0] * 4], red)
    assert given.shape == (1, 3, *model.input_size)
    assert given[0, 0] == pytest.approx((1 - 0.485) / 0.229, abs=1e-5)
    assert given[0, 2] == pytest.approx((0 - 0.406) / 0.225, abs=1e-5)


def test_a_larger_image_is_shrunk_to_the_mean_of_all_pixels_and_a_box_is_in_its_pixels(model, decode):
    side = 4 * model.input_size[0]
    striped = np.zeros((side, side, 3), np.uint8)
    striped[:, ::4] = 200
    (found,), given = decode([[0.5, 0.5, 0.1, 0.2]], [[2.0, -9, -9, -9]], striped)
    assert given[0, 0] == pytest.approx((50 / 255 - 0.485) / 0.229, abs=1e-5)
    assert found.box == pytest.approx((0.45 * side, 0.4 * side, 0.55 * side, 0.6 * side))


def make_outputs(boxes=(1, 5, 4), logits=(1, 5, 3), kind="float32", value=0.5):
    return {"dets": np.full(boxes, 0.5, kind), "labels": np.full(logits, value, kind)}


def make_images(*shape, kind="float32"):
    return {"image": (kind, shape)}


def write(folder, *model):
    (folder / "model.onnx").write_bytes(make_model(*model))
    return folder / "model.onnx"


@pytest.mark.parametrize(("shape", "kind"), [((1, 3, 8, 16), "float32"), (("batch", 3, 8, 8), "float16")])
def test_a_wide_model_and_a_model_of_half_precision_find_an_object(tmp_path, shape, kind):
    path = write(tmp_path, make_images(*shape, kind=kind), make_outputs(kind=kind))
    (found,) = OnnxModel(path, ("cube", "duck")).detect(IMAGE, 0.25)
    assert (found.label, found.box) == ("cube", (50.0, 25.0, 150.0, 75.0))


REFUSED = [
    *((make_images(*shape), make_outputs(), r"it has image .*; export it with rfdetr")
      for shape in ((4, 3, 8, 8), (1, 8, 8, 3), (1, 1, 3, 8, 8))),
    (make_images(1, 3, 8, 8, kind="uint8"), make_outputs(), "it has image tensor.uint8"),
    (make_images(1, 3, "height", "width"), make_outputs(), "variable size; export it with fixed sizes"),
    ({**make_images(1, 3, 8, 8), "size": ("int64", (1, 2))}, make_outputs(), "it has .* size tensor"),
    (make_images(1, 3, 8, 8), {"output0": np.zeros((1, 84, 9), "float32")}, "it has .* output0"),
    (make_images(1, 3, 8, 8), make_outputs((1, 5, 5), (1, 5), kind="int64"), "it has .* labels tensor.int64"),
    (make_images(1, 3, 8, 8), make_outputs(logits=(1, 5, 4)), "has 3 classes, but there are 2 labels"),
    (make_images(1, 3, 8, 8), make_outputs((1, 0, 4), (1, 0, 3)), r"dets \(1, 0, 4\)"),
    (make_images(1, 3, 8, 8), make_outputs((1, 6, 4)), r"dets \(1, 6, 4\) and labels \(1, 5, 3\)"),
    (make_images(1, 3, 8, 8), make_outputs(value=np.nan), "NaN"),
]  # fmt: skip


@pytest.mark.parametrize(("inputs", "arrays", "text"), REFUSED)
def test_a_model_of_another_kind_is_refused_in_a_sentence(tmp_path, inputs, arrays, text):
    with pytest.raises((InputError, Unavailable), match=text):
        OnnxModel(write(tmp_path, inputs, arrays), ("cube", "duck")).detect(IMAGE, 0.25)


@pytest.mark.parametrize(
    ("content", "remedy"),
    [(b"version https://git-lfs", "git lfs pull"), (b"\n<!DOCTYPE html>", "itself"), (b"", "again")],
)
def test_a_file_that_is_no_model_is_refused_with_a_remedy(tmp_path, content, remedy):
    (tmp_path / "model.onnx").write_bytes(content)
    with pytest.raises(InputError, match=f"model.onnx is not a model .*{remedy}"):
        OnnxModel(tmp_path / "model.onnx", ("cube",))


def test_the_trial_of_a_model_accepts_half_precision(tmp_path):
    path = write(tmp_path, make_images("batch", 3, 8, 8, kind="float16"), make_outputs(kind="float16"))
    assert find_model_errors(path, ("cube", "duck"), 0) == []


def test_the_trial_of_a_model_survives_what_the_model_does(tmp_path, monkeypatch):
    path = write(tmp_path, make_images(1, 3, 8, 8), make_outputs(), "Nonsense")
    assert "onnxruntime can run: Load model from" in find_model_errors(path, ("cube",), 1)[0]
    abort = [sys.executable, "-c", "import os; os.abort()"]
    monkeypatch.setattr(rfdetr, "build_command", lambda *arguments: abort)
    assert "crashes, or takes over" in find_model_errors(path, ("cube",), 2)[0]
