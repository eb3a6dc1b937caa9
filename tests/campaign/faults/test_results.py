"""What is told of fault campaigns: the matrix, what went wrong, and what no run entered."""

from __future__ import annotations

from dataclasses import replace

from executive.campaign.faults.planned_fault import PlannedFault, SkillFault
from executive.campaign.faults.results import (
    Branch,
    FaultCampaignResults,
    Trial,
    list_result_lines,
    list_trial_lines,
    results_to_json,
)

MISS = PlannedFault(
    "tree/Grasp", "Grasp", "sort.yaml:7", "missed", "first", "nothing seals",
    SkillFault("tree/Grasp", "fails", "missed"),
)  # fmt: skip
STICK = replace(MISS, location="tree/Release", name="Release", mission_line="sort.yaml:9", kind="stuck")
BUG = replace(MISS, location="tree/Wait", name="Wait", mission_line="sort.yaml:9", kind="raises")
TAKEN = replace(
    MISS, location="object", name="object", mission_line="", kind="taken", occasion="late",
    cause="from 8.00 s on",
)  # fmt: skip
MISSED = Trial("SUCCESS", "", "", "", True, "", 10, 1.0, faults={1: MISS}, have_occurred=True)
LASTING = replace(MISSED, faults={2: replace(MISS, occasion="lasting")}, missing_count=3)
AGAIN = replace(MISSED, faults={3: MISS}, missing_count=0)
STUCK = replace(
    MISSED, faults={4: STICK}, status="FAILURE", reason="Release.stuck", message="it hangs",
    node="tree/Release",
)  # fmt: skip
NOWHERE = replace(MISSED, faults={1: MISS, 5: BUG}, have_occurred=False)
WRONG = replace(
    STUCK, faults={6: TAKEN}, problems=("the arm is not at rest",), remark="it says Release.stuck"
)
BRANCHES = (
    Branch("sort.yaml:12", "catch on Grasp.missed", 2),
    Branch("sort.yaml:14", "recover"),
)
TRIALS = (MISSED, LASTING, AGAIN, STUCK, NOWHERE, WRONG)
FIGURES = FaultCampaignResults("sort", "fake", 3, 11.5, 6, TRIALS, BRANCHES, True)


def test_the_matrix_has_a_row_per_node_and_fault_and_a_column_per_occasion() -> None:
    assert list(list_result_lines(FIGURES))[:8] == [
        "sort (fake), seed 3: 6 runs with faults; a run without faults takes 11.5 s",
        "",
        "  node     place        fault   first                  middle  late  lasting",
        "  Grasp    sort.yaml:7  missed  ok 2/2                               ok -3",
        "  Release  sort.yaml:9  stuck   FAILURE Release.stuck",
        "  Wait     sort.yaml:9  raises  -",
        "  object                taken                                  !!",
        "",
    ]


def test_a_cell_of_several_runs_tells_how_many_were_ok_and_the_worst_of_the_others() -> None:
    def cell(*trials: Trial) -> str:
        row = list(list_result_lines(replace(FIGURES, trials=trials)))[3]
        return row.removeprefix("  Grasp  sort.yaml:7  missed  ")

    failed = replace(MISSED, status="FAILURE", reason="Grasp.missed")
    assert cell(MISSED, failed, failed) == "ok 1/3, FAILURE Grasp.missed"
    assert cell(MISSED, failed, replace(MISSED, problems=("bad",))) == "ok 1/3, !!"
    # A fault that did not occur was also tried at another time.
    assert cell(MISSED, replace(MISSED, have_occurred=False)) == "ok"


def test_problems_and_recoveries_never_entered_are_printed_with_their_positions() -> None:
    assert list(list_result_lines(FIGURES))[8:] == [
        "  as without faults: 2; fewer objects sorted: 1; failed: 1; ended as FAULT: 0; "
        "fault did not occur: 1; wrong: 1",
        "  failures: Release.stuck 1",
        "  runs with a problem: 1",
        "    fault 6: object taken, late: from 8.00 s on",
        "      FAILURE Release.stuck at tree/Release: it hangs",
        "      wrong: the arm is not at rest",
        "  failed with another reason than the injected fault should cause:",
        "    it says Release.stuck: fault 6",
        "  branches after a failure: 1 of 2 entered",
        "    never entered: sort.yaml:14: recover",
    ]


def test_pairs_have_no_matrix_a_campaign_cut_short_says_so_and_one_run_is_a_few_lines() -> None:
    assert list(list_trial_lines(NOWHERE)) == [
        "fault 1+5: tree/Grasp missed, first: nothing seals; and tree/Wait raises, first: nothing seals",
        "  one of the faults did not occur",
        "  SUCCESS",
    ]
    alone = replace(NOWHERE, faults={1: MISS})
    lines = ["fault 1: tree/Grasp missed, first: nothing seals", "  the fault did not occur", "  SUCCESS"]
    assert list(list_trial_lines(alone)) == lines
    pairs = replace(FIGURES, has_pairs=True, is_complete=False, trials=(NOWHERE,))
    assert list(list_result_lines(pairs))[:3] == [
        "sort (fake), seed 3: 1 runs with pairs of faults; a run without faults takes 11.5 s",
        "  ended by the user before the last run",
        "  as without faults: 0; fewer objects sorted: 0; failed: 0; ended as FAULT: 0; "
        "fault did not occur: 1; wrong: 0",
    ]


def test_as_plain_values_nothing_is_left_out() -> None:
    plain = results_to_json(FIGURES)
    assert (plain["runs"], plain["failed"], plain["listed"], plain["complete"]) == (6, 1, 6, True)
    assert [trial["verdict"] for trial in plain["trials"]] == [
        "ok", "ok -3", "ok", "FAILURE Release.stuck", "-", "!!",
    ]  # fmt: skip
    assert plain["trials"][4]["fault"] == "1+5"
    assert plain["branches"][1] == {"place": "sort.yaml:14", "what": "recover", "entered": 0}
