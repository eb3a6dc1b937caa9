"""The timeline: what is drawn of a course, and how large it may become."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest
from made_up_runs import TREE, picks, ran

from executive.mission.outline import OutlineNode
from executive.record.timeline import Activation, Timeline
from executive.view.report import MAX_AXIS_LENGTH, MAX_BAR_COUNT, MIN_AXIS_LENGTH, draw_lanes

THINNEST = 1.5
SVG = "{http://www.w3.org/2000/svg}"


def drawn(course: list[Activation], end: float, nodes: Sequence[OutlineNode] = TREE) -> str:
    """Return the picture of activations up to a time."""
    return draw_lanes(Timeline(activations=course, clock=end), nodes)


def lanes(course: list[Activation], end: float) -> dict[str, Element]:
    picture = ElementTree.fromstring(drawn(course, end))
    return {lane.attrib["data-path"]: lane for lane in picture.findall(f"{SVG}g")}


def bars(lane: Element) -> list[tuple[str, float]]:
    """Return the bars of a lane: how each ended, and how wide it is."""
    return [(bar.attrib["class"], float(bar.attrib["width"])) for bar in lane.findall(f"{SVG}rect")]


def said(lane: Element) -> list[str]:
    return [bar.findtext(f"{SVG}title") or "" for bar in lane.findall(f"{SVG}rect")]


def test_a_bar_is_as_long_as_it_took_and_says_what_happened():
    course = [
        ran("Approach", 0.0, 1.0, "cube-1"),
        ran("Approach", 2.0, 2.5, "cube-2", "FAILURE", "blocked", "link 5 met a wrench"),
    ]
    lane = lanes(course, 90.0)["tree/Approach"]
    assert bars(lane) == [("success", 45.0), ("failure", 22.5)]
    assert said(lane) == [
        "Approach of cube-1: SUCCESS\n0.00 s to 1.00 s (1.00 s)",
        "Approach of cube-2: FAILURE\n2.00 s to 2.50 s (0.50 s)\nblocked: link 5 met a wrench",
    ]


def test_indistinguishable_activations_share_a_bar_in_the_colour_of_the_worst():
    course = [ran("Detect", 0.02 * n, 0.02 * n + 0.01) for n in range(3)]
    course[1] = replace(course[1], status="FAILURE", reason="unsure", message="too dark")
    lane = lanes([*course, ran("Detect", 1.0, 1.01)], 90.0)["tree/Detect"]
    assert bars(lane) == [("failure", 2.2), ("success", THINNEST)]
    assert said(lane)[0] == "Detect: 2 done, 1 failed\n0.00 s to 0.05 s (0.05 s)\nunsure: too dark"


def test_however_long_the_run_its_timeline_has_a_bound():
    text = drawn(picks(3_000), 15_000.0)
    assert MAX_BAR_COUNT / 3 < text.count("<rect") <= MAX_BAR_COUNT + len(TREE)


@pytest.mark.parametrize(
    ("end", "length"),
    [(0.0, MIN_AXIS_LENGTH), (1.0, MIN_AXIS_LENGTH), (100.0, 4500.0), (4e6, MAX_AXIS_LENGTH)],
)
def test_the_time_axis_is_neither_too_short_nor_too_long_and_its_times_stand_clear(end, length):
    picture = ElementTree.fromstring(drawn([ran("Wait", 0.0, end)], end))
    (bar,) = picture.iter(f"{SVG}rect")
    assert float(bar.attrib["width"]) == pytest.approx(length if end else THINNEST)
    width = float(picture.attrib["width"])
    assert width > length
    clocks = [text for text in picture.iter(f"{SVG}text") if text.attrib["class"] == "clock"]
    places = [float(text.attrib["x"]) for text in clocks]
    assert (clocks[0].text, places[-1] <= width) == ("0 s", True)
    assert all(after - before >= 55 - 0.2 for before, after in pairwise(places))
