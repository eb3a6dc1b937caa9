from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from executive.errors import InputError
from executive.vision.dataset import Entry, image_path, save_image, write_annotations

CLASSES = ("cube", "sphere")
ENTRIES = [
    Entry(
        "train", "a.jpg", (256, 128), ("sphere",), ((10.0, 20.0, 30.0, 60.0),), truth={"camera": "overhead"}
    ),
    Entry("valid", "b.jpg", (256, 128), (), (), ignored=((0.0, 0.0, 5.0, 5.0),)),
]


def test_coco_boxes_are_corner_and_size_and_splits_have_files_of_their_own(tmp_path: Path) -> None:
    write_annotations(tmp_path, "coco", ENTRIES, CLASSES)
    train = json.loads((tmp_path / "train/_annotations.coco.json").read_text())
    assert train["images"] == [{"id": 0, "file_name": "a.jpg", "width": 256, "height": 128}]
    (annotation,) = train["annotations"]
    assert annotation["bbox"] == [10, 20, 20, 40]
    assert annotation["area"] == 800
    assert train["categories"][annotation["category_id"]]["name"] == "sphere"
    valid = json.loads((tmp_path / "valid/_annotations.coco.json").read_text())
    assert valid["annotations"] == []
    assert not (tmp_path / "test").exists()


def test_yolo_boxes_are_centre_and_size_relative_to_the_image(tmp_path: Path) -> None:
    write_annotations(tmp_path, "yolo", ENTRIES, CLASSES)
    numbers = [float(word) for word in (tmp_path / "train/labels/a.txt").read_text().split()]
    assert numbers == pytest.approx([1, 20 / 256, 40 / 128, 20 / 256, 40 / 128], abs=1e-6)
    assert (tmp_path / "valid/labels/b.txt").read_text() == ""
    data = yaml.safe_load((tmp_path / "data.yaml").read_text())
    assert data["names"] == list(CLASSES)
    assert (data["train"], data["val"]) == ("train/images", "valid/images")


def test_half_hidden_objects_and_truth_are_kept_beside_the_annotations(tmp_path: Path) -> None:
    write_annotations(tmp_path, "coco", ENTRIES, CLASSES)
    assert json.loads((tmp_path / "valid/ignored.json").read_text()) == {"b.jpg": [[0, 0, 5, 5]]}
    assert json.loads((tmp_path / "train/truth.json").read_text()) == {"a.jpg": {"camera": "overhead"}}


@pytest.mark.parametrize(("layout", "place"), [("coco", "train/a.jpg"), ("yolo", "train/images/a.jpg")])
def test_images_are_saved_with_red_as_red(tmp_path: Path, layout: str, place: str) -> None:
    red = np.zeros((16, 16, 3), np.uint8)
    red[..., 0] = 255
    save_image(image_path(tmp_path, layout, "train", "a.jpg"), red)
    blue, _, red_back = cv2.imread(str(tmp_path / place))[8, 8]
    assert red_back > 240
    assert blue < 15


def test_an_unknown_layout_is_named_with_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='"voc" is unknown; there are coco and yolo'):
        write_annotations(tmp_path, "voc", ENTRIES, CLASSES)
