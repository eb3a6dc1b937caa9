"""Reader of labelled images: COCO and YOLO datasets, for instance of Roboflow, CVAT and Ultralytics."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, FailFast, Field, FiniteFloat, TypeAdapter

from executive.errors import MAX_QUOTATION_LENGTH, InputError
from executive.geometry import Array
from executive.text.files import has_outside_link, read_image_header
from executive.training import dataset
from executive.training.dataset import DatasetEntry, LabelledImage

MAX_COCO_FILE_SIZE = 500_000_000
"""Maximum size of a COCO file [byte]; the largest annotation file of COCO 2017 has 470 MB."""
MAX_OBJECT_COUNT = 1_000
"""Maximum number of labelled objects in an image; RF-DETR detects at most 300 (its number of queries)."""
MAX_NORMALIZED = 2.0
"""Maximum absolute value of a normalized coordinate; 0 to 1 is inside of the image."""
MAX_PIXELS = 1_000_000
"""Maximum width, height and absolute coordinate in a COCO file [pixel]; JPEG images have up to 65,535."""
MIN_BOX_SIZE = 1.0
"""Minimum width and height of the box of an object [pixel]."""
MAX_COPY_DISTANCE = 1.0
"""Maximum difference between the coordinates of two boxes of the same object [pixel]."""
CORNER_FRACTIONS = (0.9, 0.1)
"""Minimum fractions of the boxes of a COCO file with corners: boxes that fit as two corners, and boxes that
end outside of their images if they are read as corner and size."""
MIN_SHIFTED_FRACTION = 0.05
"""Minimum fraction of boxes that end outside of their images if corner and centre were confused."""
COCO_FORM = "left, top, width and height"
"""Meaning of the numbers of a box in a COCO file."""
YOLO_FORM = "centre x, centre y, width and height"
"""Meaning of the numbers of a box in a YOLO file."""
MAX_CORNER_FRACTION = 0.02
"""Maximum coordinate, as a fraction of the image, of boxes in 0..1 that are read as pixels."""
MAX_BOX_WORDS = 6
"""Maximum number of words of a YOLO box: class, centre, size, and perhaps confidence."""
KEYPOINT_FRACTIONS = (0.9, 0.75)
"""Minimum fraction of labels whose box contains all points, and maximum fraction that fits polygons, if the
labels may be boxes with keypoints."""
MAX_FRACTION = 1.02
"""Maximum coordinate in an image, as a fraction of its width or height; annotation tools round."""
OUTSIDE = "boxes outside of the image dropped"
"""Description of boxes without a part in the image, in the summary of a dataset."""
SMALL = "boxes smaller than a pixel dropped"
"""Description of boxes that show no object, in the summary of a dataset."""

Length = Annotated[FiniteFloat, Field(ge=0, le=MAX_PIXELS)]
"""Width or height of a COCO box [pixel]."""
Coordinate = Annotated[FiniteFloat, Field(ge=-MAX_PIXELS, le=MAX_PIXELS)]
"""Left or top side of a COCO box [pixel]."""


class _CocoImage(BaseModel):
    """An image of a COCO file; a width or height of 0 or None is unknown."""

    id: int
    file_name: str
    width: int | None = Field(0, ge=0, le=MAX_PIXELS)
    height: int | None = Field(0, ge=0, le=MAX_PIXELS)


class _CocoObject(BaseModel):
    """A labelled object; `bbox` has left, top, width and height [pixel]; a crowd is not a single object."""

    image_id: int
    category_id: int
    bbox: tuple[Coordinate, Coordinate, Length, Length]
    iscrowd: bool = False


class _CocoCategory(BaseModel):
    """A class of objects."""

    id: int
    name: str
    supercategory: str | None = None


class _CocoFile(BaseModel):
    """The keys of a COCO file that are read."""

    images: Annotated[list[_CocoImage], FailFast()]
    annotations: Annotated[list[_CocoObject], FailFast()]
    categories: Annotated[list[_CocoCategory], FailFast()]


class LabelledDataset:
    """Labelled images of a split of a dataset.

    Args:
        folder: Folder of the dataset, or of one split.
        split: `train`, `valid` or `test`; "": the first existing split of `PREFERRED_SPLITS`.

    Attributes:
        folder: Folder of the dataset.
        annotations: Annotations by the path of the image.
        classes: Class names in the order of their numbers.
        notes: Numbers of dropped or changed boxes and images, by description.

    Raises:
        InputError: There are no labelled images or no objects, the annotations are damaged or ambiguous, or
            an image is missing or lies outside of the folder; the message names file and line or key.
    """

    def __init__(self, folder: Path, split: str = "") -> None:
        self.folder = folder
        splits = dataset.find_splits(folder)
        split = split or next(iter(splits), "")
        self._name = f"{folder}, split {split}" if split else f"{folder}"
        if split not in splits:
            parts = "images, for instance .jpg, and a COCO file, or labels/ and data.yaml (YOLO)"
            raise InputError(f"{self._name} contains no labelled images; it must contain {parts}")
        self._split = split
        self._source = splits[split]
        self.annotations: dict[Path, DatasetEntry] = {}
        self._own_labels: dict[Path, tuple[str, ...]] = {}
        """Class names of the objects in the dataset, by image, after `match_classes`."""
        self.notes: Counter[str] = Counter()
        self._relative_boxes = [np.zeros((0, 4))]
        is_coco = self._source.file.suffix == ".json"
        path = self._source.file if is_coco else self._source.images[0].parent
        property_folder = folder if path == folder else path.parent
        self._ignored_boxes = read_image_properties(property_folder / "ignored.json")
        self._truth = read_image_properties(property_folder / "truth.json")
        self.classes = self._read_coco() if is_coco else self._read_yolo()
        boxes = np.concatenate(self._relative_boxes)
        form = COCO_FORM if is_coco else YOLO_FORM
        if wrong_form := _find_wrong_form(boxes, YOLO_FORM if is_coco else COCO_FORM):
            problem = f"many boxes end outside of their images, and seem to be {wrong_form}"
            raise InputError(f"{self._source.file}: {problem}; write {form}")
        object_count = self.object_counts.total()
        if self.notes[OUTSIDE] + self.notes[SMALL] > object_count:
            remedy = "delete the boxes without an area, or draw them around the objects"
            if is_coco and np.abs(boxes).max() <= MAX_CORNER_FRACTION:
                remedy = "all boxes are in the upper left corner; write the boxes in pixels"
            elif self.notes[OUTSIDE] > self.notes[SMALL]:
                remedy = "the boxes may belong to other or larger images; export images and boxes together"
            raise InputError(f"{self.summary}; {remedy}")
        if not object_count:
            raise InputError(f"{self.summary}; an evaluation or a training needs objects")

    def __len__(self) -> int:
        return len(self.annotations)

    def __iter__(self) -> Iterator[LabelledImage]:
        """Yield the labelled images; an image is read when the iteration reaches it.

        Raises:
            InputError: An image cannot be read.
        """
        for path, entry in self.annotations.items():
            image = dataset.read_image(path)
            yield LabelledImage(path.name, image, entry.labels, entry.boxes, entry.ignored_boxes, entry.truth)

    @property
    def object_counts(self) -> Counter[str]:
        """Number of objects of each class."""
        return Counter(label for entry in self.annotations.values() for label in entry.labels)

    @property
    def summary(self) -> str:
        """Number of images, objects of each class, and dropped boxes, as one line."""
        counts = ", ".join(f"{label} {count}" for label, count in sorted(self.object_counts.items()))
        notes = "".join(f"; {count} {description}" for description, count in self.notes.items() if count)
        return f"{self._name}: {len(self)} images; objects: {counts or 'none'}{notes}"

    def match_classes(
        self, known: Collection[str], source: str, class_map: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        """Spell class names as in `known` if they differ only in case or outer spaces, or translate them.

        Args:
            known: Known class names; empty: the names are unknown.
            source: Description of the source of the known names.
            class_map: Known class names by other names; several names may stand for one class.

        Raises:
            InputError: There are known class names, but no object has one of them.
        """
        spellings = {name.casefold(): name for name in known} | {name: name for name in known}
        spellings |= {name.casefold(): label for name, label in class_map.items()}
        for path, entry in self.annotations.items():
            own_labels = self._own_labels.setdefault(path, entry.labels)
            pairs = ((label, label.strip().casefold()) for label in own_labels)
            labels = tuple(spellings.get(name, spellings.get(key, name)) for name, key in pairs)
            self.annotations[path] = replace(entry, labels=labels)
        if known and not self.object_counts.keys() & set(known):
            names = ", ".join(self.object_counts)
            problem = f"no class of the objects ({names}) is a class of {source} ({', '.join(known)})"
            advice = "rename the classes of the dataset, or translate them with the class_map of the detector"
            raise InputError(f"{self._name}: {problem}; {advice}")

    def _read_coco(self) -> list[str]:
        """Read the annotations in a COCO file, and return the classes."""
        file = self._source.file
        content = dataset.parse_file(file, MAX_COCO_FILE_SIZE, _CocoFile.model_validate_json)
        class_names = {category.id: category.name for category in content.categories}
        objects: dict[int, list[_CocoObject]] = {image.id: [] for image in content.images}
        if len(class_names) < len(content.categories) or len(objects) < len(content.images):
            raise InputError(f"{file}: two images or two categories have the same id")
        for index, coco_object in enumerate(content.annotations):
            for key, ids in (("image_id", objects), ("category_id", class_names)):
                if (value := getattr(coco_object, key)) not in ids:
                    known = ", ".join(map(str, ids))[:MAX_QUOTATION_LENGTH] or "none"
                    raise InputError(f"{file}: annotations[{index}].{key}: no id {value}; ids: {known}")
            objects[coco_object.image_id].append(coco_object)
        for index, image in enumerate(content.images):
            path = self._source.find_image(image.file_name, f"{file}: images[{index}].file_name")
            if path in self.annotations:
                raise InputError(f"{file}: two images have the same file_name")
            singles = [coco_object for coco_object in objects[image.id] if not coco_object.iscrowd]
            self.notes["crowds dropped"] += len(objects[image.id]) - len(singles)
            corners = np.reshape([coco_object.bbox for coco_object in singles], (-1, 4))
            corners[:, 2:] += corners[:, :2]
            labels = [class_names[coco_object.category_id] for coco_object in singles]
            self._add(path, labels, corners, (image.width or 0, image.height or 0))
        # Exports of Roboflow contain a parent category, which has no objects.
        parents = {entry.supercategory for entry in content.categories if entry.supercategory != entry.name}
        parents -= {class_names[coco_object.category_id] for coco_object in content.annotations}
        return [name for _, name in sorted(class_names.items()) if name not in parents]

    def _read_yolo(self) -> list[str]:
        """Read the annotations of the images of a YOLO dataset, and return the classes."""
        # The import takes half a second, for which the refusal of wrong inputs must not wait.
        from supervision.dataset.formats.yolo import yolo_annotations_to_detections

        content = dataset.read_class_file(self._source.file)
        names = dict(enumerate(content.names)) if isinstance(content.names, list) else content.names
        labels_of_images: dict[Path, tuple[Path | None, list[list[str]]]] = {}
        for path in sorted(set(self._source.images)):
            file = dataset.find_label_file(path)
            self.notes["images without a label file"] += file is None
            text = dataset.read_text(file, dataset.MAX_LABEL_FILE_SIZE) if file else ""
            labels_of_images[path] = file, [words for line in text.splitlines() if (words := line.split())]
        all_rows = [words for _, rows in labels_of_images.values() for words in rows]
        if content.kpt_shape is None and _may_have_keypoints(all_rows):
            remedy = "state kpt_shape in data.yaml: [number of keypoints, 2 or 3], or [0, 0] for polygons"
            raise InputError(f"{self._source.file}: the labels may be boxes with keypoints; {remedy}")
        pose_word_count = 5 + math.prod(content.kpt_shape or (0, 0))
        for path, (file, rows) in labels_of_images.items():
            lines = [" ".join(words[:5] if len(words) == pose_word_count else words) for words in rows]
            try:
                detections = yolo_annotations_to_detections(lines, (1, 1), with_masks=False)
                labels = [names[number] for number in np.asarray(detections.class_id).tolist()]
            except (KeyError, ValueError, OverflowError) as error:
                raise InputError(f"{file}: a label is invalid, or has an unknown class: {error}") from error
            # NaN and infinity fail the comparison, too.
            if not (np.abs(detections.xyxy) < MAX_NORMALIZED).all():
                raise InputError(f"{file}: coordinates must be normalized (0 to 1)")
            polygon_count = sum(line.count(" ") > 5 for line in lines)
            self.notes["polygons replaced by their bounding boxes"] += polygon_count
            self._add(path, labels, np.asarray(detections.xyxy, float), (1, 1))
        return [name for _, name in sorted(names.items())]

    def _add(self, path: Path, labels: list[str], corners: Array, stated_size: tuple[int, int]) -> None:
        """Add an image with its objects, without boxes that show no object.

        Args:
            path: Path of the image.
            labels: Class of each object.
            corners: Left, top, right and bottom of each object `(N, 4)`, in an image with the stated size.
            stated_size: Width and height; (1, 1) for normalized boxes, 0 for the size of the image.
        """
        root = self._source.root
        if not os.path.isfile(path) or has_outside_link(root, str(path.relative_to(root))):
            raise InputError(f"{path} is not a file in {root}, or is a link to another folder")
        if len(labels) > MAX_OBJECT_COUNT:
            raise InputError(f"{path} has more than {MAX_OBJECT_COUNT} objects; divide the image")
        size, _ = read_image_header(path)
        stated_size = stated_size[0] or size[0], stated_size[1] or size[1]
        if size != stated_size == size[::-1]:
            raise InputError(f"{path} has {size[0]} x {size[1]} pixels: it was turned after the export")
        is_resized = stated_size not in (size, (1, 1))
        self.notes["images resized after the export"] += is_resized
        relative = corners / (stated_size * 2)
        self._relative_boxes.append(relative)
        boxes = np.clip(relative, 0, 1) * (size * 2)
        is_near = np.abs(boxes[:, None] - boxes).max(axis=2, initial=0) < MAX_COPY_DISTANCE
        is_copy = np.tril(is_near & np.equal.outer(labels, labels), -1).any(axis=1)
        is_small = ((relative[:, 2:] - relative[:, :2]) * size < MIN_BOX_SIZE).any(axis=1)
        is_outside = (boxes[:, 2:] - boxes[:, :2] < MIN_BOX_SIZE).any(axis=1)
        reasons = np.select([is_small, is_outside, is_copy], [SMALL, OUTSIDE, "duplicates dropped"], "")
        self.notes.update(reasons[reasons != ""].tolist())
        kept = np.flatnonzero(reasons == "").tolist()
        # The annotations of an image may have been written before the image was resized.
        scale = np.divide(size, stated_size) if is_resized else np.ones(2)
        ignored = np.reshape(self._ignored_boxes.get(path.name, ()), (-1, 4)) * np.tile(scale, 2)
        self.annotations[path] = DatasetEntry(
            self._split, path.name, size, tuple(labels[index] for index in kept),
            tuple(map(tuple, boxes[kept].tolist())), tuple(map(tuple, ignored.tolist())),
            self._truth.get(path.name, {}),
        )  # fmt: skip


def _may_have_keypoints(rows: Iterable[list[str]]) -> bool:
    """Return True if the words of YOLO labels may be boxes with keypoints, and not polygons.

    A box contains its keypoints. The first two points of a polygon are nearer to each other than the first
    and the farthest point; centre and size of a box are not.
    """
    numbers_of_labels = [words[1:] for words in rows if len(words) > MAX_BOX_WORDS]
    if len(set(map(len, numbers_of_labels))) != 1:
        return False
    try:
        numbers = np.array(numbers_of_labels, float)
    except ValueError:
        return False  # The parser of the labels names the word that is no number.
    centres = numbers[:, None, :2]
    sizes = numbers[:, None, 2:4]
    keypoints = numbers[:, 4:]
    if keypoints.shape[1] % 3 == 0 and np.isin(keypoints[:, 2::3], (0, 1, 2)).all():
        return True  # The third number of a keypoint is its visibility.
    if keypoints.shape[1] % 2:
        return False
    points = keypoints.reshape(len(keypoints), -1, 2)
    offsets = np.where(points.any(axis=2, keepdims=True), points - centres, 0)  # (0, 0): no keypoint
    is_inside = (np.abs(offsets) <= sizes / 2 + MAX_FRACTION - 1).all(axis=(1, 2))
    max_distances = np.linalg.norm(offsets, axis=2).max(axis=1)
    is_polygon = np.linalg.norm(sizes - centres, axis=2)[:, 0] <= max_distances
    return bool(is_inside.mean() >= KEYPOINT_FRACTIONS[0] and is_polygon.mean() < KEYPOINT_FRACTIONS[1])


def _find_wrong_form(relative: Array, other_form: str) -> str:
    """Return what the numbers of boxes seem to be: left, top, right and bottom, or `other_form`, or "".

    `relative` contains the corners `(N, 4)`, as fractions of their images, if the numbers are read as usual.
    """
    if not len(relative):
        return ""
    first = relative[:, :2]
    second = relative[:, 2:] - first
    fits = ((first <= second) & (second <= MAX_FRACTION)).all(axis=1)
    ends_outside = (np.abs(relative - 0.5) > MAX_FRACTION - 0.5).any(axis=1)
    if ([fits.mean(), ends_outside.mean()] >= np.array(CORNER_FRACTIONS)).all():
        return "left, top, right and bottom"
    shift = np.tile(second, 2) / 2
    shifted = relative - shift if other_form == YOLO_FORM else relative + shift
    fits_other_form = (np.abs(shifted - 0.5) <= MAX_FRACTION - 0.5).all()
    return other_form if fits_other_form and ends_outside.mean() >= MIN_SHIFTED_FRACTION else ""


def read_image_properties(file: Path) -> dict[str, Any]:
    """Return the content of a file such as `truth.json`: one value for each image file name.

    The result is {} if the file does not exist.
    """
    parse = TypeAdapter(dict[str, Any]).validate_json
    return dataset.parse_file(file, MAX_COCO_FILE_SIZE, parse) if file.is_file() else {}
