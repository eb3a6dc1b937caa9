"""Damaged data sets: each gives one error that names the file and the line or the key."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from executive.errors import InputError
from executive.training.samples import LabelledDataset, read_annotations

Content = dict[str, Any]


def coco() -> Content:
    """Return the content of a sound COCO file with one object."""
    return {
        "images": [{"id": 1, "file_name": "a.jpg"}],
        "annotations": [{"image_id": 1, "category_id": 3, "bbox": [10, 20, 30, 40]}],
        "categories": [{"id": 3, "name": "duck"}],
    }


def changed(*keys: Any, value: Any = None) -> Content:
    """Return a COCO file in which the value behind `keys` is another, or is left out."""
    content: Any = coco()
    inner = content
    for key in keys[:-1]:
        inner = inner[key]
    if value is None:
        del inner[keys[-1]]
    else:
        inner[keys[-1]] = value
    return dict(content)


@pytest.fixture
def split(tmp_path: Path) -> Path:
    """A folder `train` with the image a.jpg, beside a link to it and a pipe."""
    folder = tmp_path / "data" / "train"
    folder.mkdir(parents=True)
    (folder / "a.jpg").write_bytes(b"image")
    (tmp_path / "b.jpg").write_bytes(b"image")
    (folder / "link.jpg").symlink_to(tmp_path / "b.jpg")
    os.mkfifo(folder / "pipe.jpg")
    return folder


def test_a_sound_coco_file_is_read(split: Path) -> None:
    (split / "_annotations.coco.json").write_text(json.dumps(coco()))
    ((path, annotation),) = read_annotations(split).items()
    assert (path, annotation.labels, annotation.boxes) == (split / "a.jpg", ["duck"], [(10, 20, 40, 60)])


NAME = ("images", 0, "file_name")
BOX = ("annotations", 0, "bbox")


@pytest.mark.parametrize(
    ("content", "error"),
    [
        ("", "content: Invalid JSON: EOF"),
        ("{", "content: Invalid JSON: EOF"),
        ("[]", "content: Input should be an object"),
        (b"\xff\xfe", "cannot be read: 'utf-8' codec"),
        ("[" * 100_000, "content: Invalid JSON: recursion limit"),
        (changed("images"), "images: Field required"),
        (changed("annotations"), "annotations: Field required"),
        (changed("categories"), "categories: Field required"),
        (changed("images", 0, "id"), "images[0].id: Field required"),
        (changed(*NAME), "images[0].file_name: Field required"),
        (changed("annotations", 0, "image_id"), "annotations[0].image_id: Field required"),
        (changed("annotations", 0, "image_id", value=9), "annotations[0].image_id: there is no image 9"),
        (changed("annotations", 0, "category_id", value=9),
         "annotations[0].category_id: no category has the id 9; ids: 3"),
        (changed(*BOX), "annotations[0].bbox: Field required"),
        (changed(*BOX, value=[1, 2, 3]), "annotations[0].bbox[3]: Field required"),
        (changed(*BOX, value=[1, 2, 3, 4, 5]), "annotations[0].bbox: Tuple should have at most 4 items"),
        (changed(*BOX, value=[1, 2, 3, float("nan")]), "bbox[3]: Input should be a finite number"),
        (changed(*BOX, value=[1, 2, -3, 4]), "bbox[2]: Input should be greater than or equal to 0"),
        (changed(*BOX, value="box"), "annotations[0].bbox: Input should be"),
        (changed("images", value=[{"id": 1, "file_name": "a.jpg"}] * 2), "two images have the same id"),
        (changed("images", value=[{"id": 1, "file_name": "a.jpg"}, {"id": 2, "file_name": "./a.jpg"}]),
         "two images have the same file_name"),
        (changed("categories", value=[{"id": 3, "name": "duck"}, {"id": 3, "name": "cube"}]),
         "two categories have the same id"),
        (changed("annotations", value=coco()["annotations"] * 1001),
         "annotations[1000].image_id: image 1 has more than 1000 objects; divide the image"),
        (changed(*NAME, value="b.jpg"), 'images[0].file_name: "b.jpg" is not a file in '),
        (changed(*NAME, value="../../b.jpg"), 'images[0].file_name: "../../b.jpg" is not below '),
        (changed(*NAME, value="/etc/passwd"), 'images[0].file_name: "/etc/passwd" is not below '),
        (changed(*NAME, value="link.jpg"), 'images[0].file_name: "link.jpg" is a link to a file outside of '),
        (changed(*NAME, value="pipe.jpg"), 'images[0].file_name: "pipe.jpg" is not a file in '),
        (changed(*NAME, value="."), 'images[0].file_name: "." is not a file in '),
    ],
)  # fmt: skip
def test_a_damaged_coco_file_is_one_error(split: Path, content: Any, error: str) -> None:
    file = split / "_annotations.coco.json"
    raw = content if isinstance(content, str | bytes) else json.dumps(content)
    file.write_bytes(raw.encode() if isinstance(raw, str) else raw)
    with pytest.raises(InputError) as raised:
        read_annotations(split)
    text = str(raised.value)
    assert text.startswith(str(file))
    assert error in text


@pytest.fixture
def yolo(split: Path) -> Callable[..., Path]:
    """Write a YOLO data set with one image and return the folder of its split."""

    def write(labels: str, data: str = "names: [duck, cube]\n") -> Path:
        (split / "images").mkdir()
        (split / "labels").mkdir()
        (split / "images/a.jpg").write_bytes(b"image")
        (split / "labels/a.txt").write_text(labels)
        (split.parent / "data.yaml").write_text(data)
        return split

    return write


def test_boxes_and_polygons_of_yolo_are_read(yolo: Callable[..., Path]) -> None:
    split = yolo("1 0.5 0.5 0.2 0.4\n\n0 0.1 0.1 0.3 0.1 0.3 0.2\n")
    (annotation,) = read_annotations(split).values()
    assert annotation.labels == ["cube", "duck"]
    box, polygon = annotation.to_pixel_boxes(100, 200)
    assert box == pytest.approx((40, 60, 60, 140))
    assert polygon == pytest.approx((10, 20, 30, 40))
    assert LabelledDataset(split).polygon_count == 1


@pytest.mark.parametrize(
    ("labels", "data", "error"),
    [
        ("2 0.5 0.5 0.2 0.4\n", "names: [duck, cube]\n", "labels/a.txt:1: 2 is not one of 2 classes"),
        ("\n-1 0.5 0.5 0.2 0.4\n", "names: [duck]\n", "labels/a.txt:2: -1 is not one of 1 classes"),
        (
            "duck 0.5 0.5 0.2 0.4\n",
            "names: [duck]\n",
            "labels/a.txt:1: must be a class number and normalized",
        ),
        ("0 0.5 0.5 0.2\n", "names: [duck]\n", "labels/a.txt:1: a box has 4 values and a polygon an even"),
        ("0 0.5 0.5 0.2 0.1 0.1\n", "names: [duck]\n", "labels/a.txt:1: a box has 4 values and a polygon"),
        ("0 0.5 0.5 nan 0.4\n", "names: [duck]\n", "labels/a.txt:1: coordinates must be normalized (0 to 1)"),
        (
            "0 0.5 0.5 0.2 0.4\n" * 1001,
            "names: [duck]\n",
            "labels/a.txt:1001: the image has more than 1000 objects",
        ),
        ("0 12 20 30 40\n", "names: [duck]\n", "labels/a.txt:1: coordinates must be normalized (0 to 1)"),
        (" " * 10_000_001, "names: [duck]\n", "labels/a.txt has more than 10 MB"),
        ("", " " * 100_001, "data.yaml has more than 0.1 MB"),
        ("", "names: [duck\n", "data.yaml:2: invalid YAML: "),
        ("", "", "data.yaml: content: Input should be"),
        ("", "nc: 2\n", "data.yaml: names: Field required"),
        ("", "names: duck\n", "data.yaml: names"),
        (
            "",
            "names: !!python/name:os.system ''\n",
            "data.yaml: names.dict[int,str]: Input should be a valid dictionary",
        ),
    ],
)
def test_a_damaged_yolo_folder_is_one_error(
    yolo: Callable[..., Path], labels: str, data: str, error: str
) -> None:
    with pytest.raises(InputError) as raised:
        read_annotations(yolo(labels, data))
    assert error in str(raised.value)


@pytest.mark.parametrize(
    "tag", ["!!bool foo", "!!timestamp foo", "!!int ''", "!!python/name:os.system ''", "yes"]
)
def test_names_of_classes_are_text_whatever_their_tag(yolo: Callable[..., Path], tag: str) -> None:
    (annotation,) = read_annotations(yolo("0 0.5 0.5 0.2 0.4\n", f"names: [{tag}]\n")).values()
    assert all(isinstance(label, str) for label in annotation.labels)
