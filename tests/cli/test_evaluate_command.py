"""`executive evaluate`: what is measured on what, what is printed, and what a wrong option gives."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from at_terminal import invoke

from executive.perception.detectors.envelope import read_measurements
from executive.perception.detectors.rfdetr import LABELS_PATH, MODEL_PATH
from executive.training.dataset import DatasetEntry, build_image_path, save_image, write_annotations


@pytest.fixture
def dataset(tmp_path, monkeypatch):
    """A labelled image with an object that nobody can find: it is all grey."""
    root = tmp_path / "grey"
    save_image(build_image_path(root, "coco", "test", "a.jpg"), np.full((120, 160, 3), 128, np.uint8))
    entry = DatasetEntry("test", "a.jpg", (160, 120), ("cube",), ((10.0, 10.0, 60.0, 60.0),))
    write_annotations(root, "coco", [entry], ("cube", "sphere", "duck"))
    monkeypatch.chdir(tmp_path)
    return "grey"


def evaluate(*arguments, code=0):
    """Return what the command says and the figures it prints."""
    result = invoke("evaluate", "--json", *map(str, arguments))
    assert result.exit_code == code, result.output
    return result.stderr, json.loads(result.stdout) if result.stdout else None


@pytest.mark.slow
def test_a_cells_detector_is_measured_as_in_a_run_with_a_sheet_of_its_worst_misses(tmp_path):
    sheet = tmp_path / "sheet.png"
    stored = tmp_path / "overhead.measured.json"
    options = ("--cell", "overhead", "--images", 1, "--workers", 1, "--seed", 2, "--out", stored, "--force")
    said, printed = evaluate(*options, "--sheet", sheet)
    measured = printed["measured"]["overhead"]
    assert (measured["detector"], measured["kind"], measured["images"]) == ("embedded", "embedded", 1)
    assert (measured["recall"], measured["localized"]["median"] < 5) == (1, True)
    (measurement,) = read_measurements(stored)
    assert measurement.detector == "embedded"
    assert measurement.rates.model_dump() == measured["reliability"]["rates"]
    assert measurement.command == "executive evaluate --cell overhead --detector embedded --images 1 --seed 2"
    assert measurement.frames is not None
    for text in (f"stored in {stored}", "overhead, detector embedded", "miss_rate 0.", f"{sheet}: the "):
        assert text in said
    assert cv2.imread(str(sheet)) is not None


@pytest.mark.slow
def test_only_a_measurement_under_the_conditions_of_a_run_is_stored(missions, tmp_path):
    before = sorted((missions / "cells").iterdir())
    scene = tmp_path / "moved.yaml"
    scene.write_text("scene: moved\ncamera: {shift: [0.0, 0.03, 0.0]}\ntable: {objects: [4, 4]}\n")
    options = ("--cell", "overhead", "--images", 1, "--workers", 1)
    _, printed = evaluate(*options, "--scene", scene, "--out", tmp_path / "o.json")
    measured = printed["measured"]["overhead"]
    assert (printed["scene"], measured["objects"]) == (str(scene), 4)
    # The detector does not know the shift, so its objects are localized beside their true positions.
    assert measured["localized"]["median"] == pytest.approx(30, abs=5)
    evaluate(*options, "--threshold", 0, "--out", tmp_path / "o.json")
    assert not (tmp_path / "o.json").exists()
    changed = ("--set", "cell.detectors.embedded.threshold=0.7")
    _, printed = evaluate(*options, *changed)
    assert printed["measured"]["overhead"]["threshold"] == 0.7
    assert sorted((missions / "cells").iterdir()) == before
    evaluate(*options, *changed, "--out", tmp_path / "o.json", "--force")
    assert read_measurements(tmp_path / "o.json")[0].fingerprint["threshold"] == "0.7"


@pytest.mark.parametrize(
    ("arguments", "where", "detector"),
    [
        (
            ("--cell", "wrist", "--detector", "embedded", "--out", "w.json", "--force"),
            "wrist on grey",
            "embedded",
        ),
        (("--weights", MODEL_PATH, "--labels", LABELS_PATH, "--threshold", 0.9), "grey", "model"),
    ],
)
def test_a_dataset_is_measured_on_with_or_without_a_cell_or_a_model_file(dataset, arguments, where, detector):
    _, printed = evaluate("--dataset", dataset, *arguments)
    ((called, measured),) = printed["measured"].items()
    assert (called, measured["detector"], measured["images"], measured["objects"]) == (where, detector, 1, 1)
    assert (measured["recall"], measured["confusion"]) == (0, {"cube": {"nothing": 1}})
    model = detector == "model"
    assert (printed["weights"], measured["threshold"]) == ((str(MODEL_PATH), 0.9) if model else (None, 0.5))


def test_a_weak_measurement_is_printed_but_stored_by_force_only(dataset, tmp_path):
    options = ("--dataset", dataset, "--cell", "overhead", "--out", tmp_path / "o.json")
    said, printed = evaluate(*options, code=2)
    assert "is not stored: 1 cube objects, 0 sphere objects, 0 duck objects, precision 0.00" in said
    assert printed["measured"]["overhead on grey"]["recall"] == 0
    assert not (tmp_path / "o.json").exists()
    evaluate(*options, "--force")
    assert len(read_measurements(tmp_path / "o.json")) == 1


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--cell", "overhead", "--detector", "embeded"), 'no detector "embeded". Did you mean "embedded"?'),
        (("--detector", "eye", "--dataset", "."), "--detector eye needs --cell"),
        (("--labels", "names.txt"), "--labels needs a model file; name it with --weights"),
        (("--out", "o.json"), "--out o.json needs exactly one --cell"),
        (("--set", "attempts=3"), "--set attempts is not a key of a cell; write cell.KEY.KEY=VALUE"),
        (("--cell", "kitting"), "kitting is of kind fake; measure its detector on your own images"),
        (("--dataset", "grey", "--cell", "fasteners"), "is a class of detector fasteners"),
        (("--sheet", "sheet.gif"), "must end in .png, .jpg, .jpeg"),
    ],
)
def test_options_that_make_no_sense_are_explained(dataset, arguments, sentence):
    assert sentence in evaluate(*arguments, code=2)[0]
