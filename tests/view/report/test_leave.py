"""The report that a run leaves: whatever goes wrong with it, nothing is raised, and a sentence says what."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from executive.view.report.page import leave_report


def test_a_run_that_ended_leaves_its_report(done, copy):
    run = copy(done)
    assert leave_report({"run": str(run)}) == (str(run / "report.html"), "")
    assert (run / "report.html").read_text().startswith("<!doctype html>")


def torn(run: Path) -> None:
    (run / "journal.jsonl").write_text("no JSON\n{}\n")


def strange(run: Path) -> None:
    (run / "journal.jsonl").write_text(json.dumps({"kind": "run"}) + "\n")


def treeless(run: Path) -> None:
    (run / "tree.json").write_text("[{}]")


def occupied(run: Path) -> None:
    (run / "report.html").mkdir()


def in_the_way(run: Path) -> None:
    (run / "frames" / "000001_odd.jpg").mkdir()


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (torn, "no report was written: {run}/journal.jsonl:1: this line is not JSON"),
        (strange, "no report was written: KeyError: 'clock'; `executive --debug report {run}` shows where"),
        (treeless, 'no report was written: "{run}/tree.json" holds no tree of a run: field required'),
        (occupied, 'no report was written: cannot write the report "{run}/report.html": is a directory; '),
        (in_the_way, "no report was written: IsADirectoryError: "),
    ],
)
def test_why_there_is_none_is_told(done, copy, spoil: Callable[[Path], None], sentence: str):
    run = copy(done)
    spoil(run)
    file, problem = leave_report({"run": str(run)})
    assert file == ""
    assert problem.startswith(sentence.format(run=run))
    assert not (run / "report.html").is_file()


@pytest.mark.parametrize("result", [{}, {"run": "/nowhere"}])
def test_a_result_that_leads_nowhere_raises_nothing(result: Mapping[str, Any], tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file, problem = leave_report(result)
    assert file == ""
    assert problem.startswith("no report was written: ")
