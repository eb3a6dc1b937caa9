"""Frames of a film: what is left out where there is no room, marks, the end, and the steps shown."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from events import item_changed, run_ended, run_started
from PIL import Image, ImageColor
from small_tree import NODES, ended, node, started

from executive.events import RunEnded
from executive.record.result import ItemCounts, Result
from executive.view.film.film import select_steps
from executive.view.film.page import add_result, describe_result, draw_frame
from executive.view.film.panel import (
    MAX_ITEM_ROWS,
    compute_items_height,
    draw_items,
    draw_tree,
    select_items,
    select_nodes,
)
from executive.view.film.run_state import FilmRunState
from executive.view.film.style import (
    BACKGROUND,
    FAILURE,
    INACTIVE,
    RUNNING,
    SUCCESS,
    draw_mark,
    load_font,
    truncate_text,
    wrap_text,
)


def state_after(*entries) -> FilmRunState:
    state = FilmRunState(entries, NODES, [])
    state.advance_to(1000, 0.0)
    return state


def test_what_never_ran_gives_way_first_then_what_rests() -> None:
    nodes = [
        node("t", 0, "try"), node("t/A", 1), node("t/do", 1, "sequence"), node("t/do/B", 2), node("t/C", 1)
    ]  # fmt: skip
    state = state_after(
        started(0, "t"), started(0, "t/A"), ended(0, "t/A"), started(1, "t/do"), started(1, "t/do/B"),
    )  # fmt: skip
    names = [[one.path for one in select_nodes(nodes, state, rows)] for rows in (9, 4, 3)]
    assert names == [
        ["t", "t/A", "t/do", "t/do/B", "t/C"], ["t", "t/A", "t/do", "t/do/B"], ["t", "t/do", "t/do/B"]
    ]  # fmt: skip


def test_nothing_is_drawn_outside_of_its_box() -> None:
    deep = [node("/".join("abcdefghijklmnop"[: n + 1]) + "long" * n, n, "sequence") for n in range(16)]
    state = state_after(*(started(0, one.path, "x" * 200) for one in deep))
    page = Image.new("RGB", (400, 300), BACKGROUND)
    draw_tree(page, (20, 20, 300, 220), deep, state)
    rows = [item_changed("item-" + "9" * 60, "placed", label="class" * 9, bin="bin" * 30)] * 30
    draw_items(page, (20, 225, 300, 300), rows[:2], {})
    drawn = np.argwhere((np.asarray(page) != np.asarray(Image.new("RGB", (1, 1), BACKGROUND))).any(axis=2))
    (top, left), (bottom, right) = drawn.min(axis=0), drawn.max(axis=0)
    assert min(top, left) >= 20 and right <= 300 and bottom < 225 + compute_items_height(2)


def test_settled_items_give_way_to_those_still_to_do() -> None:
    rows = [item_changed(f"cube-{n}", "placed" if n % 2 else "seen") for n in range(MAX_ITEM_ROWS + 3)]
    names = [row.item for row in select_items(rows)]
    assert len(names) == MAX_ITEM_ROWS
    assert not {"cube-1", "cube-3", "cube-5"} & set(names)
    assert names == sorted(names, key=lambda name: int(name[5:]))
    assert select_items(rows[:3]) == rows[:3]
    assert (
        compute_items_height(3),
        compute_items_height(MAX_ITEM_ROWS),
        compute_items_height(MAX_ITEM_ROWS + 20),
    ) == (80, 200, 200)


def test_lines_are_as_wide_as_they_may_be() -> None:
    cut = truncate_text("a word and then another one", 14, 100)
    assert (truncate_text("short", 14, 100), cut[-1], truncate_text("anything", 14, 3)) == ("short", "…", "")
    assert load_font(14).getlength(cut) <= 100
    text = "no seal on sphere-1 0.10 s after contact, and neither the second nor the third went any better"
    assert " ".join(wrap_text(text, 14, 300, 9)) == text
    first, second = wrap_text(text, 14, 300, 2)
    assert max(map(load_font(14).getlength, (first, second))) <= 300
    assert second.endswith("…")
    assert wrap_text("", 14, 300, 2) == []


@pytest.mark.parametrize(
    ("status", "colour", "covered"),
    [
        ("RUNNING", RUNNING, 38.8),
        ("SUCCESS", SUCCESS, 25.6),
        ("FAILURE", FAILURE, 40.9),
        ("", INACTIVE, 10.9),
    ],
)
def test_a_mark_has_the_colour_of_its_status_and_covers_so_much(status, colour, covered) -> None:
    image = Image.new("RGB", (21, 21), "black")
    draw_mark(image, status, (10.5, 10.5), 11)
    full = np.array(ImageColor.getrgb(colour), float)
    share = np.asarray(image).astype(float) @ full / (full @ full)
    assert share.sum() == pytest.approx(covered, abs=0.1)
    assert share[5:16, 5:16].sum() == pytest.approx(share.sum())


RESULT = Result(
    mission="sort", seed=5, status="SUCCESS", reason="", message="", node="",
    items=ItemCounts(seen=6, placed=5, rejected=1), robot_time_s=15.54,
)  # fmt: skip
STORY = SimpleNamespace(verdict="Grasp failed: no seal")


@pytest.mark.parametrize(
    ("result", "ending"),
    [
        (RESULT, ("SUCCESS", "", "6 seen, 5 placed, 1 rejected; 15.5 s")),
        (
            replace(RESULT, status="FAILURE", message="x", diagnosis=STORY),
            ("FAILURE", "Grasp failed: no seal", "6 seen, 5 placed, 1 rejected; 15.5 s"),
        ),
        (run_ended("HALTED", message="by the user"), ("HALTED", "by the user", "")),
        (None, ("INTERRUPTED", "the record ends here; the result of the run is unknown", "")),
    ],
)
def test_the_end_shows_the_diagnosis_or_the_message_and_the_items(result, ending) -> None:
    assert describe_result(result) == ending


def test_the_end_stands_on_the_picture_and_leaves_the_page_as_it_was() -> None:
    page = Image.new("RGB", (1280, 720), "#808080")
    message = "a long sentence about what went wrong " * 12
    shown = add_result(page, replace(RESULT, status="FAILURE", message=message))
    assert page.getcolors() == [(1280 * 720, (128, 128, 128))]
    (top, left), (bottom, right) = (
        each(np.argwhere((np.asarray(shown) != 128).any(axis=2)), axis=0) for each in (np.min, np.max)
    )
    assert (bottom, right) == (700, 780)
    assert (top, left) == (472, 168)
    assert shown.getpixel((700, 690)) == ImageColor.getrgb(BACKGROUND)


def test_a_success_without_a_result_file_shows_only_its_status() -> None:
    page = Image.new("RGB", (1280, 720), "#808080")
    shown = add_result(page, RunEnded("SUCCESS", "", "", "", True, "", 100, 0.5))
    assert shown.tobytes() != page.tobytes()


@pytest.mark.parametrize(
    ("steps", "each", "shown"),
    [(48, 9.6, [0, 10, 19, 29, 38, 48]), (50, 19.2, [0, 19, 38, 50]), (0, 48.0, [0])],
)
def test_steps_are_shown_at_even_times_up_to_the_last(steps, each, shown) -> None:
    assert select_steps(steps, each) == shown


def test_a_page_shows_picture_camera_caption_and_how_far_the_run_is(tmp_path) -> None:
    Image.new("RGB", (640, 556), "white").save(tmp_path / "000000_cube-1.jpg")
    entries = [started(0, "tree"), started(1, "tree/Grasp", "cube-1")]
    state = FilmRunState(entries, NODES, [tmp_path / "000000_cube-1.jpg"])
    state.advance_to(240, 1.0)
    source = SimpleNamespace(start=run_started(mission="sort"), item_count=0, bin_colours={}, nodes=NODES)
    picture = np.full((720, 800, 3), 128, np.uint8)
    page = np.asarray(draw_frame(source, picture, state, "seed 5", 4.0))
    for part, ends in ((np.s_[:360, :800], (20, 20, 205, 251)), (np.s_[360:, :800], (303, 20, 340, 155))):
        changed = np.argwhere((page[part] != 128).any(axis=2))
        assert (*changed.min(axis=0), *changed.max(axis=0)) == ends
    bar = (page[95, 800:] == ImageColor.getrgb(RUNNING)).all(axis=1)
    assert (bar.argmax(), bar.sum()) == (28, 107)
