"""The page as a reader finds it: what stands on it, in which order, and that all of it is text."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

from page_reader import SECTIONS, Page

from executive.record.journal import find_run_start, read_journal
from executive.view import report
from executive.view.report import ReportData, render_report

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


def test_the_sections_explain_a_failure_and_list_each_object(failed):
    found = page(failed)
    assert list(found.texts) == ["header", *SECTIONS]
    for section, words in (
        ("header", "FAILURE Grasp.missed Grasp of sphere-1 failed (missed) on the last of 2 attempts"),
        ("header", "trial , seed 3, "),
        ("diagnosis", "retry all 2 attempts failed"),
        ("diagnosis", "tree/5:retry/do/Grasp"),
        ("diagnosis", "left to do 2: sphere-1"),
        ("objects", "sphere-1 rejected"),
        ("objects", "sphere-2 rejected"),
        ("objects", "2 seen, 0 placed, 2 rejected"),
        ("objects", "s Grasp.missed no seal on sphere-1"),
        ("timeline", "Grasp Grasp of sphere-1: FAILURE"),
        ("tree", "2 failed missed: no seal on"),
        ("inputs", "attempts: 2 note: größer"),
        ("inputs", "cell.table.objects=[2, 2]"),
        ("inputs", "python 3."),
        ("commands", f"executive replay {shlex.quote(str(failed))}"),
    ):
        assert words in found.texts[section]
    alternative_texts = [attributes["alt"] for tag, attributes in found.elements if tag == "img"]
    assert alternative_texts.count("Last picture before the end") == 1
    assert alternative_texts.count("Image for the decision about sphere-1") == 1
    assert alternative_texts.count("sphere-1: missed") == 2
    start = find_run_start(read_journal(failed / "journal.jsonl"), failed, "")
    repeat = ["executive", "run", start.file, "--seed", "3"]
    repeat += ["--set", "cell.kind=fake", "--set", "cell.table.objects=[2, 2]"]
    assert f"repeat {shlex.join(repeat)} replay" in found.texts["commands"]
    assert "resume" not in found.texts["commands"]


def test_objects_before_the_last_are_rows_of_a_table(failed, monkeypatch):
    monkeypatch.setattr(report, "MAX_CARD_COUNT", 1)
    found = page(failed)
    assert (
        "1 earlier objects object state bin or place failures reason sphere-1 rejected"
        in found.texts["objects"]
    )
    assert "Image for the decision about sphere-1" not in [each.get("alt") for _, each in found.elements]


def test_a_success_has_no_diagnosis(done):
    found = page(done)
    assert list(found.texts) == ["header", *SECTIONS[1:]]
    assert found.texts["header"].startswith("SUCCESS 1 of 2 objects are in their bins, 1 skipped.")


def test_a_killed_run_is_reported_up_to_its_end_with_the_command_to_resume_it(killed):
    assert not (killed / "result.json").exists()
    found = page(killed)
    assert found.texts["header"].startswith("INTERRUPTED The journal has no end")
    assert f"resume executive run --resume {shlex.quote(str(killed))}" in found.texts["commands"]
    assert "Transit Transit of sphere-1: RUNNING" in found.texts["timeline"]
    assert "sphere-1 held" in found.texts["objects"]
    assert "1 running" in found.texts["tree"]


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
