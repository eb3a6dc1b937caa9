"""Frame of a film: the cell on the left, the decisions of the executive on the right."""

from __future__ import annotations

from dataclasses import asdict
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from executive.events import RunEnded
from executive.record.pictures.status_bar import STATUS_BAR_HEIGHT
from executive.record.result import Result
from executive.view.film import panel, style
from executive.view.film.film_source import FilmSource
from executive.view.film.run_state import FilmRunState
from executive.view.film.style import BACKGROUND, FAILURE, LINE, MINOR_TEXT, RUNNING, SUCCESS, TEXT

WIDTH, HEIGHT = 1280, 720
"""Size of a frame [pixel]."""
SCENE_SIZE = (800, 720)
"""Width and height of the image of the cell [pixel]."""
LEFT, RIGHT = SCENE_SIZE[0] + 28, WIDTH - 28
"""Left and right end of the text on the right side of a frame [pixel]."""
MAX_INSET_SIZE = (224, 168)
"""Maximum width and height of the camera image in the corner [pixel]."""
MAX_CAPTION_WIDTH, MAX_RESULT_WIDTH = 620, 620
"""Maximum widths of the text of a caption and of the box with the result [pixel]."""
_TITLE_SIZE, _SUBTITLE_SIZE, _TREE_TOP, _BOTTOM_MARGIN = 26, 14, 122, 22
_MARGIN, _PADDING, _TEXT_SIZE, _LABEL_SIZE, _LINE_HEIGHT = 20, 12, 17, 13, 23
_STATUS_SIZE, _RESULT_SIZE, _RESULT_LINE, _RESULT_PADDING = 40, 18, 26, 24
"""Font sizes, positions and distances [pixel]."""
_STATUS_COLOURS = {"SUCCESS": SUCCESS, "INCOMPLETE": FAILURE, "FAILURE": FAILURE, "FAULT": FAILURE}


def draw_frame(
    source: FilmSource, picture: NDArray[np.uint8], state: FilmRunState, subtitle: str, duration: float,
    *, has_caption: bool = True,
) -> Image.Image:  # fmt: skip
    """Return the frame for the state of a run in `state`.

    Args:
        source: The record of the run.
        picture: Image of the world, of the size `SCENE_SIZE`.
        state: State of the run at the time of the frame.
        subtitle: Second line of the header: seed, cell and speed.
        duration: Duration of the run on the robot's clock [s].
        has_caption: True to write the current action or failure over the image of the world.
    """
    page = Image.new("RGB", (WIDTH, HEIGHT), BACKGROUND)
    page.paste(Image.fromarray(picture), (0, 0))
    _draw_camera(page, state.picture_file)
    if has_caption and (state.failure_text or state.action_text):
        text, max_lines = (state.failure_text, 2) if state.failure_text else (state.action_text, 1)
        lines = style.wrap(text, _TEXT_SIZE, MAX_CAPTION_WIDTH, max_lines)
        _draw_caption(page, lines, FAILURE if state.failure_text else RUNNING)
    _draw_header(page, source.start.mission, subtitle, state.time, duration)
    top = HEIGHT - _BOTTOM_MARGIN - panel.compute_height(source.item_count)
    ImageDraw.Draw(page).line((LEFT, top - 10, RIGHT, top - 10), LINE, 1)
    panel.draw_items(page, (LEFT, top, RIGHT, HEIGHT), state.timeline.items.list_items(), source.bin_colours)
    panel.draw_tree(page, (LEFT, _TREE_TOP, RIGHT, top - 18), source.nodes, state)
    return page


def draw_result(page: Image.Image, result: Result | RunEnded | None) -> Image.Image:
    """Return a copy of a frame, with the result of the run in a box over the image of the cell."""
    status, message, counts = describe_result(result)
    message_lines = style.wrap(message, _RESULT_SIZE, MAX_RESULT_WIDTH - 2 * _RESULT_PADDING, 4)
    lines = [*message_lines, *style.wrap(counts, _RESULT_SIZE, MAX_RESULT_WIDTH - 2 * _RESULT_PADDING, 2)]
    height = 2 * _RESULT_PADDING + _STATUS_SIZE + _RESULT_LINE * len(lines) + (10 if lines else 0)
    longest = max((style.load_font(_RESULT_SIZE).getlength(line) for line in lines), default=0)
    width = max(longest, style.load_font(_STATUS_SIZE).getlength(status)) + 2 * _RESULT_PADDING
    left, top = SCENE_SIZE[0] - width - _MARGIN, SCENE_SIZE[1] - height - _MARGIN
    text_left = left + _RESULT_PADDING
    colour = _STATUS_COLOURS.get(status, RUNNING)
    frame = page.copy()
    draw = ImageDraw.Draw(frame)
    draw.rounded_rectangle((left, top, left + width, top + height), 10, BACKGROUND)
    draw.rounded_rectangle((left, top, left + 8, top + height), 4, colour)
    y = top + _RESULT_PADDING + _STATUS_SIZE / 2
    draw.text((text_left, y), status, colour, style.load_font(_STATUS_SIZE), "lm")
    y = top + _RESULT_PADDING + _STATUS_SIZE + 10 + _RESULT_LINE / 2
    for number, line in enumerate(lines):
        colour = TEXT if number < len(message_lines) else MINOR_TEXT
        draw.text((text_left, y + _RESULT_LINE * number), line, colour, style.load_font(_RESULT_SIZE), "lm")
    return frame


def describe_result(result: Result | RunEnded | None) -> tuple[str, str, str]:
    """Return status, message and item counts of a run as texts; `result` None: the run was interrupted."""
    if result is None:
        return "INTERRUPTED", "the record ends here; the result of the run is unknown", ""
    if isinstance(result, RunEnded):
        return result.status, result.message, ""
    counts = ", ".join(f"{count} {end}" for end, count in asdict(result.items).items() if count)
    verdict = result.message if result.diagnosis is None else result.diagnosis.verdict
    return result.status, verdict, f"{counts}; {result.robot_time_s:.1f} s"


def _draw_header(page: Image.Image, title: str, subtitle: str, time: float, duration: float) -> None:
    """Draw the title, the time [s], and a bar with the progress of the run."""
    draw = ImageDraw.Draw(page)
    title_font = style.load_font(_TITLE_SIZE)
    max_width = RIGHT - LEFT - title_font.getlength(f"{duration:.1f} s") - 24
    draw.text((LEFT, 50), style.truncate(title, _TITLE_SIZE, max_width), TEXT, title_font, "ls")
    draw.text((RIGHT, 50), f"{time:.1f} s", TEXT, title_font, "rs")
    subtitle = style.truncate(subtitle, _SUBTITLE_SIZE, RIGHT - LEFT)
    draw.text((LEFT, 76), subtitle, MINOR_TEXT, style.load_font(_SUBTITLE_SIZE), "ls")
    progress = time / duration if duration else 1.0
    draw.rectangle((LEFT, 94, RIGHT, 96), LINE)
    draw.rectangle((LEFT, 94, LEFT + round(progress * (RIGHT - LEFT)), 96), RUNNING)


def _draw_caption(page: Image.Image, lines: list[str], colour: str) -> None:
    """Write lines at the bottom of the image of the cell, beside a bar with the colour `colour`."""
    width = max(style.load_font(_TEXT_SIZE).getlength(line) for line in lines) + 2 * _PADDING + 8
    height = _LINE_HEIGHT * len(lines) + 14
    left, top = _MARGIN, SCENE_SIZE[1] - _MARGIN - height
    draw = ImageDraw.Draw(page)
    draw.rounded_rectangle((left, top, left + width, top + height), 6, BACKGROUND)
    draw.rounded_rectangle((left + 6, top + 7, left + 9, top + height - 7), 2, colour)
    for number, line in enumerate(lines):
        middle = top + 7 + _LINE_HEIGHT * (number + 0.5)
        draw.text((left + _PADDING + 8, middle), line, TEXT, style.load_font(_TEXT_SIZE), "lm")


def _draw_camera(page: Image.Image, picture: Path | None) -> None:
    """Draw a camera image in the corner, labelled by its file name `<tick>_<item>_<reason>`."""
    inset = None if picture is None else _load_inset(picture)
    if inset is None or picture is None:
        return
    width, height = inset.size
    draw = ImageDraw.Draw(page)
    draw.rounded_rectangle((_MARGIN, _MARGIN, _MARGIN + width + 7, _MARGIN + height + 31), 6, BACKGROUND)
    page.paste(inset, (_MARGIN + 4, _MARGIN + 4))
    title = "camera:  " + picture.stem.partition("_")[2].replace("_", " ")
    place = (_MARGIN + 10, _MARGIN + height + 17)
    title = style.truncate(title, _LABEL_SIZE, width - 8)
    draw.text(place, title, MINOR_TEXT, style.load_font(_LABEL_SIZE), "lm")


@lru_cache(maxsize=2)
def _load_inset(picture: Path) -> Image.Image | None:
    """Return the camera image in a file, without the status bar below it; None if the file is unreadable."""
    try:
        with Image.open(picture) as file:
            image = file.convert("RGB")
    except (OSError, ValueError):
        return None
    image = image.crop((0, 0, image.width, image.height - STATUS_BAR_HEIGHT))
    image.thumbnail(MAX_INSET_SIZE, Image.Resampling.LANCZOS)
    return image
