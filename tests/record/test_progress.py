"""How far a run is."""

from __future__ import annotations

import pytest
from events import at, detected, frame_searched, item_changed, run_started, skill_ended, skill_started

from executive.events import NodeStarted
from executive.record.progress import Progress, skill_name


@pytest.fixture
def progress():
    return Progress()


def test_skills_that_run_at_the_same_time_are_one_phase(progress):
    assert progress.phase == ""
    progress(at(0, NodeStarted("tree/do")))
    for name in ("Transit", "Detect"):
        progress(at(0, skill_started(f"tree/do/{name}")))
    progress(at(0, skill_ended("tree/do/Detect", "INVALID")))
    progress(at(0, skill_started("tree/do/Localize")))
    assert progress.phase == "Transit + Localize"


@pytest.mark.parametrize(
    ("path", "name"),
    [("tree/do/Grasp", "Grasp"), ("tree/do/2:Detect", "Detect"), ("tree/recover/look/pick", "pick")],
)
def test_a_skill_goes_by_its_name_or_label(path, name):
    assert skill_name(path) == name


def test_items_are_told_by_bin_in_the_order_they_came_there(progress):
    for item, state in (
        ("cube-1", "seen"), ("cube-2", "seen"), ("duck-1", "rejected"), ("duck-2", "held"),
        ("duck-3", "seen"), ("cube-2", "placed"), ("cube-1", "placed"), ("cube-2", "placed"),
    ):  # fmt: skip
        progress(at(0, item_changed(item, state, bin="red_bin" if state == "placed" else "")))
    fates = {"red_bin": ("cube-2", "cube-1"), "rejected": ("duck-1",), "in the tool": ("duck-2",)}
    assert progress.fates() == fates
    assert next(iter(progress.fates())) == "red_bin"
    assert progress.item("cube-1").state == "placed"
    assert progress.item("cube-9") is None


def test_a_class_keeps_its_place(progress):
    progress(at(0, run_started(mission="sort")))
    progress(at(0, frame_searched(detected("sphere"), detected("cube"))))
    progress(at(0, frame_searched(detected("cube"), detected("duck"))))
    assert progress.classes == ("cube", "sphere", "duck")
    assert progress.mission == "sort"
