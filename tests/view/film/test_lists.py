"""What is left out where there is too little room: rows of the tree, items, ends of lines."""

from __future__ import annotations

import numpy as np
from PIL import Image
from small_tree import NODES, node, status

from executive.view.film.branch import draw_branch, fitted
from executive.view.film.course import Course
from executive.view.film.ink import BACK, clipped, font, wrapped
from executive.view.film.listing import MOST, draw_items, height, kept
from executive.view.items import Row


def course_of(*entries) -> Course:
    course = Course(entries, NODES, [])
    course.go_to(1000, 0.0)
    return course


def test_what_never_ran_gives_way_first_then_what_rests() -> None:
    nodes = [
        node("t", 0, "try"), node("t/A", 1), node("t/do", 1, "sequence"), node("t/do/B", 2), node("t/C", 1)
    ]  # fmt: skip
    course = course_of(
        status(0, "t", "RUNNING"), status(0, "t/A", "SUCCESS"), status(1, "t/do", "RUNNING"),
        status(1, "t/do/B", "RUNNING"),
    )  # fmt: skip
    names = [[one.path for one in fitted(nodes, course, rows)] for rows in (9, 4, 3)]
    assert names == [
        ["t", "t/A", "t/do", "t/do/B", "t/C"], ["t", "t/A", "t/do", "t/do/B"], ["t", "t/do", "t/do/B"]
    ]  # fmt: skip


def test_nothing_is_drawn_outside_of_its_box() -> None:
    deep = [node("/".join("abcdefghijklmnop"[: n + 1]) + "long" * n, n, "sequence") for n in range(16)]
    course = course_of(*(status(0, one.path, "RUNNING", reason="x" * 200) for one in deep))
    page = Image.new("RGB", (400, 300), BACK)
    draw_branch(page, (20, 20, 300, 220), deep, course)
    rows = [Row("item-" + "9" * 60, "class" * 9, "placed", "bin" * 30, "")] * 30
    draw_items(page, (20, 225, 300, 300), rows[:2], {})
    drawn = np.argwhere((np.asarray(page) != np.asarray(Image.new("RGB", (1, 1), BACK))).any(axis=2))
    (top, left), (bottom, right) = drawn.min(axis=0), drawn.max(axis=0)
    assert left >= 20
    assert right <= 300
    assert top >= 20
    assert bottom < 225 + height(2)


def test_settled_items_give_way_to_those_still_to_do() -> None:
    rows = [Row(f"cube-{n}", "cube", "placed" if n % 2 else "seen", "", "") for n in range(MOST + 3)]
    names = [row.item for row in kept(rows)]
    assert len(names) == MOST
    assert not {"cube-1", "cube-3", "cube-5"} & set(names)
    assert names == sorted(names, key=lambda name: int(name[5:]))
    assert kept(rows[:3]) == rows[:3]
    assert height(3) < height(MOST) == height(MOST + 20)


def test_lines_are_as_wide_as_they_may_be() -> None:
    assert clipped("short", 14, 100) == "short"
    cut = clipped("a word and then another one", 14, 100)
    assert cut.endswith("…")
    assert font(14).getlength(cut) <= 100
    assert clipped("anything", 14, 3) == ""
    text = "no seal on sphere-1 0.10 s after contact, and neither the second nor the third went any better"
    assert " ".join(wrapped(text, 14, 300, 9)) == text
    two = wrapped(text, 14, 300, 2)
    assert len(two) == 2
    assert all(font(14).getlength(line) <= 300 for line in two)
    assert two[1].endswith("…")
    assert wrapped("", 14, 300, 2) == []
