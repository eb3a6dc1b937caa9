"""Items on the table: identity, staleness, doubt, and the accounts at the end of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from ledger_bench import EYE, Bench, Thing

from executive.cell.frame import ErrorRates, assume_rates
from executive.cell.objects import ObjectClass, Target
from executive.cell.tools import ToolMeasurement
from executive.errors import Fault
from executive.events import DetectedObject, FrameSearched, ItemChanged

CUBE: Thing = ("cube", 0.5, 0.0)
FAR: Thing = ("cube", 0.6, 0.2)
LEFT = ("skipped", "the mission was completed without it")
PHANTOM = ("phantom", "more looks missed it than saw it")
LOST = ("lost", "known to exist, not found again")


def names(targets: list[Target]) -> list[str]:
    return [target.item for target in targets]


def test_two_close_objects_stay_two_items_whatever_the_order_of_detections(bench: Bench) -> None:
    bench.look(CUBE, ("cube", 0.55, 0.0))
    first, second = bench.look(("cube", 0.551, 0.0), ("cube", 0.501, 0.0))
    assert (first.item, second.item) == ("cube-1", "cube-2")
    assert first.position[0] == pytest.approx(0.5005), "the mean of both looks"
    assert (first.label, first.confidence, first.frame, first.stamp) == ("cube", 0.9, 2, 2.0)


def test_the_class_is_evidence_and_not_identity(bench: Bench) -> None:
    bench.look(CUBE)
    bench.look(CUBE)
    target = bench.look(("duck", 0.5, 0.0))[0]
    assert (target.item, target.label) == ("cube-1", "cube"), "two votes against one"
    bench.ledger.record_failed_pick("cube-1")
    assert names(bench.look(("duck", 0.505, 0.0))) == ["cube-1"]


@pytest.mark.parametrize(
    ("event", "far_is_fresh"),
    [("record_grasp", True), ("record_failed_pick", False), ("invalidate_positions", False)],
)
def test_what_the_robot_does_puts_places_in_doubt(bench: Bench, event: str, far_is_fresh: bool) -> None:
    near, far = bench.look(CUBE, FAR)
    assert bench.ledger.is_fresh(near)
    getattr(bench.ledger, event)(*(() if event == "invalidate_positions" else ("cube-1",)))
    assert not bench.ledger.is_fresh(near)
    assert bench.ledger.is_fresh(far) is far_is_fresh
    assert bench.ledger.describe("cube-1").attempts == (event == "record_failed_pick")


def test_a_pick_puts_in_doubt_what_is_nearer_than_seven_centimetres(bench: Bench) -> None:
    _, near, far = bench.look(CUBE, ("cube", 0.569, 0.0), ("cube", 0.5, 0.071))
    bench.ledger.record_grasp("cube-1")
    assert [bench.ledger.is_fresh(target) for target in (near, far)] == [False, True]


def test_an_empty_table_needs_looks_that_agree_since_the_last_change(bench: Bench) -> None:
    bench.look(CUBE)
    bench.ledger.record_grasp("cube-1")
    for _ in range(3):
        bench.look(view="full", change_count=0)  # frames from before the change say nothing
    bench.look(view="full")
    assert not bench.ledger.is_table_empty()
    bench.ledger.record_placement("cube-1", "red_bin")
    bench.frames -= 1
    bench.look(view="full")
    assert not bench.ledger.is_table_empty(), "the same frame is no second look"
    bench.look(view="full")
    assert bench.ledger.is_table_empty()


def test_objects_that_the_mission_has_no_route_for_are_nothing_left_to_sort(bench: Bench) -> None:
    for _ in range(2):
        bench.look(("duck", 0.50, 0.0), view="full")
    assert bench.ledger.is_table_empty()
    assert bench.end() == {"duck-1": ("skipped", "the mission has no route for it")}


@pytest.mark.parametrize(
    ("completed", "attempts", "final"), [(True, 0, "skipped"), (True, 1, "rejected"), (False, 0, "rejected")]
)
def test_an_item_is_skipped_only_if_the_mission_was_completed_without_an_attempt_at_it(
    bench: Bench, completed: bool, attempts: int, final: str
) -> None:
    for _ in range(2):
        bench.look(CUBE)
    for _ in range(attempts):
        bench.ledger.record_failed_pick("cube-1")
    assert bench.end(completed=completed)["cube-1"][0] == final


def test_an_item_that_was_still_in_doubt_or_contradicted_is_not_skipped(bench: Bench) -> None:
    bench.look(CUBE, FAR)
    bench.look(("duck", 0.5, 0.0), FAR)  # a contradiction about the class of the first
    bench.ledger.record_measurement("cube-2", ToolMeasurement("it was touched 60 mm above the table"))
    assert {state for state, _ in bench.end().values()} == {"rejected"}


def test_three_looks_that_contradict_the_class_of_an_item_reject_it(bench: Bench) -> None:
    for _ in range(3):
        assert bench.states().get("cube-1", ("seen", ""))[0] == "seen"
        bench.look(unsure=[CUBE], contradiction="its box is 80 mm long")
    assert bench.states() == {"cube-1": ("rejected", "it has no confident detection: its box is 80 mm long")}


@pytest.mark.parametrize(
    ("looks", "misses", "rejected", "final"),
    [
        (1, 0, False, LEFT),
        (1, 2, False, PHANTOM),
        (2, 0, False, LEFT),
        (2, 2, False, LOST),
        (2, 1, True, ("rejected", "slippery")),
    ],
)
def test_what_looks_agree_on_decides_what_becomes_of_an_item(
    bench: Bench, looks: int, misses: int, rejected: bool, final: tuple[str, str]
) -> None:
    for _ in range(looks):
        bench.look(CUBE)
    if rejected:
        bench.ledger.reject("cube-1", "slippery")
    for _ in range(misses):
        bench.look(view="full")
    assert bench.end() == {"cube-1": final}
    counts = {"placed": 0, "rejected": 0, "skipped": 0, "lost": 0, "phantom": 0, final[0]: 1}
    assert bench.ledger.count_states() == {"seen": int(final != PHANTOM), **counts}


@pytest.mark.parametrize(
    ("look_count", "final", "is_named"), [(1, "phantom", True), (3, "phantom", True), (4, "lost", False)]
)
def test_an_item_that_was_seen_and_then_missed_was_taken_away_or_is_named(
    bench: Bench, look_count: int, final: str, is_named: bool
) -> None:
    rates = replace(EYE, false_detections=0.015, repeated=0.6)
    for _ in range(look_count):
        bench.look(CUBE, by=rates)
    for _ in range(2):
        bench.look(by=rates)
    assert bench.end()["cube-1"][0] == final
    assert len(bench.ledger.unexplained.events) == is_named


def test_an_item_that_flickers_never_existed(bench: Bench) -> None:
    for things in [(CUBE,), (), (CUBE,), (), ()]:
        bench.look(*things, by=replace(EYE, repeated=0.6))
    assert (bench.end()["cube-1"], bench.ledger.unexplained.events) == (PHANTOM, [])


@pytest.mark.parametrize(("distance", "item_count"), [(0.017, 2), (0.005, 1)])
def test_two_detections_in_one_frame_are_two_objects_unless_their_positions_agree(
    bench: Bench, distance: float, item_count: int
) -> None:
    for _ in range(3):
        targets = bench.look(CUBE, ("cube", 0.5 + distance, 0.0))
    assert len(targets) == item_count


def test_an_item_that_is_given_up_in_the_tool_stays_there_until_it_is_released(bench: Bench) -> None:
    bench.look(CUBE)
    bench.ledger.record_grasp("cube-1")
    bench.ledger.reject("cube-1", "slippery")
    assert bench.ledger.find_held_item() == "cube-1"
    bench.ledger.record_placement("cube-1", "red_bin")
    (row,) = bench.ledger.list_items()
    assert (row.state, row.bin, row.reason) == ("placed", "red_bin", "")


def test_the_tool_holds_one_item_at_a_time(bench: Bench) -> None:
    bench.look(CUBE, ("duck", 0.6, 0.1))
    assert bench.ledger.find_held_item() is None
    bench.ledger.record_grasp("cube-1")
    bench.ledger.record_grasp("cube-1")
    with pytest.raises(Fault, match="the tool cannot hold duck-1: it holds cube-1; the skill"):
        bench.ledger.record_grasp("duck-1")
    bench.ledger.record_drop("cube-1")
    bench.ledger.record_grasp("duck-1")
    assert bench.ledger.find_held_item() == "duck-1"
    assert bench.end()["duck-1"] == ("rejected", "still in the tool when the run ended")


def test_an_item_whose_class_looks_keep_contradicting_is_given_up_in_the_end(bench: Bench) -> None:
    for look in range(60):
        bench.look(("cube" if look % 2 else "duck", 0.50, 0.0))
        assert look <= 2 or not bench.ledger.is_certain("duck-1")
    assert bench.states() == {"duck-1": ("rejected", "looks disagree about its class: 20 duck, 20 cube")}


UNMEASURED = replace(assume_rates(0.5, "never measured"), repeated=0.0)


def test_a_dropped_item_keeps_its_identity_before_looks_prove_its_class_again(bench: Bench) -> None:
    for attempts in range(1, 4):
        for _ in range(4):
            bench.look(CUBE, by=UNMEASURED)
        bench.drop("cube-1")
        bench.look(CUBE, by=UNMEASURED)
        known = bench.ledger.describe("cube-1")
        assert (known.state, known.attempts, known.drops) == ("open", attempts, attempts)
        assert not bench.ledger.is_certain("cube-1"), "another object may lie there"
    assert bench.ledger.count_states()["seen"] == 1


def test_attempts_count_for_an_object_also_if_another_object_takes_its_item(bench: Bench) -> None:
    bench.look(CUBE)
    bench.ledger.record_failed_pick("cube-1")
    bench.look(("cube", 0.60, 0.15))
    bench.look(CUBE, ("cube", 0.60, 0.15))
    assert [bench.ledger.describe(item).attempts for item in ("cube-1", "cube-3")] == [1, 1]
    bench.place("cube-3")
    bench.look(CUBE, ("cube", 0.60, 0.15))
    assert bench.ledger.describe("cube-4").attempts == 0, "it lay below the placed object"


def test_what_is_believed_on_the_table_stands_there_given_up_or_not(bench: Bench) -> None:
    for _ in range(2):
        bench.look(CUBE, ("cube", 0.60, 0.1), ("duck", 0.6, -0.1))
    bench.ledger.reject("cube-2", "slippery")
    assert names(bench.ledger.find_objects_on_table()) == ["cube-1", "cube-2", "duck-1"]
    assert bench.ledger.find_objects_on_table()[2].position[:2] == pytest.approx([0.6, -0.1])
    for change in (bench.ledger.record_grasp, bench.ledger.record_drop):
        change("cube-1")
        assert names(bench.ledger.find_objects_on_table()) == ["cube-2", "duck-1"]
    bench.look(("cube", 0.45, 0.1), ("cube", 0.60, 0.1))
    assert "cube-1" in names(bench.ledger.find_objects_on_table())
    bench.ledger.record_placement("cube-1", "red_bin")
    assert "cube-1" not in names(bench.ledger.find_objects_on_table())


def test_what_the_arm_ran_into_stands_on_the_table_for_five_looks() -> None:
    bench = Bench({"cube": ObjectClass("cube", 0.05, 0.0354)})
    bench.look(("cube", 0.5, 0.0))
    for place in [(0.53, 0, 0.05), (0.5, 0, 0.2), (0.6, 0.1, 0.2), (0.6, 0.12, 0.2), (0.2, -0.3, 0.06)]:
        bench.ledger.record_collision(place)
    for _ in range(5):
        bodies = [each.position.tolist() for each in bench.ledger.find_objects_on_table() if not each.label]
        assert bodies == [[0.6, 0.12, 0.2], [0.5, 0, 0.2]], "once, and neither at an item nor at a bin"
        bench.look(("cube", 0.5, 0.0))
    assert names(bench.ledger.find_objects_on_table()) == ["cube-1"]


def test_an_ignored_object_stands_on_the_table_as_long_as_looks_show_it(bench: Bench) -> None:
    bench.ledger.foreign.ignored_labels = ("banana",)
    for _ in range(6):
        bench.look(("banana", 0.5, 0.0), ("banana", 0.5, 0.5), ("banana", 0.62, 0.0), ("cube", 0.6, 0.0))
        shown = [(each.label, round(each.position[1], 2)) for each in bench.ledger.find_objects_on_table()]
        assert shown == [("cube", 0.0), ("", 0.0)], "neither at an item nor beside the workspace"


def test_what_is_put_down_stands_there_and_waits_for_a_look(bench: Bench) -> None:
    bench.look(CUBE)
    bench.ledger.record_grasp("cube-1")
    bench.ledger.record_put_down("cube-1", np.array((0.6, 0.2, 0.025)))
    (target,) = bench.ledger.find_objects_on_table()
    assert (target.item, target.position.tolist()) == ("cube-1", [0.6, 0.2, 0.025])
    assert not bench.ledger.is_fresh(target)
    assert bench.ledger.find_uncertain_items() == ["cube-1"]
    assert names(bench.look(("cube", 0.603, 0.198))) == ["cube-1"]
    assert bench.end() == {"cube-1": LEFT}


@pytest.mark.parametrize(
    ("thing", "states"),
    [
        (("cube", 0.56, 0.0), {"cube-1": ("seen", ""), "cube-2": ("phantom", "it is cube-1")}),
        (("duck", 0.56, 0.0), {"cube-1": ("seen", ""), "duck-1": ("seen", "")}),
        (("cube", 0.64, 0.0), {"cube-1": ("seen", ""), "cube-2": ("seen", "")}),
    ],
    ids=["pushed aside", "another class", "too far away to be pushed"],
)
def test_what_turns_up_near_by_is_the_same_item_if_somebody_may_have_pushed_it(
    bench: Bench, thing: Thing, states: dict[str, tuple[str, str]]
) -> None:
    for place in (CUBE, thing):
        for _ in range(3):
            bench.look(place)
    assert bench.states() == states


@pytest.mark.parametrize(
    ("probes", "touches_other", "moved", "final"),
    [
        (3, True, 0.0, ("phantom", "the tool found only the table at its position, 3 times")),
        (2, True, 0.0, ("rejected", "could not be picked")),
        (3, False, 0.0, ("rejected", "could not be picked")),
        (3, True, 0.02, ("rejected", "could not be picked")),
    ],
    ids=["three probes", "two probes", "no touch of another item", "it moved"],
)
def test_an_item_is_a_phantom_if_the_tool_found_only_the_table_there_three_times(
    bench: Bench, probes: int, touches_other: bool, moved: float, final: tuple[str, str]
) -> None:
    for number in range(probes):
        bench.look(("cube", 0.5 + (moved if number == probes - 1 else 0.0), 0.0), FAR)
        bench.ledger.record_failed_pick("cube-1", found_table=True)
    bench.look(("cube", 0.5 + moved, 0.0), FAR)
    if touches_other:
        bench.ledger.record_measurement("cube-2", ToolMeasurement())
    bench.ledger.reject("cube-1", "could not be picked")
    assert bench.end()["cube-1"] == final


def put_away(bench: Bench, *still_there: Thing) -> None:
    """Look until the items that are not still there count as gone, and at what is still there."""
    for _ in range(4):
        bench.look(*still_there, view="full")


@pytest.mark.parametrize("label", ["cube", "duck"])
def test_a_lost_item_that_somebody_carried_across_the_table_is_the_one_that_appeared_there(
    bench: Bench, label: str
) -> None:
    for _ in range(2):
        bench.look(CUBE, view="full")
    put_away(bench)
    put_away(bench, (label, 0.5, 0.2))
    final = bench.end()["cube-1"]
    assert final == (("phantom", "it is cube-2") if label == "cube" else LOST)


def test_an_item_that_appeared_while_the_tool_held_another_does_not_explain_its_loss(bench: Bench) -> None:
    for _ in range(2):
        bench.look(CUBE, view="full")
    put_away(bench, CUBE)
    bench.ledger.record_grasp("cube-1")
    put_away(bench, FAR)
    bench.drop("cube-1")
    bench.place("cube-2")
    put_away(bench)
    assert bench.end()["cube-1"] == LOST


def test_an_item_first_seen_where_nobody_had_looked_explains_no_lost_item(bench: Bench) -> None:
    behind_arm = slice(0, 280)
    for things in ([CUBE], []):
        for _ in range(2):
            bench.look(*things, view="full", hidden=behind_arm)
    for _ in range(2):
        bench.look(("cube", 0.53, 0.18), view="full")
    assert bench.end() == {"cube-1": LOST, "cube-2": LEFT}


@pytest.mark.parametrize(
    ("touches", "answers"), [(["low", "low"], [True, False]), (["low", "", "low", "low"], [True] * 4)]
)
def test_a_touch_may_miss_the_top_once_and_later_an_object_may_lie_on_its_side(
    bench: Bench, touches: list[str], answers: list[bool]
) -> None:
    bench.look(CUBE)
    measurements = [ToolMeasurement(touch, may_be_wrong=True) for touch in touches]
    found = [bench.ledger.record_measurement("cube-1", measurement) for measurement in measurements]
    assert found == answers


def test_what_is_likelier_an_invention_or_gone_stands_nowhere(bench: Bench) -> None:
    wild = ErrorRates(threshold=0.5, miss_rate=0.5, confusion_rate=0.004, false_detections=3.0, jitter=1.0)
    bench.look(CUBE, by=wild)
    bench.look(by=wild)
    for shown, standing in ([("duck", 0.60, 0.1)], ["duck-1"]), ([], ["duck-1"]), ([], []):
        bench.look(*shown)
        assert names(bench.ledger.find_objects_on_table()) == standing


def test_every_change_is_reported(bench: Bench) -> None:
    bench.look(CUBE)
    bench.look(CUBE, view="full")
    bench.place("cube-1")
    changes = [event for event in bench.events if isinstance(event, ItemChanged)]
    assert [change.state for change in changes] == ["seen", "seen", "held", "placed"]
    assert changes[-1] == ItemChanged("cube-1", "cube", "placed", [0.5, 0.0, 0.025], 2, 0, "red_bin", "")
    seen = DetectedObject("cube", 0.9, [0.0, 0.0, 1.0, 1.0], [0.5, 0.0, 0.025], "")
    looks = [event for event in bench.events if isinstance(event, FrameSearched)]
    assert looks[-1] == FrameSearched(2, "camera", "eye", "full", [seen], [], [])
