"""Images with labelled objects, and the writer of datasets in COCO or YOLO layout.

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

from executive.cell.frame import Box, Frame
from executive.errors import InputError
from executive.geometry import Array, Pose

SPLITS = ("train", "valid", "test")
"""Names of the splits of a dataset, and of their folders."""
JPEG_QUALITY = 95
"""JPEG quality of the images, 0 to 100."""

MIN_BORDER_DISTANCE = 0.5
"""Minimum distance of the box of a complete object from the border of the searched region [pixel]."""
MIN_VISIBLE_FRACTION = 0.9
"""Minimum visible fraction of the silhouette of an object that counts as fully visible."""


@dataclass(frozen=True, eq=False)
class LabelledImage:
    """An image and the objects in it.

    Attributes:
        file: File name of the image.
        image: Image `(H, W, 3)` uint8, RGB.
        labels: Class of each object.
        boxes: Box of each object [pixel].
        ignored_boxes: Boxes of objects that evaluations ignore, whether detected or missed [pixel].
        truth: Ground truth of the renderer, for instance `X_WC` and `positions`. The key `part` contains the
            region of the camera's full frame that the image shows [pixel].
        region: Region of the image [pixel] that is searched and labelled; None: the whole image.
        depth: Depth image `(H, W)` [m] in the format of `Frame.depth`; None without a depth sensor.
        repeated_image: Image of the same scene from the same camera pose with different noise, or None.
    """

    file: str
    image: NDArray[np.uint8]
    labels: tuple[str, ...]
    boxes: tuple[Box, ...]
    ignored_boxes: tuple[Box, ...] = ()
    truth: Mapping[str, Any] = field(default_factory=dict)
    region: Box | None = None
    depth: Array | None = None
    repeated_image: NDArray[np.uint8] | None = None

    def to_frame(self, frame_id: int) -> Frame:
        """Return the image as a frame, with the true camera pose if the pose is known."""
        matrix = np.eye(3)
        X_WC = Pose.identity()
        if "matrix" in self.truth and "X_WC" in self.truth:
            matrix = self._compute_camera_matrix()
            X_WC = Pose.of(self.truth["X_WC"][:3], self.truth["X_WC"][3:])
        camera = str(self.truth.get("camera", "image"))
        visible = np.ones(self.image.shape[:2], np.bool_)
        return Frame(frame_id, camera, self.image, self.depth, matrix, X_WC, 0.0, visible, change_count=0)

    def is_fully_inside(self, index: int) -> bool:
        """Return True if the object with the given index lies completely in the searched region."""
        box = self.boxes[index]
        left, top, right, bottom = self.region or self._image_region
        distance = min(box[0] - left, box[1] - top, right - box[2], bottom - box[3])
        return distance >= MIN_BORDER_DISTANCE

    def get_visible_fraction(self, index: int) -> float:
        """Return the visible fraction of an object, 0 to 1; 1 if the fraction is unknown."""
        fractions = self.truth.get("visible_fraction")
        return 1.0 if fractions is None else float(fractions[index])

    def is_fully_visible(self, index: int) -> bool:
        """Return True if an object lies completely in the searched region and is almost unoccluded."""
        return self.is_fully_inside(index) and self.get_visible_fraction(index) >= MIN_VISIBLE_FRACTION

    @property
    def pixel_scale(self) -> Array:
        """Number of pixels of the camera's full frame per pixel of this image, along x and y `(2,)`."""
        _, _, width, height = self._image_region
        left, top, right, bottom = self.truth.get("part", self._image_region)
        return np.array([(right - left) / width, (bottom - top) / height])

    @property
    def _image_region(self) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of the whole image [pixel]."""
        height, width = self.image.shape[:2]
        return 0, 0, width, height

    def _compute_camera_matrix(self) -> Array:
        """Return the camera matrix `(3, 3)` of this image, which may be a scaled part of a frame."""
        left, top, *_ = self.truth.get("part", (0, 0))
        matrix = np.array(self.truth["matrix"], dtype=float)
        matrix[:2, 2] -= left, top
        matrix[:2] /= self.pixel_scale[:, None]
        return matrix


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
    """
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
    categories = [{"id": i, "name": name, "supercategory": name} for i, name in enumerate(classes)]
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
