"""Reading labelled images back, to measure a detector with: COCO and YOLO folders, Roboflow's among them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.errors import InputError
from executive.geometry import Array
from executive.messages import Box

ANNOTATIONS = "_annotations.coco.json"
SPLITS = ("test", "valid", "val", "train")
"""Folders of a data set in which labelled images are sought, those that no training has used first."""
DATA = ("data.yaml", "data.yml")
"""Files that name the classes of a YOLO data set."""


@dataclass(frozen=True, eq=False)
class LabelledImage:
    """An image and what is on it.

    Attributes:
        file: File name.
        image: `(H, W, 3)` uint8, RGB.
        labels: Class of each object.
        boxes: Their boxes [pixel], one to one.
        ignored: Boxes of objects that a detector may find or not.
        truth: What the renderer knows beyond that: `camera`, `part`, `matrix`, `X_WC`, `positions`, …
        area: Part of the image [pixel] that is searched and labelled; None: all of it.
        depth: `(H, W)` [m], as in a `Frame`; None without a depth sensor.
        second: Another image of the same scene from the same pose; None without one.
    """

    file: str
    image: NDArray[np.uint8]
    labels: tuple[str, ...]
    boxes: tuple[Box, ...]
    ignored: tuple[Box, ...] = ()
    truth: Mapping[str, Any] = field(default_factory=dict)
    area: Box | None = None
    depth: Array | None = None
    second: NDArray[np.uint8] | None = None


def read_samples(folder: Path) -> Iterator[LabelledImage]:
    """Yield the labelled images of a split, or of the first of a data set's splits that exists.

    Raises:
        InputError: There are none, or an image cannot be read.
    """
    split = _split(folder)
    dataset = _dataset(split)
    ignored, truth = (_read_json(split / name) for name in ("ignored.json", "truth.json"))
    for path in map(Path, sorted(dataset.image_paths)):
        objects = dataset.annotations[str(path)]
        yield LabelledImage(
            path.name,
            read_image(path),
            tuple(dataset.classes[number] for number in objects.class_id),
            tuple(map(tuple, objects.xyxy.tolist())),
            tuple(map(tuple, ignored.get(path.name, ()))),
            truth.get(path.name, {}),
        )


def count_samples(folder: Path) -> int:
    """Return how many labelled images `read_samples` yields.

    Raises:
        InputError: There are none.
    """
    return len(_dataset(_split(folder)))


def read_image(path: Path) -> NDArray[np.uint8]:
    """Return an image file as `(H, W, 3)` uint8, RGB.

    Raises:
        InputError: It cannot be read.
    """
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"the image {path} cannot be read; is it missing or damaged?")
    return np.ascontiguousarray(image[..., ::-1], dtype=np.uint8)


def _split(folder: Path) -> Path:
    """Return the folder in which the labelled images of a data set are, or of a split of one.

    Raises:
        InputError: There is none.
    """
    for split in (folder, *(folder / name for name in SPLITS)):
        if (split / ANNOTATIONS).is_file() or ((split / "images").is_dir() and (split / "labels").is_dir()):
            return split
    raise InputError(
        f"{folder} holds no labelled images: {ANNOTATIONS} (COCO) or images/ and labels/ (YOLO) were looked "
        f"for there and in {', '.join(SPLITS)}; make some with `executive dataset`"
    )


def _dataset(split: Path) -> Any:
    """Return a split as a `supervision.DetectionDataset`; no image is read.

    Raises:
        InputError: An annotation or an image cannot be read.
    """
    import supervision as sv

    try:
        if (split / ANNOTATIONS).is_file():
            return sv.DetectionDataset.from_coco(str(split), str(split / ANNOTATIONS))
        data = next((split.parent / name for name in DATA if (split.parent / name).is_file()), None)
        if data is None:
            raise InputError(f"{split.parent} has no data.yaml, which names the classes of a YOLO data set")
        return sv.DetectionDataset.from_yolo(str(split / "images"), str(split / "labels"), str(data))
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise InputError(f"the labelled images in {split} cannot be read: {error}") from error


def _read_json(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else {}
