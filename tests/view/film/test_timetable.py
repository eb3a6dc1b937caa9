"""Which control step each frame shows."""

from __future__ import annotations

import pytest

from executive.view.film.timetable import HOLD, Timetable

STEP = 1 / 240


def test_frames_go_by_the_robots_clock() -> None:
    timetable = Timetable(steps=48, step=STEP, rate=25.0, speed=1.0)
    assert timetable.shown == [0, 10, 19, 29, 38, 48]
    assert timetable.held == HOLD * 25
    assert timetable.frames == 6 + 50
    assert timetable.clock(48) == pytest.approx(0.2)


def test_the_last_step_is_shown_even_when_no_frame_is_due() -> None:
    assert Timetable(steps=50, step=STEP, rate=25.0, speed=2.0).shown == [0, 19, 38, 50]


def test_a_run_that_was_over_at_once_is_one_picture() -> None:
    assert Timetable(steps=0, step=STEP, rate=10.0, speed=2.0).shown == [0]
