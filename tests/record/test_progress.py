"""How far a run is."""

from __future__ import annotations

import pytest

from executive.events import Event
from executive.record.progress import Progress, skill_name


@pytest.fixture
def progress():
    return Progress()


def skill(name: str, status: str) -> Event:
    return Event("status", 0, 0.0, {"node": f"tree/do/{name}", "status": status, "item": ""})


def item(name: str, state: str, bin: str = "") -> Event:
    return Event("item", 0, 0.0, {"item": name, "state": state, "bin": bin})


def test_skills_that_run_at_the_same_time_are_one_phase(progress):
    assert progress.phase == ""
    progress(Event("status", 0, 0.0, {"node": "tree/do", "status": "RUNNING"}))
    for event in (skill("Transit", "RUNNING"), skill("Detect", "RUNNING"), skill("Detect", "INVALID")):
        progress(event)
    progress(skill("Localize", "RUNNING"))
    assert progress.phase == "Transit + Localize"


@pytest.mark.parametrize(
    ("path", "name"),
    [("tree/do/Grasp", "Grasp"), ("tree/do/2:Detect", "Detect"), ("tree/recover/look/pick", "pick")],
)
def test_a_skill_goes_by_its_name_or_label(path, name):
    assert skill_name(path) == name


def test_items_are_told_by_bin_in_the_order_they_came_there(progress):
    for event in (
        item("cube-1", "seen"), item("cube-2", "seen"), item("duck-1", "rejected"), item("duck-2", "held"),
        item("duck-3", "seen"),
        item("cube-2", "placed", "red_bin"), item("cube-1", "placed", "red_bin"),
        item("cube-2", "placed", "red_bin"),
    ):  # fmt: skip
        progress(event)
    fates = {"red_bin": ("cube-2", "cube-1"), "rejected": ("duck-1",), "in the tool": ("duck-2",)}
    assert progress.fates() == fates
    assert next(iter(progress.fates())) == "red_bin"
    assert progress.item("cube-1")["state"] == "placed"
    assert progress.item("cube-9") == {}


def test_a_class_keeps_its_place(progress):
    progress(Event("run", 0, 0.0, {"mission": "sort"}))
    progress(Event("look", 0, 0.0, {"found": [{"label": "sphere"}, {"label": "cube"}]}))
    progress(Event("look", 0, 0.0, {"found": [{"label": "cube"}, {"label": "duck"}]}))
    assert progress.classes == ("cube", "sphere", "duck")
    assert progress.mission == "sort"
