"""`executive evaluate`: what is measured on what, what is printed, and what a wrong option gives."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from executive.cli.main import main
from executive.vision.dataset import Entry, image_path, save_image, write_annotations
from executive.vision.detectors.embedded import LABELS, MODEL


@pytest.fixture
def dataset(tmp_path):
    """A labelled image with an object that nobody can find: it is all grey."""
    root = tmp_path / "grey"
    save_image(image_path(root, "coco", "test", "a.jpg"), np.full((120, 160, 3), 128, np.uint8))
    entry = Entry("test", "a.jpg", (160, 120), ("cube",), ((10.0, 10.0, 60.0, 60.0),))
    write_annotations(root, "coco", [entry], ("cube", "sphere", "duck"))
    return root


@pytest.fixture
def evaluate():
    """Runs the command."""
    return lambda *arguments: CliRunner().invoke(main, ["evaluate", *map(str, arguments)])


def test_a_cells_detector_is_measured_as_in_a_run_with_a_sheet_of_its_worst_misses(evaluate, tmp_path):
    sheet = tmp_path / "sheet.png"
    result = evaluate(
        "--cell", "overhead", "--as-run", "--images", 1, "--workers", 1, "--json", "--sheet", sheet
    )
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    measured = told["measured"]["overhead"]
    assert (measured["detector"], measured["kind"], measured["images"]) == ("embedded", "embedded", 1)
    assert measured["recall"] == 1
    assert measured["localized"]["median"] < 5
    assert set(measured["reliability"]["stated"]) == {"misses", "confused", "invented", "jitter"}
    assert "overhead, detector embedded" in result.stderr
    assert "misses: " in result.stderr
    assert f"worst in {sheet}" in result.stderr
    assert cv2.imread(str(sheet)) is not None


def test_a_dataset_is_measured_on_without_any_cell(evaluate, dataset):
    result = evaluate("--dataset", dataset, "--json")
    assert result.exit_code == 0, result.output
    measured = json.loads(result.stdout)["measured"][str(dataset)]
    assert (measured["detector"], measured["images"], measured["objects"], measured["recall"]) == (
        "embedded", 1, 1, 0,
    )  # fmt: skip
    assert measured["confusion"] == {"cube": {"nothing": 1}}


def test_a_cells_detector_is_measured_on_a_dataset(evaluate, dataset):
    result = evaluate("--cell", "wrist", "--detector", "embedded", "--dataset", dataset, "--json")
    assert result.exit_code == 0, result.output
    assert list(json.loads(result.stdout)["measured"]) == [f"wrist on {dataset}"]


def test_a_model_file_is_measured_with_its_labels(evaluate, dataset):
    result = evaluate(
        "--weights", MODEL, "--labels", LABELS, "--dataset", dataset, "--threshold", 0.9, "--json"
    )
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert told["weights"] == str(MODEL)
    assert told["measured"][str(dataset)]["threshold"] == 0.9


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ("--cell", "overhead", "--detector", "embeded"),
            'the cell overhead has no detector "embeded". Did you mean "embedded"? Its detectors: embedded.',
        ),
        (
            ("--cell", "overhead", "--detector", "embedded", "--weights", "m.onnx"),
            "--detector is of a cell and --weights a model file; give one of them",
        ),
        (("--detector", "eye", "--dataset", "."), "--detector eye is of which cell? Name it with --cell"),
        (("--labels", "names.txt"), "--labels are those of a model file; name it with --weights"),
        (
            ("--as-run", "--dataset", "."),
            "--as-run renders scenes, and --dataset brings images; give one of them",
        ),
        (("--view", "full"), "--view full is a part of a run's frame; give --as-run with it"),
        (
            ("--cell", "fruit"),
            "and fruit is of kind fake; measure its detector on images of your own with --dataset",
        ),
        (("--dataset", "."), ". holds no labelled images"),
        (("--weights", "no.onnx", "--labels", LABELS, "--dataset", "grey"), "there is no model file"),
        (("--sheet", "sheet.gif"), '"sheet.gif" is no picture; its name must end in .png, .jpg, .jpeg'),
    ],
)
def test_options_that_make_no_sense_are_explained(evaluate, dataset, monkeypatch, arguments, sentence):
    monkeypatch.chdir(dataset.parent)
    result = evaluate(*arguments)
    assert result.exit_code == 2
    assert sentence in result.stderr


def test_a_detector_that_cannot_be_built_is_told_before_anything_is_rendered(evaluate, missions, tmp_path):
    text = (missions / "cells" / "overhead.yaml").read_text(encoding="utf-8")
    cell = tmp_path / "mine.yaml"
    options = "kind: rfdetr\n    model_path: none.onnx\n    labels: [cube]"
    cell.write_text(text.replace("kind: embedded", options), encoding="utf-8")
    result = evaluate("--cell", cell)
    assert result.exit_code == 2
    assert "detector embedded: there is no model file" in result.stderr
    assert "rendering" not in result.stderr
