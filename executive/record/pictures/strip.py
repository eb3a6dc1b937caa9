"""The strip below an image: what it is about, what the robot does, and what became of everything."""

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
"""Free space around text, and from line to line [pixel]."""

ROWS = (HEIGHT - 2 * MARGIN) // LINE
"""Lines of text that fit."""

# Sizes of text in OpenCV's unit, width of the names of bins [pixel], share of what stands left of them.
_TITLE, _TEXT = 0.52, 0.4
_NAMES = 88
_SHARE = 0.55


@dataclass(frozen=True)
class StripText:
    """What a strip says.

    Attributes:
        title: What the picture is about.
        lines: What there is to know about it.
        notes: Where and when, and what the shading means.
        fates: Name of a bin or state, and the items there.
    """

    title: str
    lines: tuple[str, ...]
    notes: tuple[str, ...]
    fates: tuple[tuple[str, tuple[str, ...]], ...]


def strip_text(scene: PictureScene) -> StripText:
    """Return what the strip of a scene says."""
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
    fates = tuple((fate, tuple(items)) for fate, items in scene.fates.items())
    return StripText(title, lines, tuple(filter(None, notes)), fates)


def draw_strip(scene: PictureScene, width: int, left: int = 0) -> NDArray[np.uint8]:
    """Return the strip of a scene, `(HEIGHT, width, 3)` BGR, its first `left` columns free."""
    strip = np.full((HEIGHT, width, 3), bgr(GROUND), np.uint8)
    said = strip_text(scene)
    middle = left + round(_SHARE * (width - left))
    room = middle - left - 2 * MARGIN
    colour = WARNING if scene.failure else INK
    _write(strip, fitted(said.title, _fits(room, _TITLE)), left + MARGIN, 0, colour, _TITLE)
    lines = [line for text in said.lines for line in wrapped(text, _fits(room, _TEXT))]
    free = ROWS - 1 - len(said.notes)
    if len(lines) > free:
        lines[free - 1] = fitted(" ".join(lines[free - 1 :]), _fits(room, _TEXT))
    for row, line in enumerate(lines[:free], start=1):
        _write(strip, line, left + MARGIN, row, INK)
    for row, note in enumerate(said.notes, start=ROWS - len(said.notes)):
        _write(strip, fitted(note, _fits(room, _TEXT)), left + MARGIN, row, FAINT)
    if not said.fates:
        _write(strip, "nothing sorted yet", middle, 0, FAINT)
    for row, (fate, items) in enumerate(_shown(said.fates)):
        _write(strip, fitted(fate, _fits(_NAMES - MARGIN, _TEXT)), middle, row, FAINT)
        listing = listed(items, _fits(width - middle - _NAMES - MARGIN, _TEXT))
        _write(strip, listing, middle + _NAMES, row, INK)
    return strip


def wrapped(text: str, fits: Callable[[str], bool]) -> list[str]:
    """Return a text in lines that fit."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and fits(longer):
            lines[-1] = longer
        else:
            lines.append(fitted(word, fits))
    return lines


def fitted(text: str, fits: Callable[[str], bool]) -> str:
    """Return a text, cut at its end until it fits."""
    if fits(text):
        return text
    length = next((n for n in range(len(text) - 1, 0, -1) if fits(f"{text[:n]}...")), 0)
    return f"{text[:length]}..."


def listed(names: Sequence[str], fits: Callable[[str], bool]) -> str:
    """Return as many of the last names as fit, then `+3` for those left out."""
    for left_out in range(len(names)):
        text = ", ".join(names[left_out:]) + (f" +{left_out}" if left_out else "")
        if fits(text):
            return text
    return str(len(names)) if names else ""


def _shown(fates: Sequence[tuple[str, tuple[str, ...]]]) -> Sequence[tuple[str, tuple[str, ...]]]:
    """Return as many fates as there are rows; the last one stands for those left out."""
    if len(fates) <= ROWS:
        return fates
    rest = [item for _, items in fates[ROWS - 1 :] for item in items]
    return [*fates[: ROWS - 1], (f"{len(fates) - ROWS + 1} more", tuple(rest))]


def _fits(room: float, scale: float) -> Callable[[str], bool]:
    import cv2

    return lambda text: cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)[0][0] <= room


def _write(strip: NDArray[np.uint8], text: str, x: int, row: int, colour: str, scale: float = _TEXT) -> None:
    import cv2

    baseline = MARGIN + row * LINE + LINE - 5
    cv2.putText(strip, text, (x, baseline), cv2.FONT_HERSHEY_SIMPLEX, scale, bgr(colour), 1, cv2.LINE_AA)
