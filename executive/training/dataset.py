"""Writer of datasets of labelled images in COCO or YOLO layout, for the training of detectors.

Layout `coco` has a file `_annotations.coco.json` beside the images of each split, like exports of Roboflow.
Layout `yolo` has a file `data.yaml`, and folders `images` and `labels` in each split. The caller writes the
images to the paths of `build_image_path`, and then all annotations with `write_annotations`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from executive.cell.frame import Box
from executive.errors import InputError

SPLITS = ("train", "valid", "test")
"""Names of the splits of a dataset, and of their folders."""
JPEG_QUALITY = 95
"""JPEG quality of the images, 0 to 100."""


@dataclass(frozen=True)
class DatasetEntry:
    """Annotations of one image of a dataset.

    Attributes:
        split: `train`, `valid` or `test`.
        file: File name of the image.
        size: Width and height of the image [pixel].
        labels: Class of each labelled object.
        boxes: Left, top, right and bottom [pixel] of each labelled object.
        ignored_boxes: Boxes of objects that evaluations ignore, whether detected or missed [pixel].
        truth: Further ground truth for evaluations, as JSON values by name.
    """

    split: str
    file: str
    size: tuple[int, int]
    labels: tuple[str, ...]
    boxes: tuple[Box, ...]
    ignored_boxes: tuple[Box, ...] = ()
    truth: Mapping[str, Any] = field(default_factory=dict)


def build_image_path(root: Path, layout: str, split: str, file: str) -> Path:
    """Return the path of an image of a dataset; `layout` is `coco` or `yolo`."""
    return root / split / file if layout == "coco" else root / split / "images" / file


def save_image(path: Path, image: NDArray[np.uint8]) -> None:
    """Write an RGB image `(H, W, 3)` and create its folder.

    Raises:
        InputError: The file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(path), image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]):
        raise InputError(f"the image {path} could not be written; is the disk full or the folder read-only?")


def write_annotations(
    root: Path, layout: str, entries: Sequence[DatasetEntry], classes: Sequence[str]
) -> None:
    """Write the annotations of a dataset; the classes are numbered from 0 in the given order.

    Each split also gets `ignored.json` with `DatasetEntry.ignored_boxes`, and `truth.json` with
    `DatasetEntry.truth`, by file name of the image.

    Raises:
        InputError: The layout is unknown.
    """
    if layout not in ("coco", "yolo"):
        raise InputError(f'the dataset layout "{layout}" is unknown; use coco or yolo')
    root.mkdir(parents=True, exist_ok=True)
    splits = [split for split in SPLITS if any(entry.split == split for entry in entries)]
    for split in splits:
        split_entries = [entry for entry in entries if entry.split == split]
        if layout == "coco":
            _write_json(root / split / "_annotations.coco.json", _to_coco(split_entries, classes))
        else:
            _write_yolo(root / split / "labels", split_entries, classes)
        ignored_boxes = {entry.file: entry.ignored_boxes for entry in split_entries}
        _write_json(root / split / "ignored.json", ignored_boxes)
        _write_json(root / split / "truth.json", {entry.file: entry.truth for entry in split_entries})
    if layout == "yolo":
        folders = {"val" if split == "valid" else split: f"{split}/images" for split in splits}
        data = {"path": ".", **folders, "nc": len(classes), "names": list(classes)}
        (root / "data.yaml").write_text(yaml.safe_dump(data, sort_keys=False))


def _to_coco(entries: Sequence[DatasetEntry], classes: Sequence[str]) -> dict[str, Any]:
    """Return the content of the COCO file of a split."""
    images: list[dict[str, Any]] = []
    objects: list[dict[str, Any]] = []
    for image_id, entry in enumerate(entries):
        width, height = entry.size
        images.append({"id": image_id, "file_name": entry.file, "width": width, "height": height})
        for label, (left, top, right, bottom) in zip(entry.labels, entry.boxes, strict=True):
            box = [round(value, 3) for value in (left, top, right - left, bottom - top)]
            area = round((right - left) * (bottom - top), 3)
            ids = {"id": len(objects) + 1, "image_id": image_id, "category_id": classes.index(label)}
            objects.append({**ids, "bbox": box, "area": area, "iscrowd": 0, "segmentation": []})
    categories = [{"id": i, "name": name, "supercategory": "object"} for i, name in enumerate(classes)]
    return {"info": {}, "licenses": [], "categories": categories, "images": images, "annotations": objects}


def _write_yolo(folder: Path, entries: Sequence[DatasetEntry], classes: Sequence[str]) -> None:
    """Write the label files of a split."""
    folder.mkdir(parents=True, exist_ok=True)
    for entry in entries:
        width, height = entry.size
        lines = [
            f"{classes.index(label)} {(left + right) / 2 / width:.6f} {(top + bottom) / 2 / height:.6f} "
            f"{(right - left) / width:.6f} {(bottom - top) / height:.6f}\n"
            for label, (left, top, right, bottom) in zip(entry.labels, entry.boxes, strict=True)
        ]
        (folder / entry.file).with_suffix(".txt").write_text("".join(lines))


def _write_json(path: Path, content: Any) -> None:
    """Write a JSON file and create its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))
