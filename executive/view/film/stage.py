"""The picture of the cell, with what the camera saw and what the robot does written into it."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from executive.record.pictures.strip import HEIGHT as STRIP
from executive.view.film.course import Course
from executive.view.film.ink import BACK, DIM, FAILURE, INK, RUNNING, clipped, font, wrapped

STAGE = (800, 720)
"""Width and height of the picture of the cell [pixel]."""
INSET = (224, 168)
"""Largest width and height of what the camera saw [pixel]."""
_MARGIN, _PAD, _TYPE, _LABEL = 20, 12, 17, 13
_LINE = 23


def dress(picture: NDArray[np.uint8], course: Course, caption: bool) -> Image.Image:
    """Return the picture `(h, w, 3)` of the cell with what the camera saw, and a caption if it is wanted."""
    stage = Image.fromarray(picture)
    inset = None if course.picture is None else _inset(course.picture)
    if inset is not None and course.picture is not None:
        _put_inset(stage, inset, _title(course.picture))
    if not caption:
        return stage
    if course.trouble:
        _put_caption(stage, wrapped(course.trouble, _TYPE, 620, 2), FAILURE)
    elif course.doing:
        _put_caption(stage, [clipped(course.doing, _TYPE, 620)], RUNNING)
    return stage


def _put_inset(stage: Image.Image, inset: Image.Image, title: str) -> None:
    width, height = inset.size
    draw = ImageDraw.Draw(stage)
    box = (_MARGIN, _MARGIN, _MARGIN + width + 7, _MARGIN + height + 31)
    draw.rounded_rectangle(box, 6, BACK)
    stage.paste(inset, (_MARGIN + 4, _MARGIN + 4))
    text = clipped(title, _LABEL, width - 8)
    draw.text((_MARGIN + 10, _MARGIN + height + 17), text, DIM, font(_LABEL), "lm")


def _put_caption(stage: Image.Image, lines: list[str], colour: str) -> None:
    """Write what there is to say at the bottom of the picture, beside a bar of its colour."""
    width = max(font(_TYPE).getlength(line) for line in lines) + 2 * _PAD + 8
    height = _LINE * len(lines) + 14
    left, top = _MARGIN, STAGE[1] - _MARGIN - height
    draw = ImageDraw.Draw(stage)
    draw.rounded_rectangle((left, top, left + width, top + height), 6, BACK)
    draw.rounded_rectangle((left + 6, top + 7, left + 9, top + height - 7), 2, colour)
    for number, line in enumerate(lines):
        middle = top + 7 + _LINE * (number + 0.5)
        draw.text((left + _PAD + 8, middle), line, INK, font(_TYPE), "lm")


def _title(picture: Path) -> str:
    """Return what a picture is of, by its file's name: `<tick>_<item>_<reason>`, either may be missing."""
    return "camera:  " + " ".join(picture.stem.split("_", 2)[1:]).replace("_", " ")


@lru_cache(maxsize=2)
def _inset(picture: Path) -> Image.Image | None:
    """Return the image in a picture, without the strip below it; None where it cannot be read any more."""
    try:
        with Image.open(picture) as file:
            image = file.convert("RGB")
    except (OSError, ValueError):
        return None
    image = image.crop((0, 0, image.width, image.height - STRIP))
    image.thumbnail(INSET, Image.Resampling.LANCZOS)
    return image
