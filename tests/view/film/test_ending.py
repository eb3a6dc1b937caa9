"""How the last page says that a run ended."""

from __future__ import annotations

import numpy as np
from PIL import Image

from executive.view.film.ending import Ending, draw_ending
from executive.view.film.ink import BACK

ITEMS = {"seen": 6, "placed": 5, "rejected": 1, "lost": 0, "phantom": 0}
RESULT = {"status": "SUCCESS", "message": "", "items": ITEMS, "robot_time_s": 15.54, "story": None}


def test_a_success_tells_what_became_of_the_items() -> None:
    assert Ending.of(RESULT, None) == Ending("SUCCESS", "", "6 seen, 5 placed, 1 rejected; 15.5 s")


def test_a_failure_is_told_as_in_its_story() -> None:
    failed = {
        **RESULT,
        "status": "FAILURE",
        "message": "no seal",
        "story": {"verdict": "Grasp failed: no seal"},
    }
    assert Ending.of(failed, None).sentence == "Grasp failed: no seal"
    assert Ending.of({**failed, "story": None}, None).sentence == "no seal"


def test_without_a_result_the_journal_says_it() -> None:
    assert Ending.of(None, {"status": "HALTED", "message": "by the user"}) == Ending(
        "HALTED", "by the user", ""
    )
    assert Ending.of(None, None).status == "CUT OFF"


def test_it_stands_on_the_picture_and_leaves_the_page_as_it_was() -> None:
    page = Image.new("RGB", (1280, 720), "#808080")
    shown = draw_ending(page, Ending("FAILURE", "a long sentence about what went wrong " * 12, "6 seen"))
    assert page.getcolors() == [(1280 * 720, (128, 128, 128))]
    changed = np.argwhere((np.asarray(shown) != 128).any(axis=2))
    assert changed[:, 1].max() < 800
    assert changed[:, 1].min() > 100
    assert shown.getpixel((700, 690)) == Image.new("RGB", (1, 1), BACK).getpixel((0, 0))
