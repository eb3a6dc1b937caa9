"""Status bar below an image: selected item, running skills, and outcomes of all items."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.record.pictures.palette import BACKGROUND, FAILURE_TEXT, SECONDARY_TEXT, TEXT, to_bgr
from executive.record.pictures.picture_content import PictureContent

STATUS_BAR_HEIGHT = 116
"""Height of the status bar [pixel]."""

MARGIN, LINE_HEIGHT = 8, 16
"""Margin around text, and height of a line of text [pixel]."""

ROW_COUNT = (STATUS_BAR_HEIGHT - 2 * MARGIN) // LINE_HEIGHT
"""Number of lines of text in a status bar."""

_TITLE_SCALE, _TEXT_SCALE = 0.52, 0.4
"""Font scales of the title and of other text in OpenCV."""

_OUTCOME_NAME_WIDTH = 88
"""Width of the column with the name of the bin or state of each outcome [pixel]."""

_OUTCOME_START_FRACTION = 0.55
"""Left edge of the column of outcomes, as a fraction of the width of the status bar."""

_BASELINE_OFFSET = 5
"""Distance from the baseline of a text to the lower edge of its line [pixel]."""


def make_status_bar_text(content: PictureContent) -> tuple[str, list[str], list[str]]:
    """Return the title, the lines and the notes on the left side of the status bar of a picture.

    The title is the failure with its item; without a failure, the selected item with its bin. The lines are
    running skills and attempts, and the message of the failure. The notes are mission, time and meaning of
    the shading, and a line about the image.
    """
    item, count = content.item, content.failed_attempts
    selection = f"{item} to {content.bin}" if content.bin else item
    title = ": ".join(filter(None, (content.failure, item))) if content.failure else selection
    skills = f"phase: {' + '.join(content.running_skills)}" if content.running_skills else ""
    attempts = f"{count} failed attempt{'s' if count > 1 else ''}" if count else ""
    lines = filter(None, (", ".join(filter(None, (skills, attempts))), content.message))
    source = " by ".join(filter(None, (content.camera, content.detector)))
    image = f"{source}, {content.age:.2f} s old" if source else ""
    has_occlusion = content.visible is not None and not content.visible.all()
    shading = "shaded: occluded by the arm" if has_occlusion else ""
    notes = ("   ".join(filter(None, (content.mission, f"{content.clock:.2f} s", shading))), image)
    return title, list(lines), list(filter(None, notes))


def draw_status_bar(content: PictureContent, width: int) -> NDArray[np.uint8]:
    """Return the status bar `(STATUS_BAR_HEIGHT, width, 3)`, BGR, with room for a close-up of a selection."""
    text_start = 0 if content.selected_index is None else STATUS_BAR_HEIGHT
    bar = np.full((STATUS_BAR_HEIGHT, width, 3), to_bgr(BACKGROUND), np.uint8)
    (title, long_lines, notes), x = make_status_bar_text(content), text_start + MARGIN
    outcome_x = text_start + round(_OUTCOME_START_FRACTION * (width - text_start))
    text_width = outcome_x - text_start - 2 * MARGIN
    is_fitting = _make_width_check(text_width)
    title = truncate(title, _make_width_check(text_width, _TITLE_SCALE))
    _write(bar, title, x, 0, FAILURE_TEXT if content.failure else TEXT, _TITLE_SCALE)
    lines = [line for long_line in long_lines for line in wrap_text(long_line, is_fitting)]
    max_lines = ROW_COUNT - 1 - len(notes)
    if len(lines) > max_lines:
        lines[max_lines - 1] = truncate(" ".join(lines[max_lines - 1 :]), is_fitting)
    for row, line in enumerate(lines[:max_lines], start=1):
        _write(bar, line, x, row, TEXT)
    for row, note in enumerate(notes, start=ROW_COUNT - len(notes)):
        _write(bar, truncate(note, is_fitting), x, row, SECONDARY_TEXT)
    if not content.outcomes:
        _write(bar, "no item sorted", outcome_x, 0, SECONDARY_TEXT)
    is_fitting_name = _make_width_check(_OUTCOME_NAME_WIDTH - MARGIN)
    is_fitting_list = _make_width_check(width - outcome_x - _OUTCOME_NAME_WIDTH - MARGIN)
    for row, (outcome, items) in enumerate(_limit_outcomes(list(content.outcomes.items()))):
        _write(bar, truncate(outcome, is_fitting_name), outcome_x, row, SECONDARY_TEXT)
        _write(bar, join_latest_names(items, is_fitting_list), outcome_x + _OUTCOME_NAME_WIDTH, row, TEXT)
    return bar


def wrap_text(text: str, is_fitting: Callable[[str], bool]) -> list[str]:
    """Return a text as lines for which `is_fitting` is True, broken between words."""
    lines: list[str] = []
    for word in text.split():
        extended_line = f"{lines[-1]} {word}" if lines else word
        if lines and is_fitting(extended_line):
            lines[-1] = extended_line
        else:
            lines.append(truncate(word, is_fitting))
    return lines


def truncate(text: str, is_fitting: Callable[[str], bool]) -> str:
    """Return a text for which `is_fitting` is True, truncated at its end if necessary."""
    if is_fitting(text):
        return text
    length = next((n for n in range(len(text) - 1, 0, -1) if is_fitting(f"{text[:n]}...")), 0)
    return f"{text[:length]}..."


def join_latest_names(names: Sequence[str], is_fitting: Callable[[str], bool]) -> str:
    """Return as many of the latest names as fit, followed by the number of omitted names (`+3`)."""
    for omitted_count in range(len(names)):
        text = ", ".join(names[omitted_count:]) + (f" +{omitted_count}" if omitted_count else "")
        if is_fitting(text):
            return text
    return str(len(names)) if names else ""


def _limit_outcomes(outcomes: Sequence[tuple[str, Sequence[str]]]) -> Sequence[tuple[str, Sequence[str]]]:
    """Return at most `ROW_COUNT` outcomes; the last row merges all outcomes that do not fit."""
    if len(outcomes) <= ROW_COUNT:
        return outcomes
    merged_items = [item for _, items in outcomes[ROW_COUNT - 1 :] for item in items]
    return [*outcomes[: ROW_COUNT - 1], (f"{len(outcomes) - ROW_COUNT + 1} more", merged_items)]


def _make_width_check(max_width: float, scale: float = _TEXT_SCALE) -> Callable[[str], bool]:
    """Return a predicate that is True for a text with a width of at most `max_width` [pixel]."""
    return lambda text: cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)[0][0] <= max_width


def _write(
    bar: NDArray[np.uint8], text: str, x: int, row: int, colour: str, scale: float = _TEXT_SCALE
) -> None:
    """Write a text in a colour to a row of the status bar; the text starts at column `x` [pixel]."""
    baseline = MARGIN + (row + 1) * LINE_HEIGHT - _BASELINE_OFFSET
    cv2.putText(bar, text, (x, baseline), cv2.FONT_HERSHEY_SIMPLEX, scale, to_bgr(colour), 1, cv2.LINE_AA)
