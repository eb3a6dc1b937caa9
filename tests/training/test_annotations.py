"""Datasets of other tools are read like the clean dataset; damaged or ambiguous ones are refused."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np
import pytest
from PIL import Image

from executive.errors import InputError
from executive.training import train
from executive.training.dataset import LabelledImage
from executive.training.samples import LabelledDataset
from tests.training.dataset_variants import (
    CLASSES,
    COCO,
    REFUSED,
    VARIANTS,
    Change,
    add,
    write_coco,
    write_yolo,
)  # fmt: skip


@pytest.fixture(scope="module")
def samples():
    """Two images of 160 by 120 pixels, each with two filled boxes."""
    boxes = (20.0, 10.0, 60.0, 40.0), (100.0, 70.0, 150.0, 110.0)
    image = np.full((120, 160, 3), 200, np.uint8)
    image[10:40, 20:60] = 200, 30, 20
    return [LabelledImage(label, image, (label, "duck"), boxes) for label in ("cube", "sphere")]


def check_equal(images: Any, samples: Any) -> None:
    """Check that images have the labels, relative boxes and colours of the samples."""
    for image, sample in zip(images, samples, strict=True):
        size, sample_size = (np.array(one.image.shape[1::-1]) for one in (image, sample))
        assert image.labels == sample.labels
        assert np.array(image.boxes) / np.tile(size, 2) == pytest.approx(
            np.array(sample.boxes) / np.tile(sample_size, 2), abs=0.005
        )
        colour = image.image[image.image.shape[0] // 5, image.image.shape[1] // 4]
        assert colour.tolist() == pytest.approx([200, 30, 20], abs=9)


@pytest.mark.parametrize("name", VARIANTS)
def test_a_dataset_of_another_tool_is_read_like_the_clean_one(tmp_path, samples, name):
    (tmp_path / "ignored.json").write_text("a file of others")
    VARIANTS[name](tmp_path / "data", samples)
    images = LabelledDataset(tmp_path / "data")
    images.match_classes(CLASSES, "detector eye")
    check_equal(images, samples)
    assert sorted(map(str.lower, images.classes))[:2] == ["cube", "duck"]
    assert len(images.classes) == 3


def test_several_names_of_a_dataset_may_stand_for_one_class(tmp_path, samples):
    VARIANTS[next(iter(VARIANTS))](tmp_path / "data", samples)
    images = LabelledDataset(tmp_path / "data")
    count = images.object_counts.total()
    images.match_classes(["shape"], "detector eye", {"Cube": "shape", "duck": "shape", "sphere": "shape"})
    assert images.object_counts == {"shape": count}
    images.match_classes(["thing"], "detector ear", {"cube": "thing", "duck": "thing", "sphere": "thing"})
    assert images.object_counts == {"thing": count}, "another cell has other names"


@pytest.mark.parametrize("word", REFUSED)
def test_an_ambiguous_or_damaged_dataset_is_refused(tmp_path, samples, word):
    write, options = REFUSED[word]
    write(tmp_path, samples, **options)
    with pytest.raises(InputError, match=word):
        LabelledDataset(tmp_path).match_classes(CLASSES, "detector eye")


@pytest.mark.parametrize("options", [{}, {"turn": 6}, {"mode": "CMYK", "suffixes": (".jpg",)}])
def test_a_training_sees_the_pixels_and_boxes_of_an_evaluation(tmp_path, samples, options):
    for split in ("train", "valid"):
        file = f"{split}/_annotations.coco.json"
        write_coco(tmp_path / "data", samples, file=file, folder=split, name=f"{split}\\{{}}", **options)
    dataset = train.load_dataset(tmp_path / "data")
    train.write_coco_dataset(dataset, tmp_path / "out")
    content = json.loads((tmp_path / "out/train/_annotations.coco.json").read_text())
    assert [category["name"] for category in content["categories"]] == list(CLASSES)
    for entry, sample in zip(content["images"], dataset["train"], strict=True):
        boxes = np.array([box["bbox"] for box in content["annotations"] if box["image_id"] == entry["id"]])
        boxes[:, 2:] += boxes[:, :2]
        assert boxes == pytest.approx(np.array(sample.boxes), abs=0.001)
        # RF-DETR reads images like this.
        with Image.open(tmp_path / "out/train" / entry["file_name"]) as image:
            assert np.array_equal(np.asarray(image.convert("RGB")), sample.image)


def test_the_summary_states_objects_and_dropped_boxes(tmp_path, samples):
    write_coco(tmp_path, samples, change=COCO["outside"]["change"])
    counts = "2 images; objects: cube 1, duck 2, sphere 1; 4 boxes outside of the image dropped"
    assert LabelledDataset(tmp_path).summary == f"{tmp_path}, split test: {counts}"


def test_a_lost_label_file_is_counted_and_an_upper_case_one_is_read(tmp_path, samples):
    write_yolo(tmp_path, samples)
    (tmp_path / "labels/val/a0.txt").rename(tmp_path / "labels/val/a0.TXT")
    (tmp_path / "labels/val/a1.txt").unlink()
    assert "cube 1, duck 1; 1 images without a label file" in LabelledDataset(tmp_path).summary


@pytest.mark.parametrize("split", ["test", "valid"])
def test_a_missing_split_is_not_replaced_by_other_images(tmp_path, samples, split):
    data = {"train": "images/train", "val": "", "test": "../test/images"}
    write_yolo(tmp_path, samples, folder="images/train", labels="labels/train", data=data)
    with pytest.raises(InputError, match=f"split {split} contains no labelled images"):
        LabelledDataset(tmp_path, split)


def test_boxes_are_clipped_and_ignored_boxes_are_resized_with_the_image(tmp_path, samples):
    write_coco(tmp_path, samples, factors=(2, 1), change=add([140, 100, 40, 40]))
    (tmp_path / "test/ignored.json").write_text(json.dumps({"a0.png": [[10, 10, 20, 20]]}))
    image = next(iter(LabelledDataset(tmp_path)))
    assert image.boxes[-1] == pytest.approx((280, 100, 320, 120))
    assert image.ignored_boxes == ((20, 10, 40, 20),)


def set_value(*keys: Any, value: Any) -> Change:
    """Return a change that replaces a value in a COCO file."""

    def change(content: Any) -> None:
        for key in keys[:-1]:
            content = content[key]
        content[keys[-1]] = value

    return change


NAME, BOX = ("images", 0, "file_name"), ("annotations", 0, "bbox")


@pytest.mark.parametrize(
    ("change", "error"),
    [
        (set_value("images", value=[{}]), "images[0].id: Field required"),
        (set_value("annotations", 0, "image_id", value=9), "annotations[0].image_id: no id 9; ids: 0"),
        (set_value(*BOX, value=[1, 2, 3, float("nan")]), "bbox[3]: Input should be a finite number"),
        (set_value("images", 0, "width", value=10**400), "images[0].width: Input should be less than"),
        (set_value(*BOX, value=[1, 2, -3, 4]), "bbox[2]: Input should be greater than or equal to 0"),
        (set_value("images", 1, "id", value=0), "have the same id"),
        (set_value(*NAME, value="./a1.png"), "two images have the same file_name"),
        (add(*[[1, 2, 30, 40]] * 1000), "has more than 1000 objects; divide the image"),
        (set_value(*NAME, value="../../b.jpg"), 'images[0].file_name: "../../b.jpg" is not a file in '),
        (set_value(*NAME, value="link.jpg"), "link.jpg is not a file in "),
        (set_value(*NAME, value="pipe.jpg"), "pipe.jpg is not a file in "),
        (set_value(*NAME, value="text.png"), "text.png cannot be read; write a sound JPEG or PNG file"),
    ],
)  # fmt: skip
def test_a_damaged_coco_dataset_is_one_error(tmp_path, samples, change, error):
    write_coco(tmp_path / "data", samples, change=change)
    (tmp_path / "b.jpg").write_bytes(b"image")
    (tmp_path / "data/test/text.png").write_bytes(b"image")
    (tmp_path / "data/test/link.jpg").symlink_to(tmp_path / "b.jpg")
    os.mkfifo(tmp_path / "data/test/pipe.jpg")
    with pytest.raises(InputError) as raised:
        LabelledDataset(tmp_path / "data")
    assert error in str(raised.value)


@pytest.mark.parametrize(
    ("file", "content", "error"),
    [
        ("test/_annotations.coco.json", "{", "content: Invalid JSON: EOF"),
        ("test/annotations.json", "{}", "are COCO files of one split"),
        ("labels/val/a0.txt", " " * 10_000_001, "labels/val/a0.txt is larger than 10000000 bytes"),
        ("labels/val/a0.txt", "\udcff", "labels/val/a0.txt cannot be read"),
        ("labels/val/a0.txt", "0 0.5 0.5 nan 0.4", "labels/val/a0.txt: a label is invalid"),
        ("data.yaml", " " * 100_001, "data.yaml is larger than 100000 bytes"),
        ("data.yaml", "names: [duck\n", "data.yaml:1: not valid YAML: "),
    ],
)
def test_a_damaged_file_is_one_error(tmp_path, samples, file, content, error):
    (write_coco if file.endswith(".json") else write_yolo)(tmp_path, samples)
    (tmp_path / file).write_text(content, errors="surrogateescape")
    with pytest.raises(InputError) as raised:
        LabelledDataset(tmp_path)
    assert error in str(raised.value)


@pytest.mark.parametrize("tag", ["!!timestamp foo", "!!python/name:os.system ''", "yes"])
def test_names_of_classes_are_text_whatever_their_tag(tmp_path, samples, tag):
    write_yolo(tmp_path, samples)
    (tmp_path / "data.yaml").write_text(f"names: [{tag}, duck, sphere]\n")
    assert all(isinstance(label, str) for label in LabelledDataset(tmp_path).object_counts)
