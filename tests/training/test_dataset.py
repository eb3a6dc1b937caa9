"""Labelled images are written in both layouts, and read back alike."""

from __future__ import annotations

import numpy as np
import pytest

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


def test_the_images_that_no_training_used_are_read_as_they_were_written(root):
    (sample,) = LabelledDataset(root)
    assert (sample.file, sample.labels, sample.image.shape) == ("a.jpg", ("duck", "cube"), (64, 128, 3))
    assert np.array(sample.boxes) == pytest.approx(np.array(BOXES), abs=1e-3)
    assert (sample.ignored_boxes, sample.truth) == (IGNORED, {"camera": "overhead"})
    assert sample.image[30, 60, 0] > 150 > 50 > sample.image[30, 60, 2]
    assert len(LabelledDataset(root)) == 1
    sample, _ = LabelledDataset(root / "train")
    assert (sample.file, sample.labels, sample.boxes, sample.ignored_boxes) == ("b.jpg", (), (), ())
