"""What a report is told from: which of the files in a run directory is believed, and for what."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest
from events import at, run_ended

from executive.cell.json_values import to_json
from executive.cells.fake.cell import FakeCell
from executive.errors import InputError
from executive.events import Event, FaultInjected, RequestGiven, RunResumed
from executive.mission.text.file_search import get_shipped_folder
from executive.plugins import load_skills
from executive.record.journal_format import encode_event
from executive.record.recorded_run import RecordOptions
from executive.record.resume import resume_run
from executive.run.assembly import RunOptions
from executive.view.report.report_data import INTERRUPTED, ReportData


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


@pytest.mark.slow
def test_an_interrupted_and_resumed_run_is_described_as_one(killed, copy):
    run = copy(killed)
    assert ReportData(run).status == INTERRUPTED
    resume_run(run, load_skills(), RunOptions(3, kind=FakeCell), RecordOptions(saves_pictures=False))
    facts = ReportData(run)
    assert (facts.status, facts.resume_command) == ("SUCCESS", "")
    transits = [one for one in facts.timeline.activations if one.node.endswith("/Transit")]
    assert [one.status for one in transits] == ["INVALID", "SUCCESS"]
    assert transits[0].end <= transits[1].start
    assert sum(sum(row.values()) for row in facts.activity_times.times_by_item.values()) == pytest.approx(
        facts.timeline.clock
    )


def test_a_result_from_before_the_run_was_taken_up_again_is_not_its_end(failed, copy):
    run = copy(failed)
    append(run, 312, RunResumed(310, "", {}))
    facts = ReportData(run)
    assert (facts.status, facts.end, facts.timeline.clock) == (INTERRUPTED, None, 1.3)
    append(run, 400, run_ended("HALTED", reason="halted", message="halted by the user", ticks=400))
    facts = ReportData(run)
    assert (facts.status, facts.end.message) == ("HALTED", "halted by the user")
    assert facts.resume_command == shlex.join(["executive", "run", "--resume", str(run)])


def test_a_run_whose_end_was_not_written_is_described_by_its_result(failed, copy):
    run = copy(failed)
    without_end(run)
    result = json.loads((run / "result.json").read_text()) | {"status": "FAULT"}
    (run / "result.json").write_text(json.dumps(result))
    facts = ReportData(run)
    assert (facts.status, to_json(facts.result)) == ("FAULT", result)


@pytest.mark.parametrize("content", ["", "[1]", "{}", '{"status": "ODD"}', "\ud800"])
def test_a_result_that_is_none_tells_nothing(failed, copy, content):
    run = copy(failed)
    (run / "result.json").write_bytes(content.encode(errors="surrogatepass"))
    facts = ReportData(run)
    assert (facts.status, facts.end) == ("FAILURE", facts.timeline.ended)
    without_end(run)
    assert (ReportData(run).status, ReportData(run).end) == (INTERRUPTED, None)


def test_a_shipped_mission_is_repeated_by_its_name_and_with_what_was_asked_for(done, copy):
    run = copy(done)
    start, *others = (run / "journal.jsonl").read_text().splitlines()
    shipped = json.loads(start) | {"file": str(get_shipped_folder() / "sort_fruit.yaml"), "overrides": {}}
    (run / "journal.jsonl").write_text("\n".join([json.dumps(shipped), *others]) + "\n")
    append(run, 420, RequestGiven("apple"))
    append(run, 432, FaultInjected("object removed", "", "", "", []))
    facts = ReportData(run)
    assert facts.repeat_command == "executive run sort_fruit --seed 3 --request apple"
    assert facts.replay_command == shlex.join(["executive", "replay", str(run)])
    assert (facts.requests, facts.timeline.faults) == (["apple"], [(1.8, "object removed")])


def test_a_run_that_had_not_begun_has_nothing_to_report(done, copy):
    run = copy(done)
    (run / "journal.jsonl").write_text("")
    with pytest.raises(InputError) as caught:
        ReportData(run)
    assert str(caught.value) == (
        f'the run in "{run}" was interrupted before its start; there is nothing to report'
    )
