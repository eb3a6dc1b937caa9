"""Strip below an image with the subject of the picture, the running skills and the outcomes of all items."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.record.pictures.palette import FAINT, GROUND, INK, WARNING, bgr
from executive.record.pictures.scene import PictureScene

HEIGHT = 116
"""Height of the strip [pixel]."""

MARGIN, LINE = 8, 16
"""Margin around text, and line height [pixel]."""

ROWS = (HEIGHT - 2 * MARGIN) // LINE
"""Number of text lines in a strip."""

# Font scales of OpenCV, width of the column of outcomes [pixel], and share of the width left of this column.
_TITLE_SCALE, _TEXT_SCALE = 0.52, 0.4
_OUTCOME_WIDTH = 88
_LEFT_SHARE = 0.55


@dataclass(frozen=True)
class StripText:
    """Text of a strip.

    Attributes:
        title: Failure, item and bin.
        lines: Running skills with the number of failed attempts, and the message of the failure.
        notes: Mission, time and meaning of the shading; camera, detector and age of the image.
        outcomes: Names of bins or states, each with the names of items.
    """

    title: str
    lines: tuple[str, ...]
    notes: tuple[str, ...]
    outcomes: tuple[tuple[str, tuple[str, ...]], ...]


def strip_text(scene: PictureScene) -> StripText:
    """Return the text of the strip of a scene."""
    choice = f"{scene.item} to {scene.bin}" if scene.bin else scene.item
    title = ": ".join(filter(None, (scene.failure, scene.item))) if scene.failure else choice
    phase = f"phase: {scene.phase}" if scene.phase else ""
    attempts = f"{scene.attempts} failed attempt{'s' if scene.attempts > 1 else ''}" if scene.attempts else ""
    lines = tuple(filter(None, (", ".join(filter(None, (phase, attempts))), scene.message)))
    source = " by ".join(filter(None, (scene.camera, scene.detector)))
    seen = f"{source}, {scene.age:.2f} s old" if source else ""
    hidden = scene.visible is not None and not scene.visible.all()
    shading = "shaded: behind the arm" if hidden else ""
    notes = ("   ".join(filter(None, (scene.mission, f"{scene.clock:.2f} s", shading))), seen)
    outcomes = tuple((outcome, tuple(items)) for outcome, items in scene.outcomes.items())
    return StripText(title, lines, tuple(filter(None, notes)), outcomes)


def draw_strip(scene: PictureScene, width: int, left: int = 0) -> NDArray[np.uint8]:
    """Return the strip of a scene, `(HEIGHT, width, 3)` BGR, with `left` empty pixel columns first."""
    strip = np.full((HEIGHT, width, 3), bgr(GROUND), np.uint8)
    text = strip_text(scene)
    middle = left + round(_LEFT_SHARE * (width - left))
    room = middle - left - 2 * MARGIN
    colour = WARNING if scene.failure else INK
    _write(strip, shorten(text.title, _fits(room, _TITLE_SCALE)), left + MARGIN, 0, colour, _TITLE_SCALE)
    lines = [line for part in text.lines for line in wrap(part, _fits(room, _TEXT_SCALE))]
    max_lines = ROWS - 1 - len(text.notes)
    if len(lines) > max_lines:
        lines[max_lines - 1] = shorten(" ".join(lines[max_lines - 1 :]), _fits(room, _TEXT_SCALE))
    for row, line in enumerate(lines[:max_lines], start=1):
        _write(strip, line, left + MARGIN, row, INK)
    for row, note in enumerate(text.notes, start=ROWS - len(text.notes)):
        _write(strip, shorten(note, _fits(room, _TEXT_SCALE)), left + MARGIN, row, FAINT)
    if not text.outcomes:
        _write(strip, "nothing sorted yet", middle, 0, FAINT)
    for row, (outcome, items) in enumerate(_merge_last(text.outcomes)):
        _write(strip, shorten(outcome, _fits(_OUTCOME_WIDTH - MARGIN, _TEXT_SCALE)), middle, row, FAINT)
        listing = join_last(items, _fits(width - middle - _OUTCOME_WIDTH - MARGIN, _TEXT_SCALE))
        _write(strip, listing, middle + _OUTCOME_WIDTH, row, INK)
    return strip


def wrap(text: str, fits: Callable[[str], bool]) -> list[str]:
    """Return a text as lines that fit, broken between words."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and fits(longer):
            lines[-1] = longer
        else:
            lines.append(shorten(word, fits))
    return lines


def shorten(text: str, fits: Callable[[str], bool]) -> str:
    """Return a text that fits, shortened at its end if necessary."""
    if fits(text):
        return text
    length = next((n for n in range(len(text) - 1, 0, -1) if fits(f"{text[:n]}...")), 0)
    return f"{text[:length]}..."


def join_last(names: Sequence[str], fits: Callable[[str], bool]) -> str:
    """Return the last names that fit, followed by the number of omitted names (`+3`)."""
    for left_out in range(len(names)):
        text = ", ".join(names[left_out:]) + (f" +{left_out}" if left_out else "")
        if fits(text):
            return text
    return str(len(names)) if names else ""


def _merge_last(outcomes: Sequence[tuple[str, tuple[str, ...]]]) -> Sequence[tuple[str, tuple[str, ...]]]:
    """Return at most `ROWS` outcomes; the last row merges all outcomes that do not fit."""
    if len(outcomes) <= ROWS:
        return outcomes
    rest = [item for _, items in outcomes[ROWS - 1 :] for item in items]
    return [*outcomes[: ROWS - 1], (f"{len(outcomes) - ROWS + 1} more", tuple(rest))]


def _fits(room: float, scale: float) -> Callable[[str], bool]:
    """Return a predicate for texts that are at most `room` pixels wide."""
    import cv2

    return lambda text: cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)[0][0] <= room


def _write(
    strip: NDArray[np.uint8], text: str, x: int, row: int, colour: str, scale: float = _TEXT_SCALE
) -> None:
    """Write a text in a colour to a row of the strip, from column `x` [pixel]."""
    import cv2

    baseline = MARGIN + row * LINE + LINE - 5
    cv2.putText(strip, text, (x, baseline), cv2.FONT_HERSHEY_SIMPLEX, scale, bgr(colour), 1, cv2.LINE_AA)
