"""Writers of one small dataset as other tools write it, with the mistakes of their users."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from PIL import Image

from executive.training.dataset import LabelledImage

CLASSES = ("cube", "duck", "sphere")
TURNS = {1: 0, 3: 2, 6: 1, 8: 3}
"""Anticlockwise quarter turns from the upright to the stored image, by EXIF orientation."""
Samples = Sequence[LabelledImage]
Change = Callable[[dict[str, Any]], object]
"""Change of the content of a COCO file."""


def write_image(path: Path, image: Any, turn: int = 1, factors: Any = (1, 1), mode: str = "RGB") -> None:
    """Write an image with the EXIF orientation `turn`, resized by factors on width and height."""
    size = round(image.shape[1] * factors[0]), round(image.shape[0] * factors[1])
    resized = np.asarray(Image.fromarray(image).resize(size))
    exif = Image.Exif()
    exif[0x112] = turn
    path.parent.mkdir(parents=True, exist_ok=True)
    options = {"exif": exif} if turn > 1 else {}
    Image.fromarray(np.rot90(resized, TURNS[turn])).convert(mode).save(path, quality=95, **options)


def write_coco(
    root: Path, samples: Samples, *, file: str = "test/_annotations.coco.json", folder: str = "test",
    suffixes: Sequence[str] = (".png",), name: str = "{}", stored_name: str = "{}", encoding: str = "utf-8",
    change: Change = lambda _content: None, **image_options: Any,
) -> None:  # fmt: skip
    """Write a COCO dataset."""
    content: dict[str, Any] = {"images": [], "annotations": []}
    content["categories"] = [{"id": number, "name": label} for number, label in enumerate(CLASSES)]
    for number, sample in enumerate(samples):
        image_file = f"a{number}{suffixes[number % len(suffixes)]}"
        write_image(root / folder / stored_name.format(image_file), sample.image, **image_options)
        size = {"width": sample.image.shape[1], "height": sample.image.shape[0]}
        content["images"].append({"id": number, "file_name": name.format(image_file), **size})
        for label, (left, top, right, bottom) in zip(sample.labels, sample.boxes, strict=True):
            box = {"bbox": [left, top, right - left, bottom - top], "category_id": CLASSES.index(label)}
            content["annotations"].append({"image_id": number, **box})
    change(content)
    (root / file).parent.mkdir(parents=True, exist_ok=True)
    (root / file).write_text(json.dumps(content), encoding=encoding)


def write_yolo(
    root: Path, samples: Samples, *, folder: str = "images/val", labels: str = "labels/val", data: Any = (),
    suffixes: Sequence[str] = (".png",), line: str = "{n} {x} {y} {w} {h}", file: str = "data.yaml",
    encoding: str = "utf-8", prefix: str = "",
) -> None:  # fmt: skip
    """Write a YOLO dataset; `val.txt` contains the paths of the images with a prefix."""
    for number, sample in enumerate(samples):
        image_path = root / folder / f"a{number}{suffixes[number % len(suffixes)]}"
        write_image(image_path, sample.image)
        path = root / labels / f"a{number}.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", encoding=encoding, newline="\r\n") as stream:
            for label, box in zip(sample.labels, sample.boxes, strict=True):
                l, t, r, b = np.array(box) / np.tile(sample.image.shape[1::-1], 2)  # noqa: E741
                values = {"l": l, "t": t, "r": r, "b": b, "x": (l + r) / 2, "y": (t + b) / 2}
                stream.write(line.format(n=CLASSES.index(label), w=r - l, h=b - t, p=box, **values) + "\n")
        with (root / "val.txt").open("a") as stream:
            stream.write(f"{prefix}{image_path.relative_to(root)}\n")
    content = yaml.safe_dump({"names": list(CLASSES), **dict(data)})
    (root / file).write_text(content if file == "data.yaml" else "\n".join(CLASSES), encoding=encoding)


def add(*boxes: Any, **keys: Any) -> Change:
    """Return a change that adds boxes to each image."""
    return lambda content: content["annotations"].extend(
        {"image_id": image["id"], "category_id": 1, "bbox": box, **keys}
        for image in content["images"]
        for box in boxes
    )


def change_boxes(function: Callable[..., Any], is_added: bool = False) -> Change:
    """Return a change that replaces each box, or adds a box to it, as a function of box and image size."""

    def change(content: dict[str, Any]) -> None:
        size = [content["images"][0][key] for key in ("width", "height")]
        changed = [{**entry, "bbox": function(*entry["bbox"], *size)} for entry in content["annotations"]]
        content["annotations"] = changed + (content["annotations"] if is_added else [])

    return change


def update(key: str, *values: Any) -> Change:
    """Return a change of all elements of `key`, by one value each or by the same value."""
    return lambda content: [
        element.update(values[index % len(values)]) for index, element in enumerate(content[key])
    ]


def add_parent(content: dict[str, Any]) -> None:
    """Add a category without objects, as Roboflow does."""
    update("categories", {"supercategory": "things"})(content)
    content["categories"].append({"id": 9, "name": "things", "supercategory": "none"})


COCO: dict[str, dict[str, Any]] = {
    "roboflow": {},
    "cvat with subset": {"file": "annotations/instances_default.json", "folder": "images/default"},
    "cvat with test": {"file": "annotations/instances_Test.json", "folder": "images/Test"},
    "coco 2017": {"file": "annotations/instances_val2017.json", "folder": "val2017", "encoding": "utf-16"},
    "label studio": {"file": "result.json", "folder": "images", "name": "images\\{}"},
    "flat": {"file": "_annotations.coco.json", "folder": ""},
    "backslash on disk": {"name": "cam\\{}", "stored_name": "cam\\{}"},
    "windows path": {"name": "C:\\data\\test\\{}"},
    "path of another computer": {"name": "/home/joe/data/test/{}", "encoding": "utf-8-sig"},
    "upper case": {"suffixes": (".JPG", ".TIFF", ".Png"), "mode": "RGB"},
    "mixed": {"suffixes": (".webp", ".tif", ".png"), "mode": "RGBA"},
    "turned by 90": {"turn": 6, "suffixes": (".jpg", ".png", ".webp")},
    "stretched": {"factors": (1.0, 1.25)},
    "without size": {"change": update("images", {"width": 0, "height": None})},
    "case": {"change": update("categories", {"name": "Cube"}, {"name": "DUCK"}, {"name": "sphere "})},
    "crowds": {"change": add([0, 0, 30, 30], iscrowd=1)},
    "outside": {"change": add([5000, 5, 20, 20], [5, -90, 20, 20])},
    "twice, rounded": {"change": change_boxes(lambda *box: [round(x) for x in box[:4]], is_added=True)},
    "parent category": {"change": add_parent},
}
"""Options of `write_coco` for datasets that are read like the clean one."""
POSE = "{n} {x} {y} {w} {h} {l} {t} 2 {x} {y} 1 0 0 0"
YOLO: dict[str, dict[str, Any]] = {
    "ultralytics": {"data": {"path": "/home/joe/bolts", "train": "images/train", "val": "images/val"}},
    "roboflow": {"folder": "valid/images", "labels": "valid/labels", "data": {"val": "../valid/images"}},
    "list of another computer": {"data": {"val": "D:\\bolts\\val.txt"}, "prefix": "D:\\bolts\\"},
    "without split": {"folder": "images", "labels": "labels", "data": {"test": ""}},
    "flat": {"folder": "", "labels": ""},
    "darknet": {"folder": "obj_Train_data", "labels": "obj_Train_data", "file": "obj.names"},
    "pose [3, 3]": {"line": POSE, "data": {"kpt_shape": [3, 3]}},
    "pose [2, 2]": {"line": "{n} {x} {y} {w} {h} {l} {t} {x} {y}", "data": {"kpt_shape": [2, 2]}},
    "polygons": {"line": "{n} {l} {y} {x} {t} {r} {y} {r} {b} {x} {b}"},
    "oriented boxes": {"line": "{n} {l} {y} {x} {t} {r} {y} {x} {b}"},
    "boxes and polygons": {"line": "{n} {x} {y} {w} {h}\n{n} {l} {t} {r} {y} {l} {b}"},
    "confidences": {"line": "{n}.0 {x} {y} {w} {h} 0.9"},
    "byte order marks": {"encoding": "utf-8-sig", "data": {"val": "val.txt"}, "suffixes": (".WEBP", ".Png")},
    "numbered names": {"data": {"names": dict(enumerate(CLASSES)), "val": "images/val"}},
    "outside": {"line": "{n} {x} {y} {w} {h}\n0 1.4 0.5 0.1 0.1"},
}
"""Options of `write_yolo` for datasets that are read like the clean one."""
REFUSED: dict[str, tuple[Callable[..., None], dict[str, Any]]] = {
    "seem to be left, top, right": (
        write_coco, {"change": change_boxes(lambda x, y, w, h, *_: [x, y, x + w, y + h])}),
    "write the boxes in pixels": (
        write_coco, {"change": change_boxes(lambda x, y, w, h, W, H: [x / W, y / H, w / W, h / H])}),
    "export images and boxes": (write_coco, {"change": add([-9, 0, 5, 5], [0, -9, 5, 5], [-9, -9, 5, 5])}),
    "seem to be centre x": (
        write_coco, {"change": change_boxes(lambda x, y, w, h, *_: [x + w / 2, y + h / 2, w, h])}),
    "seem to be left, top, width": (write_yolo, {"line": "{n} {l} {t} {w} {h}"}),
    "is a class of detector eye": (write_coco, {"change": update("categories", {"name": "bolt"})}),
    "was turned": (write_coco, {"turn": 6, "change": update("images", {"width": 120, "height": 160})}),
    "objects: none": (write_coco, {"change": lambda content: content["annotations"].clear()}),
    "is not a file": (write_coco, {"name": "b{}"}),
    "must be normalized": (write_yolo, {"line": "{n} {p[0]} {p[1]} 30 40"}),
    "state kpt_shape": (write_yolo, {"line": POSE}),
    "with keypoints": (write_yolo, {"line": "{n} {x} {y} {w} {h} {l} {t} {x} {y}"}),
    "label is invalid": (write_yolo, {"line": "{n} {x} {y} {w}"}),
    "unknown class": (write_yolo, {"line": "7 {x} {y} {w} {h}"}),
}  # fmt: skip
"""Writers and options of ambiguous and damaged datasets, by a key word of the error."""
VARIANTS = {
    **{f"coco {name}": partial(write_coco, **options) for name, options in COCO.items()},
    **{f"yolo {name}": partial(write_yolo, **options) for name, options in YOLO.items()},
}
