"""Reader of labelled images from COCO and YOLO folders, for instance exports of Roboflow."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.errors import InputError
from executive.training.annotations import COCO_FILE_NAME, is_split, read_annotations, read_json
from executive.training.labelled_image import LabelledImage

EVALUATION_SPLITS = ("test", "valid", "val", "train")
"""Folders of a dataset, in the order in which they are preferred for an evaluation."""


class Samples:
    """Labelled images of a split; a dataset is represented by its first split in `EVALUATION_SPLITS`.

    Args:
        folder: Folder of the split or the dataset.

    Attributes:
        polygon_count: Number of boxes that enclose an annotated polygon.

    Raises:
        InputError: There are no labelled images, or the annotations are damaged.
    """

    def __init__(self, folder: Path) -> None:
        self._split = _find_split(folder)
        self._annotations = read_annotations(self._split)
        self.polygon_count = sum(image.polygon_count for image in self._annotations.values())

    def __len__(self) -> int:
        return len(self._annotations)

    def __iter__(self) -> Iterator[LabelledImage]:
        """Yield the labelled images; an image is read when the iteration reaches it.

        Raises:
            InputError: An image cannot be read.
        """
        ignored, truth = (read_json(self._split / name) for name in ("ignored.json", "truth.json"))
        for path, annotation in self._annotations.items():
            image = read_image(path)
            height, width = image.shape[:2]
            yield LabelledImage(
                path.name, image, tuple(annotation.labels), annotation.to_pixel_boxes(width, height),
                tuple(map(tuple, ignored.get(path.name, ()))), truth.get(path.name, {}),
            )  # fmt: skip


def read_image(path: Path) -> NDArray[np.uint8]:
    """Return an image file as `(H, W, 3)` uint8, RGB.

    Raises:
        InputError: The image cannot be read.
    """
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"the image {path} cannot be read; is it missing or damaged?")
    return np.ascontiguousarray(image[..., ::-1], dtype=np.uint8)


def list_splits(dataset: Path) -> list[Path]:
    """Return the existing splits of a dataset, in the order of `EVALUATION_SPLITS`."""
    return [dataset / name for name in EVALUATION_SPLITS if is_split(dataset / name)]


def _find_split(folder: Path) -> Path:
    """Return `folder` if it is a split, else the first existing split of the dataset `folder`.

    Raises:
        InputError: There are no labelled images.
    """
    if splits := [folder] if is_split(folder) else list_splits(folder):
        return splits[0]
    raise InputError(
        f"{folder} contains no labelled images: neither it nor its folders {', '.join(EVALUATION_SPLITS)} "
        f"contain {COCO_FILE_NAME} (COCO) or images/ and labels/ (YOLO); render a dataset with "
        "`executive dataset`"
    )
