"""Labelled images, and the files of datasets in COCO or YOLO layout: search, reading and writing.

The written layout `coco` has a file `_annotations.coco.json` beside the images of each split, like exports of
Roboflow. The written layout `yolo` has a file `data.yaml`, and folders `images` and `labels` in each split.
The caller writes the images to the paths of `build_image_path`, and then all annotations with
`write_annotations`. Datasets of Roboflow, CVAT, Label Studio and Ultralytics are found and read, too.
"""

from __future__ import annotations

import codecs
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, TypeVar

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from executive.cell.frame import Box, Frame
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.text.files import read_file, read_image_header
from executive.text.findings import Source
from executive.text.yaml_files import load_yaml

ContentT = TypeVar("ContentT")

SPLITS = ("train", "valid", "test")
"""Names of the splits of a dataset, and of their folders."""
JPEG_QUALITY = 95
"""JPEG quality of the images, 0 to 100."""

MIN_BORDER_DISTANCE = 0.5
"""Minimum distance of the box of a complete object from the border of the searched region [pixel]."""
MIN_VISIBLE_FRACTION = 0.9
"""Minimum visible fraction of the silhouette of an object that counts as fully visible."""
IMAGE_SUFFIXES = (
    ".jpg", ".jpeg", ".jpe", ".jfif", ".png", ".bmp", ".webp", ".tif", ".tiff", ".gif", ".avif", ".jp2",
    ".ppm", ".heic", ".heif",
)  # fmt: skip
"""Suffixes of image files, in lower case; the reader refuses HEIC, rather than lose its objects silently."""
PREFERRED_SPLITS = ("test", "valid", "train", "")
"""Names of splits, in the order in which they are preferred for an evaluation; "": images without a split."""
SPLIT_NAME = re.compile("(?:^|_)(test|train|val)(?:ing|id|idation)?(?![a-z])", re.IGNORECASE)
"""Name of a split in the name of a file or in a key."""
SPLIT_FOLDER = re.compile(r"(?i)(?:obj_|images_)?(test|train|val)(ing|id|idation)?(\d*|.(data|images|set))")
"""Name of the folder of a split; a folder such as `test_tubes` is none."""
COCO_FILE = re.compile(
    r"(^|/)(_?annotations[^/]*|instances[^/]*|annotations/(test|train|val)[^/]*|result)\.json$"
)
"""Path of a COCO file, for instance of Roboflow, CVAT, or Label Studio."""
YOLO_CLASS_FILES = ("data.yaml", "data.yml", "dataset.yaml", "classes.txt", "obj.names")
"""Names of the file with the class names of a YOLO dataset: YAML, or one name per line."""
MAX_CLASS_FILE_SIZE = 100_000
"""Maximum size of a YOLO class file [byte]."""
MAX_CONTAINER_COUNT = 1_000_000
"""Maximum number of lists and mappings of a file, about 4 per object; each takes 0.3 kB while it is read."""
MAX_LABEL_FILE_SIZE = 10_000_000
"""Maximum size of a YOLO label file, or of a text file with the paths of images [byte]."""


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
            # The image may be a scaled part of a frame.
            left, top, *_ = self.truth.get("part", (0, 0))
            matrix = np.array(self.truth["matrix"], dtype=float)
            matrix[:2, 2] -= left, top
            matrix[:2] /= self.pixel_scale[:, None]
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


def read_image(path: Path) -> NDArray[np.uint8]:
    """Return an image file as `(H, W, 3)` uint8, RGB, turned upright by its EXIF orientation.

    Raises:
        InputError: The image cannot be read, or has too many pixels.
    """
    read_image_header(path)
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"the image {path} cannot be read; is it missing or damaged?")
    return np.ascontiguousarray(image[..., ::-1], dtype=np.uint8)


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


@dataclass(frozen=True)
class Split:
    """A part of a dataset, for instance the images for a training.

    Attributes:
        root: Folder of the dataset, which contains all images.
        file: COCO file (suffix `.json`) or YOLO class file.
        images: Paths of the images of a YOLO dataset.
    """

    root: Path
    file: Path
    images: list[Path] = field(default_factory=list)

    def find_image(self, name: str, location: str) -> Path:
        """Return the path of the image that an annotation file names.

        Raises:
            InputError: The image is missing; `location` (file and key) starts the message.
        """
        subfolder = self.file.stem.partition("_")[2]  # For instance `default` of `instances_default.json`.
        folders = (f"images/{subfolder}", subfolder, "images", "")
        if path := _find_path([self.file.parent, *(self.root / folder for folder in folders)], name):
            return path
        raise InputError(f'{location}: "{name}" is not a file in {self.file.parent}')


def find_splits(dataset: Path) -> dict[str, Split]:
    """Return the splits of a dataset by name, in the order of `PREFERRED_SPLITS`.

    Raises:
        InputError: A class file or a list of images is damaged, or a split has several COCO files.
    """
    splits: dict[str, Split] = {}
    for file in sorted([*dataset.glob("*.json"), *dataset.glob("*/*.json")]):
        if COCO_FILE.search(file.as_posix()):
            split = splits.setdefault(_name_split(str(file.relative_to(dataset))), Split(dataset, file))
            if split.file != file:
                raise InputError(f"{split.file} and {file} are COCO files of one split; keep one of them")
    folders = (dataset, *dataset.absolute().parents[:2])
    class_files = (folder / name for folder in folders for name in YOLO_CLASS_FILES)
    if not splits and (class_file := next(filter(os.path.isfile, class_files), None)):
        for name, image in _list_yolo_images(dataset, class_file):
            splits.setdefault(name, Split(dataset, class_file)).images.append(image)
    return {name: splits[name] for name in PREFERRED_SPLITS if name in splits}


def _list_yolo_images(dataset: Path, class_file: Path) -> Iterator[tuple[str, Path]]:
    """Yield split and path of each image of a YOLO dataset, as listed in its class file or by folder."""
    content = read_class_file(class_file)
    sources = []
    for key, entries in (content.model_extra or {}).items():
        for entry in [entries] if isinstance(entries, str) else entries:
            source = _find_path([dataset], str(Path(content.path, str(entry))), _name_split(key))
            if entry and source and _name_split(key):
                sources.append((_name_split(key), source))
    for name, source in sources:
        if source.is_dir():
            yield from ((name, path) for path in _list_images(source))
        else:
            lines = filter(str.strip, read_text(source, MAX_LABEL_FILE_SIZE).splitlines())
            split = Split(dataset, class_file)
            yield from ((name, split.find_image(line.strip(), str(source))) for line in lines)
    if not sources:
        for path in _list_images(dataset):
            yield _name_split(f"{path.relative_to(dataset).parent.as_posix()}/"), path


def _list_images(folder: Path) -> Iterator[Path]:
    """Yield the paths of the image files in a folder and its subfolders, without hidden files."""
    for path in folder.rglob("*"):
        if path.suffix.lower() in IMAGE_SUFFIXES and not path.name.startswith("."):
            yield path


def find_label_file(image: Path) -> Path | None:
    """Return the label file of a YOLO image: in the folder `labels` beside `images`, or beside the image."""
    before, separator, after = str(image.absolute()).rpartition(f"{os.sep}images{os.sep}")
    paths = (Path(before, "labels", after) if separator else image, image)
    candidates = (path.with_suffix(suffix) for path in paths for suffix in (".txt", ".TXT"))
    return next(filter(os.path.lexists, candidates), None)


def _find_path(folders: list[Path], name: str, required_split: str = "") -> Path | None:
    """Return the path in one of the folders whose end agrees most with the path `name`, or None.

    `name` may be a path on another computer, a Windows path, or relative to another folder. A path of which
    only the end agrees must name `required_split`.
    """
    for path in (PurePosixPath(name), PureWindowsPath(name)):
        parts = [part for part in path.parts if part not in (path.anchor, "..")]
        for start in range(max(len(parts), 1)):
            end = Path(*parts[start:])
            found = next((folder / end for folder in folders if os.path.exists(folder / end)), None)
            if found and (not start or _name_split(str(end)) == (required_split or _name_split(str(end)))):
                return found
    return None


def _name_split(path: str) -> str:
    """Return the name of the split in a key or in a path, or ""; the path of a folder ends with "/"."""
    *folders, name = path.split("/")
    matches = [*map(SPLIT_FOLDER.fullmatch, folders), SPLIT_NAME.search(name)]
    match = next(filter(None, matches), None)
    return {"val": "valid"}.get(match[1].lower(), match[1].lower()) if match else ""


class YoloFile(BaseModel, extra="allow"):
    """A YOLO class file: class names by number, and shape of the keypoints; further keys name the splits.

    The shape of the keypoints is (0, 0) for boxes and polygons, and None if the file does not state it.
    """

    names: dict[int, str] | list[str]
    path: str = ""
    kpt_shape: tuple[int, int] | None = None


def read_class_file(file: Path) -> YoloFile:
    """Return the content of a YOLO class file.

    Raises:
        InputError: The file is damaged.
    """

    def parse(text: str) -> YoloFile:
        """Return the content; `BaseLoader` keeps a class name `no`, which YAML would convert to False."""
        if file.suffix in (".yaml", ".yml"):
            return YoloFile.model_validate(load_yaml(Source(str(file), text), yaml.BaseLoader))
        return YoloFile(names=[line.strip() for line in text.strip().splitlines()])

    return parse_file(file, MAX_CLASS_FILE_SIZE, parse)


def parse_file(file: Path, max_size: int, parse: Callable[[str], ContentT]) -> ContentT:
    """Return the parsed content of a file of at most `max_size` [byte].

    Raises:
        InputError: The file is too large, cannot be read, is invalid, or lacks a required key; the message
            names the line or the key.
    """
    text = read_text(file, max_size)
    if text.count("[") + text.count("{") > MAX_CONTAINER_COUNT:
        raise InputError(
            f"{file} contains more than {MAX_CONTAINER_COUNT} lists and mappings; divide the dataset"
        )
    try:
        return parse(text)
    except ValidationError as error:
        problem = error.errors()[0]
        keys = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in problem["loc"])
        raise InputError(f"{file}: {keys.removeprefix('.') or 'content'}: {problem['msg']}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file} cannot be read: {error}") from error


def read_text(file: Path, max_size: int) -> str:
    """Return the text of a file of at most `max_size` [byte], without byte order mark.

    Raises:
        InputError: The file is too large or cannot be read.
    """
    content = read_file(file, max_size)
    is_utf16 = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        return content.decode("utf-16" if is_utf16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{file} cannot be read: {error}") from error
