"""Reader of labelled images in COCO and YOLO folders, for instance exports of Roboflow."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from executive.errors import InputError
from executive.training.annotations import (
    COCO_FILE_NAME,
    MAX_COCO_FILE_SIZE,
    is_split,
    parse_file,
    read_annotations,
)
from executive.training.labelled_image import LabelledImage

SPLITS = ("test", "valid", "val", "train")
"""Folders of a data set with labelled images, beginning with those that no training has used."""


class Samples:
    """The labelled images of a split, or of the first of a data set's splits that exists.

    Iteration reads one image after the other.

    Args:
        folder: The split or the data set.

    Attributes:
        polygon_count: Number of boxes that are made from polygons.

    Raises:
        InputError: There are no labelled images, or the annotations are damaged.
    """

    def __init__(self, folder: Path) -> None:
        self._split = _split(folder)
        self._annotations = read_annotations(self._split)
        self.polygon_count = sum(one.polygon_count for one in self._annotations.values())

    def __len__(self) -> int:
        return len(self._annotations)

    def __iter__(self) -> Iterator[LabelledImage]:
        """Yield the images.

        Raises:
            InputError: An image cannot be read.
        """
        ignored, truth = (_read_json(self._split / name) for name in ("ignored.json", "truth.json"))
        for path, annotation in self._annotations.items():
            image = read_image(path)
            yield LabelledImage(
                path.name,
                image,
                tuple(annotation.labels),
                annotation.to_pixel_boxes(image.shape[1], image.shape[0]),
                tuple(map(tuple, ignored.get(path.name, ()))),
                truth.get(path.name, {}),
            )


def read_image(path: Path) -> NDArray[np.uint8]:
    """Return an image file as `(H, W, 3)` uint8, RGB.

    Raises:
        InputError: It cannot be read.
    """
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"the image {path} cannot be read; is it missing or damaged?")
    return np.ascontiguousarray(image[..., ::-1], dtype=np.uint8)


def splits_of(dataset: Path) -> list[Path]:
    """Return the folders of a data set with labelled images."""
    return [dataset / name for name in SPLITS if is_split(dataset / name)]


def _split(folder: Path) -> Path:
    """Return the folder if it holds labelled images, else the first of its splits.

    Raises:
        InputError: There are no labelled images.
    """
    if splits := [folder] if is_split(folder) else splits_of(folder):
        return splits[0]
    raise InputError(
        f"{folder} holds no labelled images: {COCO_FILE_NAME} (COCO) or images/ and labels/ (YOLO) were "
        f"looked for there and in {', '.join(SPLITS)}; make some with `executive dataset`"
    )


def _read_json(path: Path) -> dict[str, Any]:
    """Return the object in a file with a key for each image; empty without a file."""
    read = TypeAdapter(dict[str, Any]).validate_json
    return parse_file(path, MAX_COCO_FILE_SIZE, read) if path.is_file() else {}
