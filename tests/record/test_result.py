"""The result of a run."""

from __future__ import annotations

import json
from dataclasses import asdict

import pytest

from executive.cell.json_values import to_json
from executive.record.result import Audit, ItemCounts, Result, find_exit_code, read_result, write_result
from executive.record.run_directory import RunDirectory

ITEMS = ItemCounts(seen=3, placed=2, rejected=1, phantom=1)
AUDIT = {"right": 2, "wrong_bin": 0, "left": 1, "elsewhere": 0, "fell_in_wrong_bin": 0, "unseen": 0}


def result(audit=AUDIT, status="SUCCESS", empty=True) -> Result:
    return Result(
        mission="sort", seed=7, status=status, reason="", message="", node="", is_table_empty=empty,
        items=ITEMS,
        audit=None if audit is None else Audit.from_counts(asdict(ITEMS), audit, empty), ticks=240, run="r",
    )  # fmt: skip


def test_is_written_and_can_be_read_again(tmp_path):
    write_result(tmp_path / "result.json", result())
    written = json.loads((tmp_path / "result.json").read_text())
    assert written["audit"] == {"agrees": True, **AUDIT}
    (tmp_path / "journal.jsonl").touch()
    assert to_json(read_result(RunDirectory(tmp_path), [])) == written


@pytest.mark.parametrize(
    ("audit", "empty", "warning"),
    [
        ({}, True, ""),
        (None, True, ""),
        ({"right": 1, "wrong_bin": 1}, True, "1 in a wrong bin; the audit found 1 in "),
        ({"right": 3, "left": 0}, True, "the audit found 3 in their bins, 0 on the table"),
        ({"left": 0, "elsewhere": 1}, True, "1 elsewhere; the executive reports 2 placed, 1 re"),
        ({"left": 2, "unseen": 1}, True, "1 never seen; "),
        ({"left": 2, "unseen": 1}, False, ""),
        ({"elsewhere": 1, "fell_in_wrong_bin": 1}, True, "1 fallen into a wrong bin; "),
    ],
)
def test_every_disagreement_of_ledger_and_audit_is_noticed(audit, empty, warning):
    made = result(audit=None if audit is None else AUDIT | audit, empty=empty)
    assert warning in made.disagreement
    assert bool(made.disagreement) == bool(warning)
    assert find_exit_code(made) == (1 if warning else 0)


@pytest.mark.parametrize(
    ("status", "code"), [("SUCCESS", 0), ("FAILURE", 1), ("FAULT", 3), ("INCOMPLETE", 4), ("HALTED", 130)]
)
def test_the_exit_code_follows_from_the_status_unless_the_audit_disagrees(status, code):
    assert find_exit_code(result(status=status)) == code
    wrong = result(status=status, audit=AUDIT | {"right": 1, "wrong_bin": 1})
    assert find_exit_code(wrong) == (1 if code in (0, 4) else code)
