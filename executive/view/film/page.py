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
from executive.view.film.run_state import FilmRunState, FilmSource
from executive.view.film.style import BACKGROUND, FAILURE, LINE, RUNNING, SECONDARY_TEXT, SUCCESS, TEXT

WIDTH, HEIGHT = 1280, 720
"""Size of a frame [pixel]."""
SCENE_SIZE = (800, 720)
"""Width and height of the image of the cell [pixel]."""
PANEL_LEFT, PANEL_RIGHT = SCENE_SIZE[0] + 28, WIDTH - 28
"""Left and right edge of header, tree and items in a frame [pixel]."""
MAX_INSET_SIZE = (224, 168)
"""Maximum width and height of the camera image over the image of the cell [pixel]."""
MAX_CAPTION_WIDTH, MAX_RESULT_WIDTH = 620, 620
"""Maximum widths of the text of a caption, and of the box with the result [pixel]."""
_TITLE_FONT_SIZE, _SUBTITLE_FONT_SIZE, _CAPTION_FONT_SIZE, _LABEL_FONT_SIZE = 26, 14, 17, 13
_STATUS_FONT_SIZE, _RESULT_FONT_SIZE = 40, 18
"""Font sizes of header, caption, label of the camera image, status, and other text of the result [pixel]."""
_TITLE_BASELINE, _SUBTITLE_BASELINE, _BAR_TOP, _BAR_BOTTOM, _TREE_TOP = 50, 76, 94, 96, 122
"""Vertical positions of title, subtitle, progress bar and tree [pixel]."""
_MARGIN, _PANEL_BOTTOM_MARGIN = 20, 22
"""Distance of the boxes from the edges of the image of the cell, and of the items from the bottom [pixel]."""
_CAPTION_LINE_HEIGHT, _RESULT_LINE_HEIGHT, _RESULT_PADDING = 23, 26, 24
"""Heights of a line, and distance of the result from the edges of its box [pixel]."""
_RESULT_COLOURS = {"SUCCESS": SUCCESS, "INCOMPLETE": FAILURE, "FAILURE": FAILURE, "FAULT": FAILURE}
"""Colour of the result by run status; results with any other status have the colour `RUNNING`."""


def draw_frame(
    source: FilmSource, picture: NDArray[np.uint8], state: FilmRunState, subtitle: str, duration: float,
    *, has_caption: bool = True,
) -> Image.Image:  # fmt: skip
    """Return the frame that shows the run in `state`.

    Args:
        source: Record of the run.
        picture: Image of the cell, of the size `SCENE_SIZE`.
        state: State of the run at the time of the frame.
        subtitle: Second line of the header: seed, cell and speed.
        duration: Duration of the run on the robot's clock [s].
        has_caption: True to write the current action or incident over the image of the cell.
    """
    frame = Image.new("RGB", (WIDTH, HEIGHT), BACKGROUND)
    frame.paste(Image.fromarray(picture), (0, 0))
    _draw_camera_image(frame, state.image_file)
    if has_caption and (state.incident_text or state.action_text):
        text, max_lines = (state.incident_text, 2) if state.incident_text else (state.action_text, 1)
        lines = style.wrap_text(text, _CAPTION_FONT_SIZE, MAX_CAPTION_WIDTH, max_lines)
        _draw_caption(frame, lines, FAILURE if state.incident_text else RUNNING)
    _draw_header(frame, source.start.mission, subtitle, state.time, duration)
    top = HEIGHT - _PANEL_BOTTOM_MARGIN - panel.compute_items_height(source.item_count)
    ImageDraw.Draw(frame).line((PANEL_LEFT, top - 10, PANEL_RIGHT, top - 10), LINE, 1)
    items = state.timeline.items.list_items()
    panel.draw_items(frame, (PANEL_LEFT, top, PANEL_RIGHT, HEIGHT), items, source.bin_colours)
    panel.draw_tree(frame, (PANEL_LEFT, _TREE_TOP, PANEL_RIGHT, top - 18), source.nodes, state)
    return frame


def add_result(frame: Image.Image, result: Result | RunEnded | None) -> Image.Image:
    """Return a copy of a frame with the result of the run in a box over the image of the cell."""
    status, message, counts = describe_result(result)
    max_text_width = MAX_RESULT_WIDTH - 2 * _RESULT_PADDING
    message_lines = style.wrap_text(message, _RESULT_FONT_SIZE, max_text_width, 4)
    lines = [*message_lines, *style.wrap_text(counts, _RESULT_FONT_SIZE, max_text_width, 2)]
    height = 2 * _RESULT_PADDING + _STATUS_FONT_SIZE + _RESULT_LINE_HEIGHT * len(lines) + (10 if lines else 0)
    font, status_font = style.load_font(_RESULT_FONT_SIZE), style.load_font(_STATUS_FONT_SIZE)
    text_widths = [status_font.getlength(status), *map(font.getlength, lines)]
    width = max(text_widths) + 2 * _RESULT_PADDING
    left, top = SCENE_SIZE[0] - width - _MARGIN, SCENE_SIZE[1] - height - _MARGIN
    text_left = left + _RESULT_PADDING
    colour = _RESULT_COLOURS.get(status, RUNNING)
    frame = frame.copy()
    draw = ImageDraw.Draw(frame)
    draw.rounded_rectangle((left, top, left + width, top + height), 10, BACKGROUND)
    draw.rounded_rectangle((left, top, left + 8, top + height), 4, colour)
    y = top + _RESULT_PADDING + _STATUS_FONT_SIZE / 2
    draw.text((text_left, y), status, colour, status_font, "lm")
    y = top + _RESULT_PADDING + _STATUS_FONT_SIZE + 10 + _RESULT_LINE_HEIGHT / 2
    for number, line in enumerate(lines):
        colour = TEXT if number < len(message_lines) else SECONDARY_TEXT
        draw.text((text_left, y + _RESULT_LINE_HEIGHT * number), line, colour, font, "lm")
    return frame


def describe_result(result: Result | RunEnded | None) -> tuple[str, str, str]:
    """Return status, message and item counts of a run as texts; None is the result of an interrupted run."""
    if result is None:
        return "INTERRUPTED", "the record ends here; the result of the run is unknown", ""
    if isinstance(result, RunEnded):
        return result.status, result.message, ""
    counts = ", ".join(f"{count} {state}" for state, count in asdict(result.items).items() if count)
    return result.status, result.verdict, f"{counts}; {result.robot_time_s:.1f} s"


def _draw_header(frame: Image.Image, title: str, subtitle: str, time: float, duration: float) -> None:
    """Draw title and subtitle, the elapsed time [s] of the run, and a bar with the progress of the run."""
    draw = ImageDraw.Draw(frame)
    title_font, subtitle_font = style.load_font(_TITLE_FONT_SIZE), style.load_font(_SUBTITLE_FONT_SIZE)
    max_width = PANEL_RIGHT - PANEL_LEFT - title_font.getlength(f"{duration:.1f} s") - 24
    title = style.truncate_text(title, _TITLE_FONT_SIZE, max_width)
    draw.text((PANEL_LEFT, _TITLE_BASELINE), title, TEXT, title_font, "ls")
    draw.text((PANEL_RIGHT, _TITLE_BASELINE), f"{time:.1f} s", TEXT, title_font, "rs")
    subtitle = style.truncate_text(subtitle, _SUBTITLE_FONT_SIZE, PANEL_RIGHT - PANEL_LEFT)
    draw.text((PANEL_LEFT, _SUBTITLE_BASELINE), subtitle, SECONDARY_TEXT, subtitle_font, "ls")
    progress = time / duration if duration else 1.0
    draw.rectangle((PANEL_LEFT, _BAR_TOP, PANEL_RIGHT, _BAR_BOTTOM), LINE)
    bar_right = PANEL_LEFT + round(progress * (PANEL_RIGHT - PANEL_LEFT))
    draw.rectangle((PANEL_LEFT, _BAR_TOP, bar_right, _BAR_BOTTOM), RUNNING)


def _draw_caption(frame: Image.Image, lines: list[str], colour: str) -> None:
    """Write lines in a box at the bottom of the image of the cell; the box has a bar at its left side."""
    left_padding, right_padding, vertical_padding = 20, 12, 7
    font = style.load_font(_CAPTION_FONT_SIZE)
    width = max(font.getlength(line) for line in lines) + left_padding + right_padding
    height = _CAPTION_LINE_HEIGHT * len(lines) + 2 * vertical_padding
    left, top = _MARGIN, SCENE_SIZE[1] - _MARGIN - height
    draw = ImageDraw.Draw(frame)
    draw.rounded_rectangle((left, top, left + width, top + height), 6, BACKGROUND)
    bar = (left + 6, top + vertical_padding, left + 9, top + height - vertical_padding)
    draw.rounded_rectangle(bar, 2, colour)
    for number, line in enumerate(lines):
        middle = top + vertical_padding + _CAPTION_LINE_HEIGHT * (number + 0.5)
        draw.text((left + left_padding, middle), line, TEXT, font, "lm")


def _draw_camera_image(frame: Image.Image, picture: Path | None) -> None:
    """Draw a camera image in the corner, with item and reason from its file name `<tick>_<item>_<reason>`."""
    if picture is None or (inset := _load_inset(picture)) is None:
        return
    width, height = inset.size
    draw = ImageDraw.Draw(frame)
    draw.rounded_rectangle((_MARGIN, _MARGIN, _MARGIN + width + 7, _MARGIN + height + 31), 6, BACKGROUND)
    frame.paste(inset, (_MARGIN + 4, _MARGIN + 4))
    label = "camera:  " + picture.stem.partition("_")[2].replace("_", " ")
    label = style.truncate_text(label, _LABEL_FONT_SIZE, width - 8)
    position = (_MARGIN + 10, _MARGIN + height + 17)
    draw.text(position, label, SECONDARY_TEXT, style.load_font(_LABEL_FONT_SIZE), "lm")


@lru_cache(maxsize=2)
def _load_inset(picture: Path) -> Image.Image | None:
    """Return the camera image in a file without its status bar; None if the file is unreadable."""
    try:
        with Image.open(picture) as file:
            image = file.convert("RGB")
    except (OSError, ValueError):
        return None
    image = image.crop((0, 0, image.width, image.height - STATUS_BAR_HEIGHT))
    image.thumbnail(MAX_INSET_SIZE, Image.Resampling.LANCZOS)
    return image
