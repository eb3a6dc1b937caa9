"""Labelled images are written in both layouts, and read back alike."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from executive.errors import InputError
from executive.vision.dataset import Entry, image_path, save_image, write_annotations
from executive.vision.samples import count_samples, read_samples

CLASSES = ("cube", "duck")
BOXES = ((10.0, 20.0, 30.0, 60.0), (50.5, 10.25, 60.0, 20.0))
ENTRIES = [
    Entry(
        "valid", "a.jpg", (128, 64), ("duck", "cube"), BOXES, ((100.0, 10.0, 120.0, 30.0),),
        {"camera": "overhead"},
    ),
    Entry("train", "b.jpg", (128, 64), (), ()),
]  # fmt: skip


@pytest.fixture(params=["coco", "yolo"])
def root(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A data set in one of the layouts, its images all red."""
    for entry in ENTRIES:
        image = np.full((64, 128, 3), (200, 10, 10), np.uint8)
        save_image(image_path(tmp_path, request.param, entry.split, entry.file), image)
    write_annotations(tmp_path, request.param, ENTRIES, CLASSES)
    return tmp_path


def test_coco_boxes_are_corner_and_size_and_splits_have_files_of_their_own(tmp_path: Path) -> None:
    write_annotations(tmp_path, "coco", ENTRIES, CLASSES)
    valid = json.loads((tmp_path / "valid/_annotations.coco.json").read_text())
    assert valid["images"] == [{"id": 0, "file_name": "a.jpg", "width": 128, "height": 64}]
    first, second = valid["annotations"]
    assert (first["id"], first["bbox"], first["area"], first["category_id"]) == (1, [10, 20, 20, 40], 800, 1)
    assert (second["id"], second["category_id"]) == (2, 0)
    assert [category["name"] for category in valid["categories"]] == list(CLASSES)
    assert json.loads((tmp_path / "train/_annotations.coco.json").read_text())["annotations"] == []
    assert not (tmp_path / "test").exists()


def test_yolo_boxes_are_centre_and_size_relative_to_the_image(tmp_path: Path) -> None:
    write_annotations(tmp_path, "yolo", ENTRIES, CLASSES)
    first, _ = (tmp_path / "valid/labels/a.txt").read_text().splitlines()
    numbers = [float(word) for word in first.split()]
    assert numbers == pytest.approx([1, 20 / 128, 40 / 64, 20 / 128, 40 / 64], abs=1e-6)
    assert (tmp_path / "train/labels/b.txt").read_text() == ""
    data = yaml.safe_load((tmp_path / "data.yaml").read_text())
    assert (data["nc"], data["names"]) == (2, list(CLASSES))
    assert (data["train"], data["val"]) == ("train/images", "valid/images")


def test_an_unknown_layout_is_named_with_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='"voc" is unknown; there are coco and yolo'):
        write_annotations(tmp_path, "voc", ENTRIES, CLASSES)


def test_the_images_that_no_training_used_are_read_as_they_were_written(root: Path) -> None:
    (sample,) = read_samples(root)
    assert sample.file == "a.jpg"
    assert sample.labels == ("duck", "cube")
    assert np.array(sample.boxes) == pytest.approx(np.array(BOXES), abs=1e-3)
    assert sample.ignored == ((100, 10, 120, 30),)
    assert sample.truth == {"camera": "overhead"}
    assert sample.image.shape == (64, 128, 3)
    assert sample.image[30, 60, 0] > 150 > 50 > sample.image[30, 60, 2]
    assert count_samples(root) == 1


def test_a_split_can_be_given_itself_and_an_image_may_show_nothing(root: Path) -> None:
    (sample,) = read_samples(root / "train")
    assert (sample.file, sample.labels, sample.boxes, sample.ignored) == ("b.jpg", (), (), ())


@pytest.mark.parametrize("use", [lambda folder: list(read_samples(folder)), count_samples])
def test_a_folder_without_labels_is_refused_with_what_was_looked_for(tmp_path: Path, use) -> None:
    with pytest.raises(InputError, match=r"no labelled images: _annotations\.coco\.json"):
        use(tmp_path)


def test_a_damaged_image_is_named(root: Path) -> None:
    (damaged,) = (root / "valid").rglob("a.jpg")
    damaged.write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"a\.jpg"):
        list(read_samples(root))


def test_yolo_labels_without_the_names_of_their_classes_are_refused(tmp_path: Path) -> None:
    write_annotations(tmp_path, "yolo", ENTRIES, CLASSES)
    (tmp_path / "valid/images").mkdir()
    (tmp_path / "data.yaml").unlink()
    with pytest.raises(InputError, match=r"has no data\.yaml, which names the classes"):
        list(read_samples(tmp_path))
