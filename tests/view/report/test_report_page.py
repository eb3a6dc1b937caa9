"""The page as a reader finds it: what stands on it, in which order, and that all of it is text."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from page_reader import SECTIONS, Page

from executive.record.journal import find_run_start, read_journal
from executive.view.report.page import ReportData, render_report, write_report

NASTY = """</style></title><script>alert("x")</script><img src=x onerror='y'> & {{ 7 * 7 }} {% raw %} \x00"""
WORDS = {"kind", "status", "state", "file", "node", "path", "item", "origin", "picture"}
"""Keys of words that mean something to a report, and of names that have to agree with each other."""


def page(run: Path) -> Page:
    return Page(render_report(ReportData(run)))


def change(file: Path, change: Any) -> None:
    """Change every object in a file of JSON, one a line or one in all."""
    lines = file.read_text().splitlines() if file.suffix == ".jsonl" else [file.read_text()]
    file.write_text("".join(json.dumps(change(json.loads(line))) + "\n" for line in lines))


def nasty(value: Any) -> Any:
    """Return a value with something nasty behind every text that a mission or a skill may choose."""
    if isinstance(value, dict) and value.get("kind") == "InputRead":
        # A journal with other names or values of inputs is refused.
        return value
    if isinstance(value, dict):
        return {key: each if key in WORDS else nasty(each) for key, each in value.items()}
    if isinstance(value, list):
        return [nasty(each) for each in value]
    return value + NASTY if isinstance(value, str) and value else value


def test_the_verdict_comes_first_and_then_why_objects_timeline_and_tree(failed):
    found = page(failed)
    assert list(found.texts) == ["header", *SECTIONS]
    assert found.texts["header"].startswith(
        "FAILURE Grasp.missed Grasp of sphere-1 failed (missed) on the last of 2 attempts: no seal on"
    )
    for section, words in (
        ("header", "trial , seed 3, 1.4 s on the robot's clock"),
        (
            "diagnosis",
            "Nodes that did not handle the failure, from the root down: retry all 2 attempts failed",
        ),
        ("diagnosis", "tree/5:retry/do/Grasp"),
        ("diagnosis", "left to do 2: sphere-1"),
        ("tree", "2 failed missed: no seal on"),
        ("timeline", "Grasp Grasp of sphere-1: FAILURE"),
    ):
        assert words in found.texts[section]
    assert "Last picture before the end" in [attributes.get("alt") for _, attributes in found.elements]
    assert {"timeline", "behaviour-tree"} <= {attributes.get("class") for _, attributes in found.elements}


def test_a_success_has_no_story_and_says_what_is_in_the_bins(done):
    found = page(done)
    assert list(found.texts) == ["header", *SECTIONS[1:]]
    assert found.texts["header"].startswith("SUCCESS 1 of 2 objects are in their bins, 1 skipped.")


def test_every_object_has_its_outcome_time_picture_and_problems(failed):
    found, facts = page(failed), ReportData(failed)
    text = found.texts["objects"]
    assert all(f"{row.item} rejected" in text for row in facts.last_item_changes)
    assert [row.item for row in facts.last_item_changes] == ["sphere-1", "sphere-2"]
    assert "2 seen, 0 placed, 2 rejected" in text
    assert "0.81 s Grasp.missed no seal on sphere-1" in text
    alts = [attributes["alt"] for tag, attributes in found.elements if tag == "img"]
    assert alts.count("Image for the decision about sphere-1") == 1
    assert alts.count("sphere-1: missed") == 2


def test_the_rows_of_time_sum_up_to_the_time_of_the_run(failed, done, killed, copy):
    braked = copy(done)
    change(
        braked / "journal.jsonl",
        lambda entry: entry | ({"tick": 600, "clock": 2.5} if entry["kind"] == "RunEnded" else {}),
    )
    assert "no object" in page(braked).texts["objects"]
    for run in (failed, done, killed, braked):
        facts = ReportData(run)
        rows = re.findall(r"</td><td>([0-9.]+)</td>\s*<td class=\"bar\">", render_report(facts))
        assert len(rows) == len(facts.activity_times.times_by_item)
        assert sum(map(float, rows)) == pytest.approx(facts.timeline.clock, abs=0.01 * len(rows))


def test_params_versions_and_the_commands_that_repeat_it_are_there(failed):
    found = page(failed)
    made, commands = found.texts["inputs"], found.texts["commands"]
    assert "attempts: 2 note: größer" in made
    assert "cell.table.objects=[2, 2]" in made
    assert "python 3." in made
    start = find_run_start(read_journal(failed / "journal.jsonl"), failed, "")
    repeat = ["executive", "run", start.file, "--seed", "3"]
    repeat += ["--set", "cell.kind=fake", "--set", "cell.table.objects=[2, 2]"]
    assert f"repeat {shlex.join(repeat)} replay" in commands
    assert f"executive replay {shlex.quote(str(failed))}" in commands
    assert "resume" not in commands


def test_a_killed_run_is_reported_up_to_its_end_with_the_command_to_resume_it(killed):
    assert not (killed / "result.json").exists()
    found = page(killed)
    assert found.texts["header"].startswith(
        "INTERRUPTED The journal has no end: the run was killed, or is still running."
    )
    assert f"resume executive run --resume {shlex.quote(str(killed))}" in found.texts["commands"]
    assert "Transit Transit of sphere-1: RUNNING" in found.texts["timeline"]
    assert "sphere-1 held" in found.texts["objects"]
    assert "1 running" in found.texts["tree"]


def test_a_run_whose_result_is_gone_has_the_verdict_of_its_journal(failed, done, copy):
    run = copy(failed)
    (run / "result.json").unlink()
    assert page(run).texts["header"].startswith("FAILURE Grasp.missed no seal on sphere-1")
    change(
        run / "journal.jsonl", lambda entry: entry | ({"message": ""} if entry["kind"] == "RunEnded" else {})
    )
    assert "The run ended, but its result.json is missing." in page(run).texts["header"]


def test_the_time_and_the_pictures_of_what_was_no_object_are_shown_all_the_same(failed, copy):
    run = copy(failed)
    phantom = {"state": "phantom"}
    change(
        run / "journal.jsonl",
        lambda entry: (
            entry | (phantom if (entry["kind"], entry.get("item")) == ("ItemChanged", "sphere-1") else {})
        ),
    )
    found = page(run)
    assert "sphere-1 missed at step 330" in found.texts["objects"]
    assert "Image for the decision about sphere-1" not in found.texts["objects"]
    table, _ = found.texts["objects"].split(" look: ")
    assert "sphere-1" in table


def test_whatever_a_mission_says_is_text(failed, copy):
    run = copy(failed)
    odd = run / "frames" / "000001_unsure.jpg"
    odd.write_bytes(b"a picture")
    plain = page(run)
    odd.rename(run / "frames" / "000001_<script>'{{ 7 * 7 }}\".jpg")
    for name in ("journal.jsonl", "tree.json", "result.json"):
        change(run / name, nasty)
    text = render_report(ReportData(run))
    found = Page(text)
    assert found.shape == plain.shape
    assert found.raw == plain.raw
    assert NASTY.replace("\x00", "�") in found.texts["header"]
    assert "<script>'{{ 7 * 7 }}\" at step 1" in found.texts["objects"]
    assert "49" not in re.sub(r"[\d.]*49[\d.]* s", "", found.texts["header"])
    assert "<script" not in text
    text.encode()


@pytest.mark.parametrize("name", ["done", "failed", "killed"])
def test_the_page_needs_nothing_from_outside(name, request):
    text = render_report(ReportData(request.getfixturevalue(name)))
    found = Page(text)
    tags = {tag for tag, _ in found.elements}
    assert not tags & {"script", "iframe", "object", "embed", "base", "form", "image", "use", "foreignobject"}
    assert all(link.startswith("data:") for link in found.linked())
    assert not any(key.startswith("on") for _, attributes in found.elements for key in attributes)
    assert set(re.findall(r"https?://[^\"'\s<]*", text)) == {"http://www.w3.org/2000/svg"}
    styles = "".join(found.raw) + "".join(each.get("style", "") for _, each in found.elements)
    assert not re.search(r"url\(|@import|expression", styles)
    (policy,) = [each["content"] for tag, each in found.elements if "http-equiv" in each]
    assert policy.startswith("default-src 'none';")


def test_a_name_that_is_not_utf_8_costs_no_report(done, copy, tmp_path):
    run = copy(done).rename(tmp_path / "run\udcff")
    assert "run�" in write_report(run).read_text(encoding="utf-8")
