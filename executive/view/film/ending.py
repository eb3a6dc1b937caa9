"""The last page of a film: how the run ended, and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from PIL import Image, ImageDraw

from executive.record.result import FATES
from executive.tape.past import Entry
from executive.view.film.ink import BACK, DIM, FAILURE, INK, RUNNING, SUCCESS, font, wrapped
from executive.view.film.stage import STAGE

WIDTH = 620
"""Largest width of the card [pixel]."""
_COLOURS = {"SUCCESS": SUCCESS, "FAILURE": FAILURE, "FAULT": FAILURE}
_STATUS, _TYPE, _LINE, _PAD, _MARGIN = 40, 18, 26, 24, 20


@dataclass(frozen=True)
class Ending:
    """How a run ended.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `FAULT`, `HALTED`, or `CUT OFF`.
        sentence: What there is to say.
        figures: What became of the items.
    """

    status: str
    sentence: str
    figures: str

    @staticmethod
    def of(result: Mapping[str, Any] | None, end: Entry | None) -> Ending:
        """Return the ending by a result, without one by the journal; without both the run was cut off."""
        if result is not None:
            story = result.get("story") or {}
            items = result["items"]
            fates = [f"{items[fate]} {fate}" for fate in FATES if items[fate]]
            figures = f"{', '.join(fates)}; {result['robot_time_s']:.1f} s"
            sentence = story.get("verdict") or result["message"]
            return Ending(result["status"], sentence, figures)
        if end is not None:
            return Ending(end["status"], end["message"], "")
        return Ending("CUT OFF", "the record ends here; nothing says how the run would have ended", "")


def draw_ending(page: Image.Image, ending: Ending) -> Image.Image:
    """Return a page with the ending written over the picture of the cell."""
    lines = wrapped(ending.sentence, _TYPE, WIDTH - 2 * _PAD, 4)
    notes = wrapped(ending.figures, _TYPE, WIDTH - 2 * _PAD, 2)
    height = 2 * _PAD + _STATUS + _LINE * (len(lines) + len(notes)) + (10 if lines or notes else 0)
    longest = max((font(_TYPE).getlength(line) for line in [*lines, *notes]), default=0)
    width = max(longest, font(_STATUS).getlength(ending.status)) + 2 * _PAD
    left, top = STAGE[0] - width - _MARGIN, STAGE[1] - height - _MARGIN
    colour = _COLOURS.get(ending.status, RUNNING)
    shown = page.copy()
    draw = ImageDraw.Draw(shown)
    draw.rounded_rectangle((left, top, left + width, top + height), 10, BACK)
    draw.rounded_rectangle((left, top, left + 8, top + height), 4, colour)
    draw.text((left + _PAD, top + _PAD + _STATUS / 2), ending.status, colour, font(_STATUS), "lm")
    middle = top + _PAD + _STATUS + 10 + _LINE / 2
    for text, ink in [*((line, INK) for line in lines), *((note, DIM) for note in notes)]:
        draw.text((left + _PAD, middle), text, ink, font(_TYPE), "lm")
        middle += _LINE
    return shown
