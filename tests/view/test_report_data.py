"""Data of a report: valid files of a run directory, and pictures of the run."""

from __future__ import annotations

import base64
import json
import shlex
from pathlib import Path

import pytest
from events import at, run_ended

from executive.cell.json_values import to_json
from executive.events import Event, RunResumed
from executive.record.journal import encode_event
from executive.view import report
from executive.view.report import INTERRUPTED, ReportData, collect_pictures, try_write_report


def append(run: Path, tick: int, event: Event) -> None:
    with (run / "journal.jsonl").open("ab") as journal:
        journal.write(encode_event(at(tick, event)))


def without_end(run: Path) -> None:
    lines = (run / "journal.jsonl").read_text().splitlines(keepends=True)
    (run / "journal.jsonl").write_text("".join(lines[:-1]))


def test_a_run_that_ended_is_described_by_its_result(failed):
    facts = ReportData(failed)
    assert to_json(facts.result) == json.loads((failed / "result.json").read_text())
    assert (facts.status, facts.timeline.clock) == ("FAILURE", facts.result.robot_time_s)
    assert facts.resume_command == ""
    assert {each.item for each in facts.pictures if not each.reason} == {"sphere-1"}
    assert {one.node for one in facts.timeline.activations} <= {node.path for node in facts.nodes}


def test_a_result_from_before_the_run_was_taken_up_again_is_not_its_end(failed, copy):
    run = copy(failed)
    append(run, 312, RunResumed(310, "", {}))
    facts = ReportData(run)
    assert (facts.status, facts.outcome, facts.timeline.clock) == (INTERRUPTED, None, 1.3)
    append(run, 400, run_ended("HALTED", reason="halted", message="halted by the user", ticks=400))
    facts = ReportData(run)
    assert (facts.status, facts.outcome.message) == ("HALTED", "halted by the user")
    assert facts.resume_command == shlex.join(["executive", "run", "--resume", str(run)])


@pytest.mark.parametrize("content", ["{}", "\ud800"])
def test_a_result_that_is_none_tells_nothing(failed, copy, content):
    run = copy(failed)
    (run / "result.json").write_bytes(content.encode(errors="surrogatepass"))
    facts = ReportData(run)
    assert (facts.status, facts.outcome) == ("FAILURE", facts.timeline.ended)
    without_end(run)
    assert (ReportData(run).status, ReportData(run).outcome) == (INTERRUPTED, None)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "frames"
    folder.mkdir()
    return folder


def save(folder: Path, *names: str, size: int = 30) -> None:
    for name in names:
        (folder / name).write_bytes(name.encode().ljust(size, b"."))


def test_a_file_name_states_step_item_and_reason(folder):
    save(
        folder, "000012_red_cube-1.jpg", "000490_red_cube-1_no_depth.jpg", "000500_no_candidate.jpg", "a.txt"
    )
    save(folder, "000003_red_cube-12_not_safe.jpg", "000501_red_no_depth.jpg")
    decision, *failures = collect_pictures(folder, ["red", "red_cube-1", "red_cube-12"])
    assert (decision.item, decision.tick, decision.reason) == ("red_cube-1", 12, "")
    assert decision.file == "frames/000012_red_cube-1.jpg"
    content = base64.b64decode(decision.source.removeprefix("data:image/jpeg;base64,"))
    assert content.rstrip(b".") == b"000012_red_cube-1.jpg"
    assert [(each.tick, each.item, each.reason) for each in failures] == [
        (3, "red_cube-12", "not_safe"), (490, "red_cube-1", "no_depth"), (500, "", "no_candidate"),
        (501, "red", "no_depth"),
    ]  # fmt: skip


def test_what_there_is_no_room_for_is_a_link_and_decisions_come_first(folder, monkeypatch):
    monkeypatch.setattr(report, "MAX_EMBEDDED_SIZE", 1000)
    save(folder, "000001_größe #2?_50%.jpg", "000003_duck-1.jpg", "000004_duck-1_missed.jpg", size=600)
    save(folder, "000005_unsure.jpg", size=90)
    seen = collect_pictures(folder, ["cube-1", "duck-1"])
    inlined = [(each.tick, each.source.startswith("data:")) for each in seen]
    assert inlined == [(3, True), (1, False), (4, False), (5, True)]
    assert seen[1].source == "frames/000001_gr%C3%B6%C3%9Fe%20%232%3F_50%25.jpg"
    assert seen[1].file == "frames/000001_größe #2?_50%.jpg"


@pytest.mark.parametrize(
    ("file", "content", "problem"),
    [
        ("journal.jsonl", "", "was interrupted before its start"),
        ("journal.jsonl", "no JSON\n{}\n", "journal.jsonl:1: this line is no event (expected ident"),
        ("tree.json", "[{}]", "contains no tree of a run: field required"),
        ("report.html", None, "cannot write the report"),
        ("frames/000001_odd.jpg", None, "IsADirectoryError: "),
    ],
)  # fmt: skip
def test_a_missing_report_is_explained(done, copy, file: str, content: str | None, problem: str):
    run = copy(done)
    if content is None:
        (run / file).mkdir()
    else:
        (run / file).write_text(content)
    report, text = try_write_report(str(run))
    assert (report, text.startswith("no report was written: "), problem in text) == ("", True, True)
    assert not (run / "report.html").is_file()
