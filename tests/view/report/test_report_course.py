"""What a journal tells of every node, and what becomes of it where the record has no end."""

from __future__ import annotations

from made_up_runs import told

from executive.view.report.course import Span, by_node, counts, last_failure, spans


def test_every_time_that_a_node_ran_is_told_in_the_order_in_which_they_began():
    course = spans([
        told(0.0, "tree", "RUNNING"),
        told(0.1, "tree/Detect", "RUNNING"), told(0.3, "tree/Detect", "SUCCESS"),
        told(0.4, "tree/Detect", "RUNNING"),
        told(0.5, "tree/Detect", "FAILURE", reason="unsure", message="too dark"),
        told(0.5, "tree", "FAILURE", reason="Detect.unsure", message="too dark"),
    ])  # fmt: skip
    assert course == [
        Span("tree", 0.0, 0.5, "FAILURE", "Detect.unsure", "too dark"),
        Span("tree/Detect", 0.1, 0.3, "SUCCESS"),
        Span("tree/Detect", 0.4, 0.5, "FAILURE", "unsure", "too dark"),
    ]


def test_what_a_skill_was_about_may_be_known_at_its_start_or_only_at_its_end():
    course = spans([
        told(0.0, "tree/Approach", "RUNNING", item="cube-1"), told(0.1, "tree/Approach", "SUCCESS", item=""),
        told(0.1, "tree/SelectTarget", "RUNNING", item=None),
        told(0.1, "tree/SelectTarget", "SUCCESS", item="duck-1"),
    ])  # fmt: skip
    assert [span.item for span in course] == ["cube-1", "duck-1"]
    # An end without a beginning is nothing that ran.
    assert spans([told(0.2, "tree/Detect", "SUCCESS")]) == spans([]) == []


def test_what_was_under_way_when_the_record_ends_ran_until_then():
    course = spans([
        told(0.0, "tree", "RUNNING"), told(1.0, "tree/Transit", "RUNNING", item="cube-1"),
        {"tick": 600, "clock": 2.5, "kind": "sense", "name": "arm.q", "value": []},
    ])  # fmt: skip
    assert course == [
        Span("tree", 0.0, 2.5, "RUNNING"), Span("tree/Transit", 1.0, 2.5, "RUNNING", item="cube-1"),
    ]  # fmt: skip


def test_what_begins_anew_after_a_cut_was_halted_by_it():
    course = spans([
        told(1.0, "tree/Transit", "RUNNING", item="cube-1"),
        {"tick": 360, "clock": 1.5, "kind": "resume"},
        told(1.5, "tree/Transit", "RUNNING", item="cube-1"), told(3.0, "tree/Transit", "SUCCESS"),
    ])  # fmt: skip
    assert [(span.began, span.ended, span.status) for span in course] == [
        (1.0, 1.5, "INVALID"), (1.5, 3.0, "SUCCESS"),
    ]  # fmt: skip


def test_a_tally_counts_the_ends_of_a_node_and_keeps_its_last_failure():
    course = spans([
        told(0.0, "tree/Grasp", "RUNNING"), told(0.1, "tree/Grasp", "FAILURE", reason="missed"),
        told(0.2, "tree/Grasp", "RUNNING"), told(0.3, "tree/Grasp", "FAILURE", reason="blocked", message=""),
        told(0.4, "tree/Grasp", "RUNNING"), told(0.5, "tree/Grasp", "INVALID"),
        told(0.6, "tree/Grasp", "RUNNING"), told(0.7, "tree/Grasp", "SUCCESS"),
        told(0.8, "tree/Wait", "RUNNING"),
    ])  # fmt: skip
    grasp, wait = by_node(course).values()
    assert (counts(grasp), last_failure(grasp)) == ("1 done, 2 failed, 1 halted", "blocked")
    assert (counts(wait), last_failure(wait)) == ("1 under way", "")
