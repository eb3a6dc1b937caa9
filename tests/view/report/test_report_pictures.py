"""The pictures of a run: what their names say, and how many of them a page holds."""

from __future__ import annotations

import base64
from pathlib import Path

import pytest

from executive.view.report import report_pictures
from executive.view.report.report_pictures import Picture, collect_pictures


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "frames"
    folder.mkdir()
    return folder


def save(folder: Path, *names: str, size: int = 30) -> None:
    for name in names:
        (folder / name).write_bytes(name.encode().ljust(size, b"."))


def content(picture: Picture) -> bytes:
    return base64.b64decode(picture.source.removeprefix("data:image/jpeg;base64,"))


def test_a_name_says_when_it_was_what_it_is_about_and_what_went_wrong(folder):
    assert collect_pictures(folder / "none", ["cube-1"]) == []
    save(folder, "000012_cube-1.jpg", "000490_cube-1_missed.jpg", "000500_unsure.jpg", "notes.txt")
    decision, *failures = collect_pictures(folder, ["cube-1"])
    assert (decision.item, decision.tick, decision.reason) == ("cube-1", 12, "")
    assert decision.file == "frames/000012_cube-1.jpg"
    assert content(decision).rstrip(b".") == b"000012_cube-1.jpg"
    assert [(each.tick, each.item, each.reason) for each in failures] == [
        (490, "cube-1", "missed"), (500, "", "unsure"),
    ]  # fmt: skip


def test_items_and_reasons_may_have_underscores_and_begin_alike(folder):
    save(folder, "000001_red_cube-1.jpg", "000002_red_cube-1_no_depth.jpg", "000003_red_cube-12_not_safe.jpg")
    save(folder, "000004_no_candidate.jpg", "000005_red_no_depth.jpg")
    seen = collect_pictures(folder, ["red", "red_cube-1", "red_cube-12"])
    assert [(each.item, each.reason) for each in seen] == [
        ("red_cube-1", ""), ("red_cube-1", "no_depth"), ("red_cube-12", "not_safe"), ("", "no_candidate"),
        ("red", "no_depth"),
    ]  # fmt: skip


def test_of_several_decisions_for_an_object_the_last_is_shown_however_long_the_run(folder):
    save(folder, "000007_cube-1.jpg", "999999_cube-1.jpg", "1000007_cube-1.jpg")
    save(folder, "1000008_unsure.jpg", "999998_unsure.jpg")
    assert [each.tick for each in collect_pictures(folder, ["cube-1"])] == [1000007, 999998, 1000008]


def test_what_there_is_no_room_for_is_a_link_and_decisions_come_first(folder, monkeypatch):
    monkeypatch.setattr(report_pictures, "MAX_EMBEDDED_SIZE", 1000)
    save(folder, "000001_cube-1_missed.jpg", "000003_duck-1.jpg", "000004_duck-1_missed.jpg", size=600)
    save(folder, "000005_unsure.jpg", size=90)
    seen = collect_pictures(folder, ["cube-1", "duck-1"])
    inlined = [(each.tick, each.source.startswith("data:")) for each in seen]
    assert inlined == [(3, True), (1, False), (4, False), (5, True)]
    missed = seen[1]
    assert missed.source == missed.file == "frames/000001_cube-1_missed.jpg"


def test_a_link_leads_to_its_file_whatever_it_is_called(folder, monkeypatch):
    monkeypatch.setattr(report_pictures, "MAX_EMBEDDED_SIZE", 0)
    save(folder, "000001_größe #2?_50%.jpg")
    (linked,) = collect_pictures(folder, [])
    assert linked.source == "frames/000001_gr%C3%B6%C3%9Fe%20%232%3F_50%25.jpg"
    assert linked.file == "frames/000001_größe #2?_50%.jpg"
