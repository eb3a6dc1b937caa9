"""Status bar below an image: text about the selected item, running skills, and outcomes of all items."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

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
"""Font scales in OpenCV."""
_OUTCOME_WIDTH = 88
"""Width of the column with the names of bins and states [pixel]."""
_LEFT_FRACTION = 0.55
"""Fraction of the width of a status bar that is left of this column."""


@dataclass(frozen=True)
class StatusBarText:
    """Text of a status bar.

    Attributes:
        title: Failure and item, or item and bin.
        lines: Running skills with the number of failed attempts; message of the failure.
        notes: Mission, time and meaning of the shading; camera, detector and age of the image.
        outcomes: Name of each bin or state, with the names of its items.
    """

    title: str
    lines: tuple[str, ...]
    notes: tuple[str, ...]
    outcomes: tuple[tuple[str, tuple[str, ...]], ...]


def make_status_bar_text(scene: PictureContent) -> StatusBarText:
    """Return the text of the status bar of a scene."""
    selection = f"{scene.item} to {scene.bin}" if scene.bin else scene.item
    title = ": ".join(filter(None, (scene.failure, scene.item))) if scene.failure else selection
    phase = f"phase: {scene.phase}" if scene.phase else ""
    attempts = f"{scene.attempts} failed attempt{'s' if scene.attempts > 1 else ''}" if scene.attempts else ""
    lines = tuple(filter(None, (", ".join(filter(None, (phase, attempts))), scene.message)))
    source = " by ".join(filter(None, (scene.camera, scene.detector)))
    image = f"{source}, {scene.age:.2f} s old" if source else ""
    has_occlusion = scene.visible is not None and not scene.visible.all()
    shading = "shaded: occluded by the arm" if has_occlusion else ""
    notes = ("   ".join(filter(None, (scene.mission, f"{scene.clock:.2f} s", shading))), image)
    outcomes = tuple((outcome, tuple(items)) for outcome, items in scene.outcomes.items())
    return StatusBarText(title, lines, tuple(filter(None, notes)), outcomes)


def draw_status_bar(scene: PictureContent, width: int, left: int = 0) -> NDArray[np.uint8]:
    """Return the status bar `(STATUS_BAR_HEIGHT, width, 3)`, BGR; its first `left` columns are empty."""
    bar = np.full((STATUS_BAR_HEIGHT, width, 3), to_bgr(BACKGROUND), np.uint8)
    text, x = make_status_bar_text(scene), left + MARGIN
    outcome_x = left + round(_LEFT_FRACTION * (width - left))
    text_width = outcome_x - left - 2 * MARGIN
    fits = _make_width_check(text_width)
    title = truncate(text.title, _make_width_check(text_width, _TITLE_SCALE))
    _write(bar, title, x, 0, FAILURE_TEXT if scene.failure else TEXT, _TITLE_SCALE)
    lines = [line for long_line in text.lines for line in wrap_text(long_line, fits)]
    max_lines = ROW_COUNT - 1 - len(text.notes)
    if len(lines) > max_lines:
        lines[max_lines - 1] = truncate(" ".join(lines[max_lines - 1 :]), fits)
    for row, line in enumerate(lines[:max_lines], start=1):
        _write(bar, line, x, row, TEXT)
    for row, note in enumerate(text.notes, start=ROW_COUNT - len(text.notes)):
        _write(bar, truncate(note, fits), x, row, SECONDARY_TEXT)
    if not text.outcomes:
        _write(bar, "no item sorted", outcome_x, 0, SECONDARY_TEXT)
    name_fits = _make_width_check(_OUTCOME_WIDTH - MARGIN)
    items_fit = _make_width_check(width - outcome_x - _OUTCOME_WIDTH - MARGIN)
    for row, (outcome, items) in enumerate(_merge_last(text.outcomes)):
        _write(bar, truncate(outcome, name_fits), outcome_x, row, SECONDARY_TEXT)
        _write(bar, join_last_names(items, items_fit), outcome_x + _OUTCOME_WIDTH, row, TEXT)
    return bar


def wrap_text(text: str, fits: Callable[[str], bool]) -> list[str]:
    """Return a text as lines for which `fits` is True, broken between words."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and fits(longer):
            lines[-1] = longer
        else:
            lines.append(truncate(word, fits))
    return lines


def truncate(text: str, fits: Callable[[str], bool]) -> str:
    """Return a text for which `fits` is True, truncated at its end if necessary."""
    if fits(text):
        return text
    length = next((n for n in range(len(text) - 1, 0, -1) if fits(f"{text[:n]}...")), 0)
    return f"{text[:length]}..."


def join_last_names(names: Sequence[str], fits: Callable[[str], bool]) -> str:
    """Return as many of the last names as fit, followed by the number of omitted names (`+3`)."""
    for omitted_count in range(len(names)):
        text = ", ".join(names[omitted_count:]) + (f" +{omitted_count}" if omitted_count else "")
        if fits(text):
            return text
    return str(len(names)) if names else ""


def _merge_last(outcomes: Sequence[tuple[str, tuple[str, ...]]]) -> Sequence[tuple[str, tuple[str, ...]]]:
    """Return at most `ROW_COUNT` outcomes; the last row merges all outcomes that do not fit."""
    if len(outcomes) <= ROW_COUNT:
        return outcomes
    merged = [item for _, items in outcomes[ROW_COUNT - 1 :] for item in items]
    return [*outcomes[: ROW_COUNT - 1], (f"{len(outcomes) - ROW_COUNT + 1} more", tuple(merged))]


def _make_width_check(max_width: float, scale: float = _TEXT_SCALE) -> Callable[[str], bool]:
    """Return a predicate for texts that are at most `max_width` pixels wide."""
    import cv2

    return lambda text: cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)[0][0] <= max_width


def _write(
    bar: NDArray[np.uint8], text: str, x: int, row: int, colour: str, scale: float = _TEXT_SCALE
) -> None:
    """Write a text in a colour to a row of the status bar; the text starts at `x` [pixel]."""
    import cv2

    baseline = MARGIN + row * LINE_HEIGHT + LINE_HEIGHT - 5
    cv2.putText(bar, text, (x, baseline), cv2.FONT_HERSHEY_SIMPLEX, scale, to_bgr(colour), 1, cv2.LINE_AA)
