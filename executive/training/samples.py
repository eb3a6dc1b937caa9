"""Reader of labelled images from COCO and YOLO folders, for instance exports of Roboflow."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeVar

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import BaseModel, Field, FiniteFloat, TypeAdapter, ValidationError

from executive.cell.frame import Box
from executive.cell.paths import has_outside_link, is_outside_path
from executive.errors import MAX_QUOTATION_LENGTH, InputError
from executive.training.labelled_image import LabelledImage

COCO_FILE_NAME = "_annotations.coco.json"
"""Name of the file with the COCO annotations of a split."""
YOLO_CLASS_FILES = ("data.yaml", "data.yml")
"""Permitted names of the file with the class names of a YOLO dataset."""
IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp")
"""Suffixes of the image files in a YOLO dataset."""
YOLO_BOX_VALUE_COUNT = 4
"""Number of values of a YOLO box: centre x, centre y, width and height."""
MAX_OBJECT_COUNT = 1_000
"""Maximum number of labelled objects in an image; RF-DETR detects at most 300 (its number of queries)."""
MAX_COCO_FILE_SIZE = 500_000_000
"""Maximum size of a COCO file [byte]; the largest annotation file of COCO 2017 has 470 MB."""
MAX_LABEL_FILE_SIZE = 10_000_000
"""Maximum size of the YOLO label file of an image [byte]."""
MAX_CLASS_FILE_SIZE = 100_000
"""Maximum size of a YOLO class file [byte]."""
NORMALIZED_TOLERANCE = 1e-6
"""Maximum rounding error of a normalized coordinate, as a fraction of the image side."""
EVALUATION_SPLITS = ("test", "valid", "val", "train")
"""Folders of a dataset, in the order in which they are preferred for an evaluation."""


@dataclass
class ImageAnnotation:
    """The labelled objects of an image.

    Attributes:
        labels: Class of each object.
        boxes: Left, top, right and bottom of each object, in pixels or normalized to 0 to 1.
        is_normalized: True if the boxes are in normalized coordinates; False if they are in pixels.
        polygon_count: Number of boxes that enclose an annotated polygon.
    """

    labels: list[str] = field(default_factory=list)
    boxes: list[Box] = field(default_factory=list)
    is_normalized: bool = False
    polygon_count: int = 0

    def to_pixel_boxes(self, width: int, height: int) -> tuple[Box, ...]:
        """Return the boxes in pixels for an image of `width` by `height` pixels."""
        x_scale, y_scale = (width, height) if self.is_normalized else (1, 1)
        return tuple(
            (left * x_scale, top * y_scale, right * x_scale, bottom * y_scale)
            for left, top, right, bottom in self.boxes
        )

    def add(self, label: str, box: Box, message_prefix: str) -> None:
        """Add an object; `message_prefix` is the start of the error message for too many objects."""
        if len(self.labels) == MAX_OBJECT_COUNT:
            raise InputError(f"{message_prefix} more than {MAX_OBJECT_COUNT} objects; divide the image")
        self.labels.append(label)
        self.boxes.append(box)


Annotations = Mapping[Path, ImageAnnotation]
"""Annotations of a split by the path of the image, sorted by path."""
Length = Annotated[FiniteFloat, Field(ge=0)]
"""Width or height of a COCO box [pixel]."""
ContentT = TypeVar("ContentT")


class _CocoImage(BaseModel):
    """An image of a COCO file."""

    id: int
    file_name: str


class _CocoObject(BaseModel):
    """A labelled object; `bbox` has left, top, width and height [pixel]."""

    image_id: int
    category_id: int
    bbox: tuple[FiniteFloat, FiniteFloat, Length, Length]


class _CocoCategory(BaseModel):
    """A class of objects."""

    id: int
    name: str


class _CocoFile(BaseModel):
    """The keys of a COCO file that are read."""

    images: list[_CocoImage]
    annotations: list[_CocoObject]
    categories: list[_CocoCategory]


class _YoloClassFile(BaseModel):
    """A YOLO class file: class names by class number, or in the order of the class numbers."""

    names: dict[int, str] | list[str]


def is_split(folder: Path) -> bool:
    """Return True if a folder is a split of a dataset: labelled images in COCO or YOLO format."""
    is_yolo = (folder / "images").is_dir() and (folder / "labels").is_dir()
    return is_yolo or (folder / COCO_FILE_NAME).is_file()


def read_annotations(split: Path) -> Annotations:
    """Return the annotations of one split of a dataset.

    Raises:
        InputError: A file is damaged, or an image is missing or lies outside of the folder; the message
            names the file and the line or the key.
    """
    images = _read_coco(split) if (split / COCO_FILE_NAME).is_file() else _read_yolo(split)
    return dict(sorted(images, key=lambda image: str(image[0])))


def _read_coco(split: Path) -> Iterator[tuple[Path, ImageAnnotation]]:
    """Yield the path and the objects of each image of a split in COCO format."""
    file = split / COCO_FILE_NAME
    content = _parse_file(file, MAX_COCO_FILE_SIZE, _CocoFile.model_validate_json)
    class_names = {category.id: category.name for category in content.categories}
    annotations = {image.id: ImageAnnotation() for image in content.images}
    for message, keys in (
        ("images have the same id", [image.id for image in content.images]),
        ("images have the same file_name", [split / image.file_name for image in content.images]),
        ("categories have the same id", [category.id for category in content.categories]),
    ):
        if len(set(keys)) < len(keys):
            raise InputError(f"{file}: two {message}")
    for index, coco_object in enumerate(content.annotations):
        image_id, class_id = coco_object.image_id, coco_object.category_id
        location = f"{file}: annotations[{index}]"
        if image_id not in annotations:
            raise InputError(f"{location}.image_id: there is no image {image_id}")
        if class_id not in class_names:
            known_ids = ", ".join(map(str, class_names))[:MAX_QUOTATION_LENGTH] or "none"
            raise InputError(f"{location}.category_id: no category has the id {class_id}; ids: {known_ids}")
        left, top, width, height = coco_object.bbox
        box = left, top, left + width, top + height
        annotations[image_id].add(class_names[class_id], box, f"{location}.image_id: image {image_id} has")
    for index, image in enumerate(content.images):
        path = _find_image(split, image.file_name, f"{file}: images[{index}].file_name")
        yield path, annotations[image.id]


def _read_yolo(split: Path) -> Iterator[tuple[Path, ImageAnnotation]]:
    """Yield the path and the objects of each image of a split in YOLO format."""
    paths = (split.parent / name for name in YOLO_CLASS_FILES)
    class_file = next((path for path in paths if path.is_file()), None)
    if class_file is None:
        raise InputError(f"{split.parent} has no data.yaml, which names the classes of a YOLO dataset")

    def parse(text: str) -> _YoloClassFile:
        """Return the class file; `BaseLoader` keeps a class name `no`, which YAML would convert to False."""
        return _YoloClassFile.model_validate(yaml.load(text, Loader=yaml.BaseLoader))

    names = _parse_file(class_file, MAX_CLASS_FILE_SIZE, parse).names
    class_names = dict(enumerate(names)) if isinstance(names, list) else names
    folder = split / "images"
    for path in folder.iterdir():
        if path.suffix.lower() in IMAGE_SUFFIXES:
            image_path = _find_image(folder, path.name, str(path))
            yield image_path, _read_labels(split / "labels" / f"{path.stem}.txt", class_names)


def _read_labels(file: Path, class_names: Mapping[int, str]) -> ImageAnnotation:
    """Return the objects in the label file of a YOLO image; an image without a label file has no objects."""
    annotation = ImageAnnotation(is_normalized=True)
    if not os.path.lexists(file):
        return annotation
    for line_number, line in enumerate(_read_text(file, MAX_LABEL_FILE_SIZE).splitlines(), start=1):
        if not line.strip():
            continue
        location = f"{file}:{line_number}"
        try:
            class_number, *texts = line.split()
            values = [float(text) for text in texts]
            label = class_names[int(class_number)]
        except KeyError:
            raise InputError(f"{location}: {class_number} is not one of {len(class_names)} classes") from None
        except ValueError:
            problem = f'must be a class number and normalized coordinates, not "{line}"'
            raise InputError(f"{location}: {problem}") from None
        is_polygon = len(values) > YOLO_BOX_VALUE_COUNT and len(values) % 2 == 0
        if len(values) != YOLO_BOX_VALUE_COUNT and not is_polygon:
            rule = f"a box has {YOLO_BOX_VALUE_COUNT} values and a polygon an even number, at least 6"
            raise InputError(f"{location}: {rule}; this line has {len(values)}")
        # NaN and infinity fail the comparison, too.
        if not all(-NORMALIZED_TOLERANCE <= value <= 1 + NORMALIZED_TOLERANCE for value in values):
            raise InputError(f'{location}: coordinates must be normalized (0 to 1), not "{line}"')
        if is_polygon:
            xs, ys = values[0::2], values[1::2]
            box = min(xs), min(ys), max(xs), max(ys)
        else:
            x, y, width, height = values
            box = x - width / 2, y - height / 2, x + width / 2, y + height / 2
        annotation.add(label, box, f"{location}: the image has")
        annotation.polygon_count += is_polygon
    return annotation


def _find_image(folder: Path, name: str, location: str) -> Path:
    """Return the path of the image `name`; `location` (file and key) starts the error messages.

    Raises:
        InputError: The image is missing, is not a regular file, or lies outside of the folder.
    """
    path = folder / name
    if not name or is_outside_path(name):
        raise InputError(f'{location}: "{name}" is not below {folder}')
    if not os.path.isfile(path):
        raise InputError(f'{location}: "{name}" is not a file in {folder}')
    if has_outside_link(folder, name):
        raise InputError(f'{location}: "{name}" is a link to a file outside of {folder}')
    return path


def _read_text(file: Path, max_size: int) -> str:
    """Return the text of a file of at most `max_size` [byte]."""
    if not os.path.isfile(file):
        raise InputError(f"{file} is not a file")
    if file.stat().st_size > max_size:
        raise InputError(f"{file} has more than {max_size / 1e6:g} MB, the maximum for this kind of file")
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file} cannot be read: {error}") from error


def read_image_properties(file: Path) -> dict[str, Any]:
    """Return the content of a file such as `truth.json`: one value for each image file name.

    The result is {} if the file does not exist.
    """
    parse = TypeAdapter(dict[str, Any]).validate_json
    return _parse_file(file, MAX_COCO_FILE_SIZE, parse) if file.is_file() else {}


def _parse_file(file: Path, max_size: int, parse: Callable[[str], ContentT]) -> ContentT:
    """Return the parsed content of a file of at most `max_size` [byte].

    Raises:
        InputError: The file is too large, cannot be read, is invalid, or lacks a required key; the message
            names the line or the key.
    """
    try:
        return parse(_read_text(file, max_size))
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise InputError(f"{file}:{line}: invalid YAML: {error.problem}") from error
    except ValidationError as error:
        problem = error.errors()[0]
        keys = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in problem["loc"])
        raise InputError(f"{file}: {keys.removeprefix('.') or 'content'}: {problem['msg']}") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputError(f"{file} cannot be read: {error}") from error


class LabelledDataset:
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
        ignored_boxes = read_image_properties(self._split / "ignored.json")
        truth = read_image_properties(self._split / "truth.json")
        for path, annotation in self._annotations.items():
            image = read_image(path)
            height, width = image.shape[:2]
            yield LabelledImage(
                path.name, image, tuple(annotation.labels), annotation.to_pixel_boxes(width, height),
                tuple(map(tuple, ignored_boxes.get(path.name, ()))), truth.get(path.name, {}),
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
