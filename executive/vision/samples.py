"""Reading labelled images back, to measure a detector with: COCO and YOLO folders, Roboflow's among them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from executive.errors import InputError
from executive.geometry import Array
from executive.messages import Box

ANNOTATIONS = "_annotations.coco.json"
SPLITS = ("test", "valid", "val", "train")
"""Where labelled images are looked for, the ones a detector has not been trained on first."""
IMAGE_SUFFIXES = {".jpg", ".jpeg", ".png", ".bmp"}


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
    """

    file: str
    image: NDArray[np.uint8]
    labels: tuple[str, ...]
    boxes: tuple[Box, ...]
    ignored: tuple[Box, ...] = ()
    truth: Mapping[str, Any] = field(default_factory=dict)
    area: Box | None = None
    depth: Array | None = None


def read_samples(folder: Path) -> Iterator[LabelledImage]:
    """Yield the labelled images of a split, or of the first of a data set's splits that exists.

    Raises:
        InputError: There are none, or an image cannot be read.
    """
    split = _split(folder)
    yield from _read_coco(split) if _is_coco(split) else _read_yolo(split)


def count_samples(folder: Path) -> int:
    """Return how many labelled images `read_samples` yields.

    Raises:
        InputError: There are none.
    """
    split = _split(folder)
    return len(_coco(split)["images"]) if _is_coco(split) else len(_yolo_images(split))


def _split(folder: Path) -> Path:
    """Return the folder in which the labelled images of a data set are, or of a split of one.

    Raises:
        InputError: There is none.
    """
    for split in (folder, *(folder / name for name in SPLITS)):
        if _is_coco(split) or ((split / "images").is_dir() and (split / "labels").is_dir()):
            return split
    raise InputError(
        f"{folder} holds no labelled images: {ANNOTATIONS} (COCO) or images/ and labels/ (YOLO) were looked "
        f"for there and in {', '.join(SPLITS)}; make some with `executive dataset`"
    )


def _is_coco(split: Path) -> bool:
    return (split / ANNOTATIONS).is_file()


def _coco(split: Path) -> dict[str, Any]:
    return dict(json.loads((split / ANNOTATIONS).read_text(encoding="utf-8")))


def _yolo_images(split: Path) -> list[Path]:
    return [path for path in sorted((split / "images").iterdir()) if path.suffix.lower() in IMAGE_SUFFIXES]


def _read_coco(split: Path) -> Iterator[LabelledImage]:
    content = _coco(split)
    names = {category["id"]: category["name"] for category in content["categories"]}
    objects: dict[int, list[dict[str, Any]]] = {}
    for annotation in content["annotations"]:
        objects.setdefault(annotation["image_id"], []).append(annotation)
    aside = _Aside(split)
    for image in content["images"]:
        mine = objects.get(image["id"], [])
        boxes = tuple((x, y, x + width, y + height) for x, y, width, height in (one["bbox"] for one in mine))
        labels = tuple(names[one["category_id"]] for one in mine)
        yield aside.sample(split / image["file_name"], labels, boxes)


def _read_yolo(split: Path) -> Iterator[LabelledImage]:
    names = _yolo_names(split)
    aside = _Aside(split)
    for path in _yolo_images(split):
        image = read_image(path)
        height, width = image.shape[:2]
        text = split / "labels" / f"{path.stem}.txt"
        rows = (
            [line.split() for line in text.read_text().splitlines() if line.strip()] if text.exists() else []
        )
        labels = tuple(names[int(row[0])] for row in rows)
        values = [[float(value) for value in row[1:5]] for row in rows]
        boxes = tuple(
            ((x - w / 2) * width, (y - h / 2) * height, (x + w / 2) * width, (y + h / 2) * height)
            for x, y, w, h in values
        )
        yield aside.sample(path, labels, boxes)


def read_image(path: Path) -> NDArray[np.uint8]:
    """Return an image file as `(H, W, 3)` uint8, RGB.

    Raises:
        InputError: It cannot be read.
    """
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"the image {path} cannot be read; is it missing or damaged?")
    return np.ascontiguousarray(image[..., ::-1], dtype=np.uint8)


def _yolo_names(split: Path) -> dict[int, str]:
    for path in (split.parent / "data.yaml", split.parent / "data.yml"):
        if path.is_file():
            names = yaml.safe_load(path.read_text(encoding="utf-8"))["names"]
            return dict(names) if isinstance(names, dict) else dict(enumerate(names))
    raise InputError(f"{split.parent} has no data.yaml, which names the classes of a YOLO data set")


class _Aside:
    """The side files of a split that this project's own renderer writes."""

    def __init__(self, split: Path) -> None:
        self._ignored, self._truth = (_read_json(split / name) for name in ("ignored.json", "truth.json"))

    def sample(self, path: Path, labels: tuple[str, ...], boxes: tuple[Box, ...]) -> LabelledImage:
        ignored: tuple[Box, ...] = tuple(tuple(box) for box in self._ignored.get(path.name, ()))
        return LabelledImage(
            path.name, read_image(path), labels, boxes, ignored, self._truth.get(path.name, {})
        )


def _read_json(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else {}
