"""Labelled images are read back from both layouts alike."""

from __future__ import annotations

import numpy as np
import pytest

from executive.errors import InputError
from executive.vision.dataset import Entry, image_path, save_image, write_annotations
from executive.vision.samples import count_samples, read_samples


def write(root, layout):
    image = np.full((64, 128, 3), (200, 10, 10), np.uint8)
    entry = Entry(
        split="valid",
        file="a.jpg",
        size=(128, 64),
        labels=("duck", "cube"),
        boxes=((10.0, 20.0, 30.0, 40.0), (50.5, 10.25, 60.0, 20.0)),
        ignored=((100.0, 10.0, 120.0, 30.0),),
        truth={"camera": "overhead"},
    )
    save_image(image_path(root, layout, "valid", "a.jpg"), image)
    write_annotations(root, layout, [entry], ("cube", "duck"))


@pytest.mark.parametrize("layout", ["coco", "yolo"])
def test_what_was_written_is_read(tmp_path, layout):
    write(tmp_path, layout)
    (sample,) = read_samples(tmp_path)
    assert sample.labels == ("duck", "cube")
    assert np.array(sample.boxes) == pytest.approx(
        np.array([[10, 20, 30, 40], [50.5, 10.25, 60, 20]]), abs=1e-3
    )
    assert sample.ignored == ((100, 10, 120, 30),)
    assert sample.truth == {"camera": "overhead"}
    assert sample.image.shape == (64, 128, 3)
    assert sample.image[30, 60, 0] > 150 > 50 > sample.image[30, 60, 2]
    assert count_samples(tmp_path) == 1


def test_a_split_can_be_given_itself(tmp_path):
    write(tmp_path, "coco")
    assert len(list(read_samples(tmp_path / "valid"))) == 1


def test_a_folder_without_labels_is_refused_with_what_was_looked_for(tmp_path):
    with pytest.raises(InputError, match=r"no labelled images: _annotations\.coco\.json"):
        list(read_samples(tmp_path))
    with pytest.raises(InputError, match=r"no labelled images: _annotations\.coco\.json"):
        count_samples(tmp_path)


def test_a_damaged_image_is_named(tmp_path):
    write(tmp_path, "coco")
    (tmp_path / "valid" / "a.jpg").write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"a\.jpg cannot be read"):
        list(read_samples(tmp_path))
