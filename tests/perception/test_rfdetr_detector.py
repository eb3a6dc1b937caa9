"""A detector built around a model: crops, names and options."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from executive.cell.config import DetectorConfig
from executive.cell.frame import Detection
from executive.errors import InputError
from executive.perception.detectors.detector_registry import DetectorContext
from executive.perception.detectors.rfdetr import LABELS_PATH, MODEL_PATH, EmbeddedDetector, RfdetrDetector

ONNX = str(MODEL_PATH)


class BrightSpots:
    """A model that finds the bounding box of what is brighter than half."""

    def detect(self, image, min_confidence):
        rows, columns = np.nonzero(image[..., 0] > 127)
        if not len(rows):
            return []
        box = (float(columns.min()), float(rows.min()), float(columns.max() + 1), float(rows.max() + 1))
        return [Detection("spot", 0.9, box)]


def show_spot(left, top):
    image = np.zeros((480, 640, 3), np.uint8)
    image[top : top + 20, left : left + 20] = 255
    return SimpleNamespace(image=image)


def make_context(base=None):
    camera = SimpleNamespace(table_view=(192, 100, 448, 356))
    return DetectorContext("eye", camera, base, seed=0, get_detector=None)


def find_spots(left, top, view):
    """Return the spots that a model finds."""
    detector = RfdetrDetector(BrightSpots(), DetectorConfig(kind="rfdetr"), make_context(), {})
    return detector.detect(show_spot(left, top), view)


@pytest.mark.parametrize(("left", "top"), [(0, 0), (620, 460), (180, 240)])
def test_the_full_view_finds_an_object_anywhere_exactly_once(left, top):
    (found,) = find_spots(left, top, "full")
    assert found.box == pytest.approx((left, top, left + 20, top + 20))


def configure(kind, **options):
    return DetectorConfig(kind=kind.__name__, **options)


def test_any_exported_model_can_be_used_by_path_and_the_embedded_one_needs_no_options(tmp_path):
    (tmp_path / "model.onnx").symlink_to(MODEL_PATH)
    (tmp_path / "names.txt").write_text("one\ntwo\nthree\n")
    mine = configure(RfdetrDetector, model_path="model.onnx", labels="names.txt", threshold=0.6)
    for kind, config in ((RfdetrDetector, mine), (EmbeddedDetector, configure(EmbeddedDetector))):
        detector = kind.from_config(config, make_context(tmp_path))
        assert detector.detect(show_spot(640, 480), "table") == []


WRONG = [
    (RfdetrDetector, {"labels": ["a"]}, "model_path", 'option "model_path".*field required'),
    (RfdetrDetector, {"model_path": "m.onnx", "labels": ["a"]}, "model_path", "no model file .*m.onnx"),
    (RfdetrDetector, {"model_path": ONNX, "labels": ["a"]}, "model_path", "3 classes, but .* 1 labels: a"),
    (RfdetrDetector, {"model_path": ONNX, "labels": "no.txt"}, "labels", "no label file .*no.txt"),
    (RfdetrDetector, {"model_path": ONNX, "labels": ONNX}, "labels", "embedded.onnx is larger than 1000000"),
    (RfdetrDetector, {"model_path": ONNX, "labels": ["a"], "class_map": {"b": "cube"}}, "class_map",
     "contains b, which the model cannot find; the classes of the model are a"),
    (EmbeddedDetector, {"model_path": ONNX}, "model_path", 'option "model_path".*the options are none'),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "options", "option", "text"), WRONG)
def test_a_wrong_option_is_said_in_a_sentence_before_and_at_the_start(tmp_path, kind, options, option, text):
    ((found, sentence),) = kind.check(configure(kind, **options), tmp_path, {})
    assert found == option
    with pytest.raises(InputError, match=text) as caught:
        kind.from_config(configure(kind, **options), make_context(tmp_path))
    assert str(caught.value) == sentence


def test_the_labels_are_the_cells_names_and_no_model_is_read_for_them(tmp_path):
    (tmp_path / "names.txt").write_text("one\ntwo\n")

    def labels(**options):
        return RfdetrDetector.labels(configure(RfdetrDetector, **options), tmp_path)

    assert labels(model_path="m.onnx", labels="names.txt", class_map={"one": "cube"}) == ("cube", "two")
    assert labels() is labels(model_path="m.onnx", labels="no.txt") is None
    shipped = EmbeddedDetector.labels(configure(EmbeddedDetector), tmp_path)
    assert shipped == tuple(LABELS_PATH.read_text().split())
