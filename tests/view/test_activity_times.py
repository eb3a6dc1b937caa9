"""Where the time of a run went: all of it, and to the right object."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from made_up_runs import TREE, ran

from executive.mission.outline import OutlineNode
from executive.record.timeline import Activation, Timeline
from executive.view.report import FAILED_ATTEMPTS, LOOK, NO_ITEM, WAITING, TimesByItem, compute_activity_times


def times_of(
    course: list[Activation], nodes: Sequence[OutlineNode], decisions: list[tuple[float, str]], end: float
) -> tuple[tuple[str, ...], TimesByItem]:
    """Return activities, and times of activations and selections up to a time."""
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
    activities, times = times_of(course, TREE, [(1.1, "cube-1"), (2.3, "cube-1"), (4.1, "duck-1")], 8.5)
    assert list(times) == ["cube-1", "duck-1", NO_ITEM]
    assert times["cube-1"] == near(
        {LOOK: 1.1, FAILED_ATTEMPTS: 1.2, "approach": 0.7, "grasp": 0.1, "transit": 1.9, "release": 0.1}
    )
    assert times["duck-1"] == near({"approach": 0.9, "grasp": 0.1, "transit": 0.9, "release": 0.1})
    assert times[NO_ITEM] == near({WAITING: 1.3, LOOK: 0.1})
    assert activities == (LOOK, "approach", "grasp", "transit", "release", FAILED_ATTEMPTS, WAITING)


@pytest.mark.parametrize(
    ("course", "decisions", "end", "expected"),
    [
        # The first started skill that works on an object determines the object.
        ([ran("Wait", 0.0, 4.0), ran("Transit", 1.0, 3.0, "cube-1"), ran("Approach", 2.0, 4.0, "duck-1")],
         [(1.0, "cube-1"), (2.0, "duck-1")], 4.0,
         {"cube-1": {WAITING: 1.0, "transit": 2.0}, "duck-1": {"approach": 1.0}}),
        # The time after the last skill belongs to the run.
        ([ran("Transit", 1.0, 2.0, "cube-1", "INVALID")], [(1.0, "cube-1")], 2.4,
         {"cube-1": {WAITING: 1.0, "transit": 1.0}, NO_ITEM: {WAITING: 0.4}}),
    ],
)  # fmt: skip
def test_time_belongs_to_an_object_or_to_the_run(course, decisions, end, expected):
    _, times = times_of(course, TREE, decisions, end)
    assert times == {item: near(row) for item, row in expected.items()}
