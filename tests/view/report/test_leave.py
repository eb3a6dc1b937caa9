"""The report that a run leaves: whatever goes wrong with it, nothing is raised, and a sentence says what."""

from __future__ import annotations

import pytest

from executive.view.report.page import try_write_report


def test_a_run_that_ended_leaves_its_report(done, copy):
    run = copy(done)
    assert try_write_report(str(run)) == (str(run / "report.html"), "")
    assert (run / "report.html").read_text().startswith("<!doctype html>")


@pytest.mark.parametrize(
    ("file", "content", "sentence"),
    [
        ("journal.jsonl", "no JSON\n{}\n", "{run}/journal.jsonl:1: this line is no event (expected ident"),
        ("tree.json", "[{}]", '"{run}/tree.json" contains no tree of a run: field required'),
        ("report.html", None, 'cannot write the report "{run}/report.html": is a directory; '),
        ("frames/000001_odd.jpg", None, "IsADirectoryError: "),
    ],
)  # fmt: skip
def test_a_missing_report_is_explained(done, copy, file: str, content: str | None, sentence: str):
    run = copy(done)
    if content is None:
        (run / file).mkdir()
    else:
        (run / file).write_text(content)
    left, problem = try_write_report(str(run))
    assert left == ""
    assert problem.startswith("no report was written: " + sentence.format(run=run))
    assert not (run / "report.html").is_file()


@pytest.mark.parametrize("run", ["", "/nowhere"])
def test_a_result_that_leads_nowhere_raises_nothing(run: str, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file, problem = try_write_report(run)
    assert file == ""
    assert problem.startswith("no report was written: ")
