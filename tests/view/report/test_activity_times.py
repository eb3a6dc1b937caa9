"""Where the time of a run went: all of it, and to the right object."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_runs import TREE, ran, skill

from executive.mission.outline import OutlineNode
from executive.record.timeline.activation import Activation
from executive.record.timeline.timeline import Timeline
from executive.view.report.activity_times import (
    FAILED_ATTEMPTS,
    LOOK,
    NO_ITEM,
    WAITING,
    ActivityTimes,
    compute_activity_times,
)

ITEMS = ("cube-1", "duck-1", "big_duck-2")


def times_of(
    course: list[Activation], nodes: Sequence[OutlineNode], decisions: list[tuple[float, str]], end: float
) -> ActivityTimes:
    """Return the times of activations and selections up to a time."""
    return compute_activity_times(Timeline(activations=course, selection_times=decisions, clock=end), nodes)


def near(row: dict[str, float]) -> object:
    return pytest.approx(row, abs=1e-9)


def test_a_failed_attempt_a_look_ahead_and_a_wait_are_distinguished():
    course = [
        ran("MoveToScan", 0.0, 1.0), ran("Detect", 1.0, 1.1), ran("SelectTarget", 1.1, 1.1, "cube-1"),
        ran("Approach", 1.1, 2.0, "cube-1"), ran("Grasp", 2.0, 2.2, "cube-1", "FAILURE"),
        ran("Detect", 2.2, 2.3),
        ran("Approach", 2.3, 3.0, "cube-1"), ran("Grasp", 3.0, 3.1, "cube-1"),
        ran("Transit", 3.1, 5.0, "cube-1"), ran("Detect", 4.0, 4.1), ran("Release", 5.0, 5.1, "cube-1"),
        ran("Approach", 5.1, 6.0, "duck-1"), ran("Grasp", 6.0, 6.1, "duck-1"),
        ran("Transit", 6.1, 7.0, "duck-1"), ran("Release", 7.0, 7.1, "duck-1"),
        ran("Wait", 7.1, 8.1), ran("Detect", 8.1, 8.2),
    ]  # fmt: skip
    times = times_of(course, TREE, [(1.1, "cube-1"), (2.3, "cube-1"), (4.1, "duck-1")], 8.5)
    assert list(times.times_by_item) == ["cube-1", "duck-1", NO_ITEM]
    assert times.times_by_item["cube-1"] == near(
        {LOOK: 1.1, FAILED_ATTEMPTS: 1.2, "approach": 0.7, "grasp": 0.1, "transit": 1.9, "release": 0.1}
    )
    assert times.times_by_item["duck-1"] == near(
        {"approach": 0.9, "grasp": 0.1, "transit": 0.9, "release": 0.1}
    )
    assert times.times_by_item[NO_ITEM] == near({WAITING: 1.3, LOOK: 0.1})
    assert times.activities == (LOOK, "approach", "grasp", "transit", "release", FAILED_ATTEMPTS, WAITING)


def test_what_runs_at_the_same_time_is_the_time_of_what_began_first_and_is_about_an_object():
    course = [
        ran("Wait", 0.0, 4.0), ran("Transit", 1.0, 3.0, "cube-1"), ran("Approach", 2.0, 4.0, "duck-1"),
    ]  # fmt: skip
    times = times_of(course, TREE, [(1.0, "cube-1"), (2.0, "duck-1")], 4.0)
    assert times.times_by_item["cube-1"] == near({WAITING: 1.0, "transit": 2.0})
    assert times.times_by_item["duck-1"] == near({"approach": 1.0})


def test_an_attempt_that_was_the_last_was_in_vain_up_to_its_end():
    course = [
        ran("Approach", 0.5, 1.0, "cube-1"), ran("Grasp", 1.0, 1.2, "cube-1", "FAILURE"),
        ran("Detect", 1.2, 1.3),
    ]  # fmt: skip
    times = times_of(course, TREE, [(0.5, "cube-1")], 1.3)
    assert times.times_by_item == {
        "cube-1": near({WAITING: 0.5, FAILED_ATTEMPTS: 0.7}), NO_ITEM: near({LOOK: 0.1}),
    }  # fmt: skip


def test_the_time_before_the_first_skill_and_after_the_last_belongs_to_the_run():
    times = times_of([ran("Transit", 1.0, 2.0, "cube-1", "INVALID")], TREE, [(1.0, "cube-1")], 2.4)
    assert times.times_by_item == {
        "cube-1": near({WAITING: 1.0, "transit": 1.0}),
        NO_ITEM: near({WAITING: 0.4}),
    }


def test_a_skill_that_is_called_like_another_activity_has_no_column_of_its_own():
    tree = [*TREE, skill("Look", "arm")]
    times = times_of([ran("Look", 0.0, 1.0, "cube-1"), ran("Detect", 1.0, 2.0)], tree, [], 2.0)
    assert times.activities == (LOOK,)
    assert times.times_by_item == {"cube-1": near({LOOK: 1.0}), NO_ITEM: near({LOOK: 1.0})}


TIMES = st.integers(0, 240).map(lambda ticks: ticks / 24)


@st.composite
def spans(draw: st.DrawFn) -> Activation:
    began, ended = sorted((draw(TIMES), draw(TIMES)))
    name = draw(st.sampled_from([node.name for node in TREE[1:]]))
    item = draw(st.sampled_from(["", *ITEMS]))
    return ran(name, began, ended, item, draw(st.sampled_from(["SUCCESS", "FAILURE", "INVALID", "RUNNING"])))


@given(
    course=st.lists(spans(), max_size=14),
    decisions=st.lists(st.tuples(TIMES, st.sampled_from(ITEMS)), max_size=6).map(sorted),
    after=st.sampled_from([0.0, 0.5]),
)
def test_every_instant_belongs_to_one_object_and_one_activity(course, decisions, after):
    course.sort(key=lambda span: span.start)
    end = max((span.end for span in course), default=0.0) + after
    times = times_of(course, TREE, decisions, end)
    spent = [seconds for row in times.times_by_item.values() for seconds in row.values()]
    assert sum(spent) == pytest.approx(end)
    assert all(seconds > 0 for seconds in spent)
    assert list(times.activities) == list(dict.fromkeys(times.activities))
    assert {activity for row in times.times_by_item.values() for activity in row} == set(times.activities)
    assert NO_ITEM not in list(times.times_by_item)[:-1]
    for item, row in times.times_by_item.items():
        # Nobody's time is spent on an object that was never decided for nor handled.
        assert item == NO_ITEM or item in {span.item for span in course} | {name for _, name in decisions}
        has_failure = any(span.item == item and span.status == "FAILURE" for span in course)
        assert FAILED_ATTEMPTS not in row or has_failure
