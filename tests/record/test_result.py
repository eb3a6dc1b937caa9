"""The result of a run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from events import at, run_ended

from executive.errors import ExecutiveError
from executive.events import MotionPlanned, OperatorAsked, RequestGiven
from executive.record.result import (
    disagreement,
    exit_code,
    planning_of,
    requests_of,
    result_of,
    write_result,
)

ITEMS = {"seen": 3, "placed": 2, "rejected": 1, "skipped": 0, "lost": 0, "phantom": 1, "rows": [{}]}
AUDIT = {"right": 2, "wrong_bin": 0, "left": 1, "elsewhere": 0, "fell_in_wrong_bin": 0, "unseen": 0}
NOTED = [
    at(1, MotionPlanned(False, 0.05, 1.0)),
    at(2, MotionPlanned(True, 0.02, 1.0)),
    at(3, MotionPlanned(True, 0.0, 1.0)),
    at(4, RequestGiven("cube")),
]
STORY = {"verdict": "Grasp failed"}


def result(items=ITEMS, audit=AUDIT, **ended) -> dict:
    end = run_ended(**{"empty": True, "ticks": 240, "robot_time": 1.0} | ended)
    return result_of(
        mission="sort", seed=7, outcome=end, items=items,
        audit=audit, noted=NOTED, story=STORY, wall_time=0.5, trace="ab", run=Path("r"),
    )  # fmt: skip


def test_has_every_field_that_is_promised():
    made = result()
    assert set(made) >= {"mission", "status", "reason", "seed", "robot_time_s", "wall_time_s", "trace", "run"}
    assert made["items"] == {"seen": 3, "placed": 2, "rejected": 1, "skipped": 0, "lost": 0, "phantom": 1}
    assert made["audit"] == {"agrees": True, **AUDIT}
    assert (made["version"], made["empty"]) == (2, True)
    assert planning_of([]) == {"motions": 0, "ahead": 0, "waited_s": 0.0}
    assert made["planning"] == {"motions": 3, "ahead": 2, "waited_s": 0.07}
    assert (made["requests"], made["story"]) == (["cube"], STORY)


@pytest.mark.parametrize(
    ("wanted", "words"),
    [([], []), (["cube", "rescan"], ["cube", "rescan"]), ([None], ["quit"]),
     (["cube", None, "duck", None, None], ["cube", "quit", "duck"])],
)  # fmt: skip
def test_the_end_of_the_list_is_a_wish_to_quit_and_goes_without_saying(wanted, words):
    events = [at(1, RequestGiven(word)) for word in wanted]
    assert requests_of([at(0, OperatorAsked(["cube"])), *events]) == words


def test_is_written_and_can_be_read_again(tmp_path):
    write_result(tmp_path / "result.json", result())
    assert json.loads((tmp_path / "result.json").read_text()) == result()


def test_a_disk_that_does_not_take_it_is_a_sentence(tmp_path):
    with pytest.raises(ExecutiveError, match=r"cannot write the result .* the journal beside it"):
        write_result(tmp_path / "nowhere" / "result.json", result())


@pytest.mark.parametrize(
    ("audit", "ended", "warning"),
    [
        ({}, {}, ""),
        (None, {}, ""),
        ({"right": 1, "wrong_bin": 1}, {}, "THE AUDIT DISAGREES: 1 in a wrong bin; the audit found 1 in "),
        ({"right": 3, "left": 0}, {}, "THE AUDIT DISAGREES: the audit found 3 in their bins, 0 on the table"),
        (
            {"left": 0, "elsewhere": 1},
            {},
            "0 on the table and 1 elsewhere; the executive reports 2 placed, 1 re",
        ),
        ({"left": 2, "unseen": 1}, {}, "THE AUDIT DISAGREES: 1 never seen; "),
        ({"left": 2, "unseen": 1}, {"empty": False}, ""),
        ({"elsewhere": 1, "fell_in_wrong_bin": 1}, {}, "DISAGREES: 1 fallen into a wrong bin; "),
    ],
)
def test_every_disagreement_of_ledger_and_audit_is_noticed(audit, ended, warning):
    made = result(audit=None if audit is None else AUDIT | audit, **ended)
    assert warning in disagreement(made)
    assert bool(disagreement(made)) == bool(warning)
    assert exit_code(made) == (1 if warning else 0)


@pytest.mark.parametrize(
    ("status", "code"), [("SUCCESS", 0), ("FAILURE", 1), ("FAULT", 3), ("INCOMPLETE", 4), ("HALTED", 130)]
)
def test_the_exit_code_follows_from_the_status_unless_the_audit_disagrees(status, code):
    assert exit_code(result(status=status)) == code
    wrong = result(status=status, audit=AUDIT | {"right": 1, "wrong_bin": 1})
    assert exit_code(wrong) == (1 if code in (0, 4) else code)
