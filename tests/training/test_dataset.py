"""Labelled images are written in both layouts, and read back alike."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml

from executive.errors import InputError
from executive.training.dataset import DatasetEntry, build_image_path, save_image, write_annotations
from executive.training.samples import LabelledDataset

CLASSES = ("cube", "duck")
BOXES = ((10.0, 20.0, 30.0, 60.0), (50.5, 10.25, 60.0, 20.0))
IGNORED = ((100.0, 10.0, 120.0, 30.0),)
ENTRIES = [
    DatasetEntry("valid", "a.jpg", (128, 64), ("duck", "cube"), BOXES, IGNORED, {"camera": "overhead"}),
    DatasetEntry("train", "b.jpg", (128, 64), (), ()),
    DatasetEntry("train", "c.jpg", (128, 64), ("duck",), BOXES[:1]),
]


@pytest.fixture(params=["coco", "yolo"])
def root(request, tmp_path):
    """A data set in one of the layouts, its images all red."""
    for entry in ENTRIES:
        image = np.full((64, 128, 3), (200, 10, 10), np.uint8)
        save_image(build_image_path(tmp_path, request.param, entry.split, entry.file), image)
    write_annotations(tmp_path, request.param, ENTRIES, CLASSES)
    return tmp_path


def test_coco_boxes_are_corner_and_size_and_splits_have_files_of_their_own(tmp_path):
    write_annotations(tmp_path, "coco", ENTRIES, CLASSES)
    train, valid = (
        json.loads((tmp_path / split / "_annotations.coco.json").read_text()) for split in ("train", "valid")
    )
    assert valid["images"] == [{"id": 0, "file_name": "a.jpg", "width": 128, "height": 64}]
    first, second = valid["annotations"]
    assert (first["id"], first["bbox"], first["area"], first["category_id"]) == (1, [10, 20, 20, 40], 800, 1)
    assert (second["id"], second["category_id"]) == (2, 0)
    # RF-DETR drops a class without objects if another class names it as its parent.
    categories = [(category["name"], category["supercategory"]) for category in valid["categories"]]
    assert categories == [(name, name) for name in CLASSES]
    assert (len(train["annotations"]), (tmp_path / "test").exists()) == (1, False)


def test_yolo_boxes_are_centre_and_size_relative_to_the_image(tmp_path):
    write_annotations(tmp_path, "yolo", ENTRIES, CLASSES)
    first, _ = (tmp_path / "valid/labels/a.txt").read_text().splitlines()
    numbers = [float(word) for word in first.split()]
    assert numbers == pytest.approx([1, 20 / 128, 40 / 64, 20 / 128, 40 / 64], abs=1e-6)
    assert (tmp_path / "train/labels/b.txt").read_text() == ""
    data = yaml.safe_load((tmp_path / "data.yaml").read_text())
    assert (data["nc"], data["names"]) == (2, list(CLASSES))
    assert (data["train"], data["val"]) == ("train/images", "valid/images")


def test_the_images_that_no_training_used_are_read_as_they_were_written(root):
    (sample,) = LabelledDataset(root)
    assert (sample.file, sample.labels, sample.image.shape) == ("a.jpg", ("duck", "cube"), (64, 128, 3))
    assert np.array(sample.boxes) == pytest.approx(np.array(BOXES), abs=1e-3)
    assert (sample.ignored_boxes, sample.truth) == (IGNORED, {"camera": "overhead"})
    assert sample.image[30, 60, 0] > 150 > 50 > sample.image[30, 60, 2]
    assert len(LabelledDataset(root)) == 1
    sample, _ = LabelledDataset(root / "train")
    assert (sample.file, sample.labels, sample.boxes, sample.ignored_boxes) == ("b.jpg", (), (), ())


def test_what_cannot_be_written_or_read_is_explained(tmp_path):
    with pytest.raises(InputError, match='"voc" is unknown; use coco or yolo'):
        write_annotations(tmp_path, "voc", ENTRIES, CLASSES)
