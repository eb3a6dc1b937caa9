"""When things happen: while a node runs, at a time, now and then."""

from __future__ import annotations

import math
import pickle
from collections.abc import Sequence

import pytest

from executive.errors import InputError
from executive.testing.disturbances import (
    Disturbance,
    after,
    arm_runs_into,
    between,
    detector_dead,
    detector_hangs,
    detector_slow,
    during,
    object_moved,
    object_removed,
    seal_breaks,
    seal_fails,
    with_probability,
)
from executive.testing.disturbances.script import DuringNode
from executive.testing.run_mission import MissionResult, run_mission

SLIPS = seal_fails()


def sorted_with(*script: Disturbance) -> MissionResult:
    return run_mission("sort_overhead", disturbances=script)


def slipped(result: MissionResult) -> list[int]:
    """Return which grasps missed, counted from 1."""
    grasps = [
        event.data["status"]
        for event in result.events
        if event.kind == "status" and event.data["node"].endswith("/Grasp")
    ]
    ends = [status for status in grasps if status != "RUNNING"]
    return [number for number, status in enumerate(ends, start=1) if status == "FAILURE"]


@pytest.mark.parametrize(("nth", "missed"), [(2, [2]), ((1, 3), [1, 3]), ((), [1, 2, 3])])
def test_it_happens_in_the_activations_it_is_meant_for(nth: int | Sequence[int], missed: list[int]) -> None:
    result = sorted_with(during("*/Grasp", SLIPS, nth=nth))
    assert slipped(result)[: len(missed)] == missed
    assert len(slipped(result)) == len(missed) or nth == ()
    assert len(result.disturbances()) == len(slipped(result))
    assert result.agrees


def test_two_disturbances_of_one_kind_end_each_at_its_own_time() -> None:
    result = sorted_with(
        during("*/Grasp", SLIPS, nth=1), during("tree/2:repeat", SLIPS, nth=2), between(0, 5, SLIPS)
    )
    assert result.reasons("*/Grasp")[0] == "missed"
    missed = [e.clock for e in result.events if e.data.get("reason") == "missed"]
    assert all(clock < 5.2 for clock in missed)
    assert len(missed) >= 2, "the end of the first grasp does not end what lasts until 5 s"
    assert (result.status, result.agrees) == ("SUCCESS", True)


def test_it_lasts_from_one_time_until_before_another() -> None:
    result = sorted_with(between(2.0, 6.0, detector_dead()))
    times = [e.clock for e in result.events if e.kind == "disturbance"]
    assert times
    assert 2.0 <= min(times) <= max(times) < 6.0
    assert max(event.clock for event in result.events) > 6.0


def test_after_a_time_it_lasts_until_the_end() -> None:
    result = sorted_with(after(3.0, seal_fails()))
    assert result.status == "SUCCESS"
    closed = [e.clock for e in result.events if e.kind == "intent" and e.data["action"] == "close"]
    told = [e.clock for e in result.events if e.kind == "disturbance"]
    assert told == [clock for clock in closed if clock >= 3.0]
    assert result.items["rejected"] == result.audit["left"] > 0  # type: ignore[index]


def test_by_chance_it_happens_now_and_then_and_the_same_seed_always_the_same() -> None:
    def story(seed: int) -> list[int]:
        return slipped(sorted_with(with_probability(0.4, "*/Grasp", SLIPS, seed=seed)))

    stories = [story(seed) for seed in range(3)]
    assert stories[0] == story(0)
    assert len({tuple(story) for story in stories}) == 3


@pytest.mark.parametrize("probability", [0.0, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("seed", range(5))
def test_a_chance_is_met_as_often_as_it_says(probability: float, seed: int) -> None:
    when = with_probability(probability, "*", SLIPS, seed=seed).when
    assert isinstance(when, DuringNode)
    share = sum(when.chosen(number) for number in range(1, 401)) / 400
    # Four standard deviations.
    assert abs(share - probability) <= 4 * math.sqrt(probability * (1 - probability) / 400)


def test_every_time_it_acts_the_run_is_told_what_where_and_on_which_object() -> None:
    result = sorted_with(during("*/Transit", seal_breaks(), nth=1))
    (told,) = result.disturbances()
    assert told["what"] == "seal_breaks"
    assert told["node"].endswith("/Transit")
    assert told["item"].startswith(f"{told['object']}-")
    assert len(told["position"]) == 3
    (event,) = (event for event in result.events if event.kind == "disturbance")
    dropped = next(e for e in result.events if e.data.get("reason") == "dropped")
    assert 0 <= dropped.tick - event.tick <= 2


def test_a_script_that_does_not_come_to_act_tells_nothing() -> None:
    assert sorted_with(between(500.0, 600.0, seal_fails())).disturbances() == []
    assert sorted_with(during("*/PutDown", seal_breaks())).disturbances() == []


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: during("*", SLIPS, nth=0), "activations are counted from 1, and nth is 0"),
        (lambda: between(5, 5, SLIPS), "from some time until a later one, not from 5 s to 5 s"),
        (lambda: after(-1, SLIPS), "not from -1 s to inf s"),
        (lambda: with_probability(1.5, "*", SLIPS, seed=0), "a probability is 0 to 1, not 1.5"),
        (lambda: seal_breaks(1.0), "a share of a motion is more than 0 and less than 1, not 1"),
        (lambda: arm_runs_into(share=0.0), "a share of a motion is more than 0 and less than 1, not 0"),
        (lambda: object_removed(share=1.0), "a share of a motion is more than 0 and less than 1, not 1"),
        (lambda: object_removed(0), "objects are counted from 1, and which is 0"),
        (lambda: object_moved((0.1, 0.0), -1), "objects are counted from 1, and which is -1"),
        (lambda: detector_slow(-0.5), "a slow detector answers later, not by -0.5 s"),
    ],
)
def test_a_script_that_makes_no_sense_is_refused(make, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        make()


def test_a_script_is_a_value_that_can_be_sent_to_another_process_and_used_again() -> None:
    script = [
        during("*/Grasp", SLIPS, nth=2),
        between(4.0, 9.0, detector_hangs()),
        after(1.0, object_moved((0.1, 0))),
    ]
    assert pickle.loads(pickle.dumps(script)) == script
    assert slipped(sorted_with(script[0])) == slipped(sorted_with(script[0])) == [2]
