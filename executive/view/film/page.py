"""Frame of a film: the cell on the left, the decisions of the executive on the right."""

from __future__ import annotations

from dataclasses import asdict
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from executive.events import RunEnded
from executive.record.pictures.strip import HEIGHT as STRIP
from executive.record.result import Result
from executive.view.film import panel
from executive.view.film.course import FilmCourse
from executive.view.film.ink import BACK, DIM, FAILURE, INK, RULE, RUNNING, SUCCESS, clip, font, wrap
from executive.view.film.source import FilmSource

WIDTH, HEIGHT = 1280, 720
"""Size of a frame [pixel]."""
SCENE_SIZE = (800, 720)
"""Width and height of the image of the cell [pixel]."""
LEFT, RIGHT = SCENE_SIZE[0] + 28, WIDTH - 28
"""Left and right end of the panel's text [pixel]."""
INSET = (224, 168)
"""Largest width and height of the camera image [pixel]."""
CAPTION, CARD = 620, 620
"""Largest widths of the text of a caption and of the box with the result [pixel]."""
_TITLE, _NOTE, _TREE_TOP, _BELOW = 26, 14, 122, 22
_MARGIN, _PAD, _TYPE, _LABEL, _LINE = 20, 12, 17, 13, 23
_END_STATUS, _END_TYPE, _END_LINE, _END_PAD = 40, 18, 26, 24
_COLOURS = {"SUCCESS": SUCCESS, "INCOMPLETE": FAILURE, "FAILURE": FAILURE, "FAULT": FAILURE}


def draw_page(
    source: FilmSource,
    picture: NDArray[np.uint8],
    course: FilmCourse,
    note: str,
    length: float,
    caption: bool = True,
) -> Image.Image:
    """Return the frame for the state of a run in `course`.

    Args:
        source: The record of the run.
        picture: Image of the world, of the size `SCENE_SIZE`.
        course: The run so far.
        note: Second line of the page: seed, cell, speed.
        length: Time on the robot's clock in all [s].
        caption: Say below the picture what the robot does.
    """
    page = Image.new("RGB", (WIDTH, HEIGHT), BACK)
    page.paste(Image.fromarray(picture), (0, 0))
    _draw_camera(page, course.picture)
    if caption and (course.failure or course.current_action):
        lines = wrap(course.failure, _TYPE, CAPTION, 2) or [clip(course.current_action, _TYPE, CAPTION)]
        _draw_caption(page, lines, FAILURE if course.failure else RUNNING)
    _draw_head(page, source.start.mission, note, course.clock, length)
    top = HEIGHT - _BELOW - panel.height(source.items)
    ImageDraw.Draw(page).line((LEFT, top - 10, RIGHT, top - 10), RULE, 1)
    panel.draw_items(page, (LEFT, top, RIGHT, HEIGHT), course.timeline.items.now(), source.bins)
    panel.draw_branch(page, (LEFT, _TREE_TOP, RIGHT, top - 18), source.nodes, course)
    return page


def draw_ending(page: Image.Image, result: Result | RunEnded | None) -> Image.Image:
    """Return a frame with the result of a run over the image of the cell."""
    status, sentence, figures = describe_result(result)
    lines = wrap(sentence, _END_TYPE, CARD - 2 * _END_PAD, 4)
    notes = wrap(figures, _END_TYPE, CARD - 2 * _END_PAD, 2)
    height = (
        2 * _END_PAD + _END_STATUS + _END_LINE * (len(lines) + len(notes)) + (10 if lines or notes else 0)
    )
    longest = max((font(_END_TYPE).getlength(line) for line in [*lines, *notes]), default=0)
    width = max(longest, font(_END_STATUS).getlength(status)) + 2 * _END_PAD
    left, top = SCENE_SIZE[0] - width - _MARGIN, SCENE_SIZE[1] - height - _MARGIN
    colour = _COLOURS.get(status, RUNNING)
    shown = page.copy()
    draw = ImageDraw.Draw(shown)
    draw.rounded_rectangle((left, top, left + width, top + height), 10, BACK)
    draw.rounded_rectangle((left, top, left + 8, top + height), 4, colour)
    draw.text((left + _END_PAD, top + _END_PAD + _END_STATUS / 2), status, colour, font(_END_STATUS), "lm")
    middle = top + _END_PAD + _END_STATUS + 10 + _END_LINE / 2
    for number, text in enumerate([*lines, *notes]):
        ink = INK if number < len(lines) else DIM
        draw.text((left + _END_PAD, middle + _END_LINE * number), text, ink, font(_END_TYPE), "lm")
    return shown


def describe_result(result: Result | RunEnded | None) -> tuple[str, str, str]:
    """Return status, sentence and counts of the result of a run; None means that the run was interrupted."""
    if result is None:
        return "CUT OFF", "the record ends here; nothing says how the run would have ended", ""
    if isinstance(result, RunEnded):
        return result.status, result.message, ""
    ends = ", ".join(f"{count} {end}" for end, count in asdict(result.items).items() if count)
    verdict = result.message if result.story is None else result.story.verdict
    return result.status, verdict, f"{ends}; {result.robot_time_s:.1f} s"


def _draw_head(page: Image.Image, title: str, note: str, clock: float, length: float) -> None:
    """Draw the title, the time, and the progress of the run."""
    draw = ImageDraw.Draw(page)
    room = RIGHT - LEFT - font(_TITLE).getlength(f"{length:.1f} s") - 24
    draw.text((LEFT, 50), clip(title, _TITLE, room), INK, font(_TITLE), "ls")
    draw.text((RIGHT, 50), f"{clock:.1f} s", INK, font(_TITLE), "rs")
    draw.text((LEFT, 76), clip(note, _NOTE, RIGHT - LEFT), DIM, font(_NOTE), "ls")
    share = clock / length if length else 1.0
    draw.rectangle((LEFT, 94, RIGHT, 96), RULE)
    draw.rectangle((LEFT, 94, LEFT + round(share * (RIGHT - LEFT)), 96), RUNNING)


def _draw_caption(page: Image.Image, lines: list[str], colour: str) -> None:
    """Write lines at the bottom of the image, beside a bar of this colour."""
    width = max(font(_TYPE).getlength(line) for line in lines) + 2 * _PAD + 8
    height = _LINE * len(lines) + 14
    left, top = _MARGIN, SCENE_SIZE[1] - _MARGIN - height
    draw = ImageDraw.Draw(page)
    draw.rounded_rectangle((left, top, left + width, top + height), 6, BACK)
    draw.rounded_rectangle((left + 6, top + 7, left + 9, top + height - 7), 2, colour)
    for number, line in enumerate(lines):
        middle = top + 7 + _LINE * (number + 0.5)
        draw.text((left + _PAD + 8, middle), line, INK, font(_TYPE), "lm")


def _draw_camera(page: Image.Image, picture: Path | None) -> None:
    """Draw a camera image in the corner; its caption is from the file name `<tick>_<item>_<reason>`."""
    inset = None if picture is None else _load_inset(picture)
    if inset is None or picture is None:
        return
    width, height = inset.size
    draw = ImageDraw.Draw(page)
    draw.rounded_rectangle((_MARGIN, _MARGIN, _MARGIN + width + 7, _MARGIN + height + 31), 6, BACK)
    page.paste(inset, (_MARGIN + 4, _MARGIN + 4))
    title = "camera:  " + picture.stem.partition("_")[2].replace("_", " ")
    place = (_MARGIN + 10, _MARGIN + height + 17)
    draw.text(place, clip(title, _LABEL, width - 8), DIM, font(_LABEL), "lm")


@lru_cache(maxsize=2)
def _load_inset(picture: Path) -> Image.Image | None:
    """Return the camera image in a file, without the strip of text below it; None if it cannot be read."""
    try:
        with Image.open(picture) as file:
            image = file.convert("RGB")
    except (OSError, ValueError):
        return None
    image = image.crop((0, 0, image.width, image.height - STRIP))
    image.thumbnail(INSET, Image.Resampling.LANCZOS)
    return image
