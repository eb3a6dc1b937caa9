from __future__ import annotations

import numpy as np
import pytest
from ledger_bench import Bench

from executive.errors import Fault
from executive.messages import Reliability


def test_an_object_seen_twice_is_one_item(bench: Bench) -> None:
    bench.look(("cube", 0.5, 0.0))
    assert [t.item for t in bench.look(("cube", 0.503, 0.002))] == ["cube-1"]
    assert bench.ledger.balance()["seen"] == 1


def test_two_close_objects_stay_two_items_whatever_the_order_of_detections(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0), ("cube", 0.55, 0.0))
    first, second = bench.look(("cube", 0.551, 0.0), ("cube", 0.501, 0.0))
    assert (first.item, second.item) == ("cube-1", "cube-2")
    assert first.position[0] == pytest.approx(0.5005), "the mean of both looks"


def test_the_class_is_evidence_and_not_identity(bench: Bench) -> None:
    bench.look(("cube", 0.5, 0.0))
    bench.look(("cube", 0.5, 0.0))
    target = bench.look(("duck", 0.5, 0.0))[0]
    assert (target.item, target.label) == ("cube-1", "cube"), "two votes against one"


def test_a_pick_puts_only_its_neighbourhood_in_doubt(bench: Bench) -> None:
    near, far = bench.look(("cube", 0.50, 0.0), ("cube", 0.60, 0.1))
    bench.ledger.held("cube-1")
    assert not bench.ledger.is_fresh(near)
    assert bench.ledger.is_fresh(far)


def test_a_missed_grasp_puts_the_whole_table_in_doubt(bench: Bench) -> None:
    near, far = bench.look(("cube", 0.50, 0.0), ("cube", 0.60, 0.2))
    bench.ledger.missed("cube-1")
    assert not bench.ledger.is_fresh(near)
    assert not bench.ledger.is_fresh(far)


def test_an_object_pushed_away_by_a_missed_grasp_is_still_the_same_item(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0), ("duck", 0.6, 0.1))
    bench.ledger.missed("cube-1")
    assert [t.item for t in bench.look(("cube", 0.60, -0.1), ("duck", 0.6, 0.1))] == ["cube-1", "duck-1"]
    assert [row["item"] for row in bench.ledger.rows()] == ["cube-1", "duck-1"]


def test_an_object_that_jumps_without_the_robots_doing_is_another_item(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    items = [t.item for t in bench.look(("cube", 0.60, -0.1))]
    assert items == ["cube-1", "cube-2"], "one look may have overlooked the first"
    assert not bench.ledger.is_sure("cube-1")


def test_an_object_under_a_missed_grasp_stays_itself_when_its_class_reads_differently(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.missed("cube-1")
    assert [t.item for t in bench.look(("duck", 0.505, 0.0))] == ["cube-1"]


def test_a_dropped_item_is_recognized_where_it_lies(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0), ("cube", 0.6, 0.1))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1")
    found = bench.look(("cube", 0.6, 0.1), ("cube", 0.30, -0.3), view="full")
    assert [(t.item, t.position[0]) for t in found] == [("cube-1", 0.30), ("cube-2", pytest.approx(0.6))]


def test_a_dropped_item_that_fell_into_its_bin_is_placed(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1")
    assert bench.look(("cube", 0.2, -0.44), view="full") == []
    assert bench.ledger.balance()["placed"] == 1


def test_a_dropped_item_that_fell_into_any_bin_of_its_class_is_placed_there(bench: Bench) -> None:
    bench.look(("cube", 0.45, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.placed("cube-1", "red_bin")
    bench.look(("cube", 0.60, 0.0))
    bench.ledger.held("cube-2")
    bench.ledger.dropped("cube-2")
    bench.look(("cube", 0.2, -0.44), view="full")
    assert bench.ledger.balance()["placed"] == 1, "the cube in the red bin is the one that was let go there"
    bench.look(("cube", 0.2, -0.44), ("cube", 0.2, 0.44), view="full")
    assert bench.ledger.rows()[1]["bin"] == "pink_bin"


def test_a_dropped_item_is_placed_once_though_two_of_its_bins_show_one_too_many(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1")
    bench.look(("cube", 0.2, 0.44), ("cube", 0.2, -0.44), view="full")
    placed = [data["bin"] for kind, data in bench.events if kind == "item" and data["state"] == "placed"]
    assert placed == ["red_bin"]


def test_a_dropped_item_that_fell_into_a_bin_of_another_class_is_not_placed(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1")
    bench.look(("cube", -0.2, 0.44), view="full")
    assert bench.ledger.balance()["placed"] == 0


def test_what_lies_in_a_bin_is_no_target(bench: Bench) -> None:
    assert bench.look(("cube", 0.25, -0.40), view="full") == []
    assert bench.ledger.balance()["seen"] == 0


def test_an_empty_table_needs_looks_that_agree_since_the_last_change(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.held("cube-1")
    bench.look(view="full")
    assert not bench.ledger.believes_empty()
    bench.ledger.placed("cube-1", "red_bin")
    bench.look(view="full")
    assert bench.ledger.believes_empty()


def test_a_frame_from_before_a_change_says_nothing_about_emptiness(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.held("cube-1")
    for _ in range(3):
        bench.look(view="full", epoch=0)
    assert not bench.ledger.believes_empty()


def test_objects_that_the_mission_has_no_route_for_are_nothing_left_to_sort(bench: Bench) -> None:
    bench.look(("duck", 0.50, 0.0), view="full")
    bench.look(("duck", 0.50, 0.0), view="full")
    assert bench.ledger.believes_empty()
    bench.ledger.close()
    assert bench.ledger.rows()[0]["why"] == "the mission has no route for it"


def test_the_same_frame_twice_is_one_look(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0), view="full")
    bench.frames -= 1
    bench.look(("cube", 0.50, 0.0), view="full")
    assert bench.ledger.rows()[0]["looks"] == 1


def test_an_empty_frame_twice_is_no_proof_that_nothing_is_left(bench: Bench) -> None:
    bench.look(view="full")
    bench.frames -= 1
    bench.look(view="full")
    assert not bench.ledger.believes_empty()


def test_a_frame_from_before_a_pick_brings_nothing_back(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0), ("cube", 0.60, 0.2))
    bench.ledger.held("cube-1")
    assert [t.item for t in bench.look(("cube", 0.50, 0.0), ("cube", 0.60, 0.2), epoch=0)] == ["cube-2"]
    assert bench.ledger.balance()["seen"] == 2


def test_what_one_look_believed_and_no_other_is_a_phantom(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.look(view="full")
    bench.look(view="full")
    bench.ledger.close()
    assert bench.ledger.balance() == {"seen": 0, "placed": 0, "rejected": 0, "lost": 0, "phantom": 1}


def test_what_the_only_look_showed_is_left_and_no_phantom(bench: Bench) -> None:
    bench.look(("duck", 0.50, 0.0))
    bench.ledger.close()
    assert bench.ledger.balance() == {"seen": 1, "placed": 0, "rejected": 1, "lost": 0, "phantom": 0}


def test_what_two_looks_agreed_on_and_then_vanished_is_lost(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.look(("cube", 0.50, 0.0))
    bench.look(view="full")
    bench.look(view="full")
    bench.ledger.close()
    assert bench.ledger.balance() == {"seen": 1, "placed": 0, "rejected": 0, "lost": 1, "phantom": 0}


def test_what_still_stands_there_when_the_run_ends_is_left_and_not_lost(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.close()
    assert bench.ledger.balance()["rejected"] == 1
    assert bench.ledger.rows()[0]["why"] == "the run ended before its turn"


def test_an_item_outside_the_searched_part_is_not_missed(bench: Bench) -> None:
    bench.look(("cube", 0.10, -0.30), view="full")
    bench.look(("cube", 0.10, -0.30), view="full")
    bench.look(view="table")
    bench.ledger.close()
    assert bench.ledger.balance()["lost"] == 0


def test_every_change_is_told_and_the_books_balance(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0), ("cube", 0.6, 0.1), ("duck", 0.45, -0.2))
    bench.look(("cube", 0.50, 0.0), ("cube", 0.6, 0.1), ("duck", 0.45, -0.2))
    bench.ledger.held("cube-1")
    bench.ledger.placed("cube-1", "red_bin")
    bench.ledger.rejected("duck-1", "slippery")
    bench.look(view="full")
    bench.ledger.close()
    count = bench.ledger.balance()
    assert count["seen"] == count["placed"] + count["rejected"] + count["lost"] == 3
    states = [data["state"] for kind, data in bench.events if data.get("item") == "cube-1"]
    assert states == ["seen", "seen", "held", "placed"]


def test_an_item_nobody_entered_is_a_fault(bench: Bench) -> None:
    bench.look(("cube", 0.5, 0.0))
    with pytest.raises(Fault, match='the ledger knows no item "cube-9"; it knows: cube-1'):
        bench.ledger.held("cube-9")


def test_the_tool_holds_one_item_at_a_time(bench: Bench) -> None:
    bench.look(("cube", 0.5, 0.0), ("duck", 0.6, 0.1))
    bench.ledger.held("cube-1")
    bench.ledger.held("cube-1")
    with pytest.raises(Fault, match="the tool cannot hold duck-1: it holds cube-1; the skill"):
        bench.ledger.held("duck-1")
    bench.ledger.dropped("cube-1")
    bench.ledger.held("duck-1")
    assert bench.ledger.in_tool() == "duck-1"


def test_a_rejected_item_that_is_nowhere_to_be_found_is_lost(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1")
    bench.ledger.rejected("cube-1", "could not be picked")
    bench.look(view="full")
    bench.look(view="full")
    bench.ledger.close()
    assert (bench.ledger.balance()["lost"], bench.ledger.balance()["rejected"]) == (1, 0)


def test_a_rejected_item_that_one_look_misses_stays_rejected(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.rejected("cube-1", "could not be picked")
    bench.look(view="full")
    bench.ledger.close()
    assert (bench.ledger.balance()["lost"], bench.ledger.balance()["rejected"]) == (0, 1)


def test_no_name_is_given_out_twice(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1")
    bench.look(("cube", 0.45, 0.1), ("cube", 0.60, 0.1))
    bench.look(("cube", 0.45, 0.1), ("cube", 0.60, 0.1), ("cube", 0.55, -0.2))
    rows = bench.ledger.rows()
    assert len({row["item"] for row in rows}) == len(rows) == 3
    assert sorted(row["position"][0] for row in rows) == [0.45, 0.55, 0.60]  # type: ignore[index]


def test_an_item_dropped_twice_is_recognized_after_further_changes(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0), ("cube", 0.60, 0.1))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1")
    bench.look(("cube", 0.60, 0.1), ("duck", 0.45, 0.15))
    bench.ledger.missed("cube-2")
    found = bench.look(("cube", 0.60, 0.1), ("cube", 0.45, -0.15), ("duck", 0.45, 0.15))
    assert {t.item for t in found} == {"cube-1", "cube-2", "duck-1"}


def test_what_seems_to_lie_just_beside_a_bin_is_neither_a_target_nor_fallen_into_it(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0), ("cube", 0.6, 0.1))
    bench.ledger.held("cube-1")
    bench.ledger.placed("cube-1", "red_bin")
    bench.ledger.held("cube-2")
    bench.ledger.dropped("cube-2")
    edge = -0.44 + 0.12 + 0.007
    assert bench.look(("cube", 0.2, edge), ("cube", 0.2, -0.44), view="full") == []
    assert bench.ledger.balance()["placed"] == 1


def test_an_item_whose_class_looks_keep_contradicting_is_given_up_in_the_end(bench: Bench) -> None:
    for look in range(60):
        bench.look(("cube" if look % 2 else "duck", 0.50, 0.0))
        assert look <= 2 or not bench.ledger.is_sure("duck-1")
    (row,) = bench.ledger.rows()
    assert (row["state"], row["why"]) == ("rejected", "its class is in doubt: 20 duck, 20 cube")


def test_one_slip_about_the_class_costs_some_looks_and_no_more(bench: Bench) -> None:
    bench.look(("duck", 0.50, 0.0))
    for _ in range(6):
        bench.look(("cube", 0.50, 0.0))
    assert bench.ledger.label("duck-1") == "cube"
    assert bench.ledger.is_sure("duck-1")


def test_a_misread_object_is_nobody_who_is_missed_before_its_class_is_sure(bench: Bench) -> None:
    bad = Reliability(threshold=0.5, misses=0.2, confused=0.1, invented=0.5, jitter=1.0)
    for _ in range(4):
        bench.look(("cube", 0.50, 0.0), ("duck", 0.60, 0.15), by=bad)
    bench.ledger.held("duck-1")
    bench.ledger.dropped("duck-1")
    # The fallen duck is read as a cube at first, and the cube is overlooked meanwhile.
    for label in ("cube", "cube", "duck", "duck", "duck", "duck", "duck"):
        bench.look((label, 0.60, 0.10), by=bad)
    bench.look(("duck", 0.60, 0.10), ("cube", 0.50, 0.0), by=bad)
    rows = {row["item"]: row for row in bench.ledger.rows() if row["state"] == "seen"}
    assert rows["duck-1"]["position"] == pytest.approx([0.60, 0.10, 0.025])
    assert rows["cube-1"]["position"] == pytest.approx([0.50, 0.0, 0.025])


def test_what_is_believed_on_the_table_stands_there_given_up_or_not(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0), ("cube", 0.60, 0.1), ("duck", 0.6, -0.1))
    bench.look(("cube", 0.50, 0.0), ("cube", 0.60, 0.1), ("duck", 0.6, -0.1))
    bench.ledger.rejected("cube-2", "slippery")
    assert [target.item for target in bench.ledger.standing()] == ["cube-1", "cube-2", "duck-1"]
    assert bench.ledger.standing()[2].position[:2] == pytest.approx([0.6, -0.1])


def test_what_is_held_placed_or_dropped_stands_nowhere_one_knows(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.held("cube-1")
    assert bench.ledger.standing() == []
    bench.ledger.dropped("cube-1")
    assert bench.ledger.standing() == []
    bench.look(("cube", 0.55, 0.1))
    assert [target.item for target in bench.ledger.standing()] == ["cube-1"]
    bench.ledger.placed("cube-1", "red_bin")
    assert bench.ledger.standing() == []


def test_what_is_put_down_stands_there_and_waits_for_a_look(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.returned("cube-1", np.array((0.6, 0.2, 0.025)))
    (target,) = bench.ledger.standing()
    assert (target.item, target.position.tolist()) == ("cube-1", [0.6, 0.2, 0.025])
    assert not bench.ledger.is_fresh(target)
    assert bench.ledger.in_doubt() == ["cube-1"]
    assert [target.item for target in bench.look(("cube", 0.603, 0.198))] == ["cube-1"]


def test_what_was_put_down_and_not_looked_at_again_is_still_there_in_the_end(bench: Bench) -> None:
    bench.look(("cube", 0.50, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.returned("cube-1", np.array((0.6, 0.2, 0.025)))
    bench.ledger.close()
    assert (bench.ledger.balance()["lost"], bench.ledger.balance()["rejected"]) == (0, 1)


def test_what_is_likelier_an_invention_or_gone_stands_nowhere(bench: Bench) -> None:
    wild = Reliability(threshold=0.5, misses=0.5, confused=0.004, invented=3.0, jitter=1.0)
    bench.look(("cube", 0.50, 0.0), by=wild)
    bench.look(by=wild)
    assert bench.ledger.standing() == []
    bench.look(("duck", 0.60, 0.1))
    bench.look(("duck", 0.60, 0.1))
    assert [target.item for target in bench.ledger.standing()] == ["duck-1"]
    for _ in range(6):
        bench.look()
    assert bench.ledger.standing() == []


def test_running_into_something_puts_the_whole_table_in_doubt_and_nobody_away(bench: Bench) -> None:
    near, far = bench.look(("cube", 0.50, 0.0), ("cube", 0.60, 0.2))
    bench.ledger.bumped()
    assert not bench.ledger.is_fresh(near)
    assert not bench.ledger.is_fresh(far)
    assert bench.ledger.attempts("cube-1") == 0
    assert [t.item for t in bench.look(("cube", 0.52, 0.01), ("cube", 0.60, 0.2))] == ["cube-1", "cube-2"]


def test_what_lies_at_the_edge_of_what_the_arm_always_hides_is_not_looked_for_for_ever(bench: Bench) -> None:
    bench.look(("cube", 0.53, 0.345), view="full")
    bench.ledger.bumped()
    # The nearest point that stands for the table shows beside the arm, but not what lies a little farther.
    for _ in range(12):
        bench.look(view="full", hidden=slice(0, 174))
    assert bench.ledger.believes_empty()


def test_what_lies_at_the_rim_of_the_workspace_is_looked_for_though_the_arm_hides_what_is_beside_it(
    bench: Bench,
) -> None:
    bench.look(("cube", 0.53, 0.235))
    bench.ledger.bumped()
    for _ in range(12):
        bench.look(view="full", hidden=slice(0, 230))
    assert bench.ledger.in_doubt() == ["cube-1"]


def test_an_object_somebody_pushes_aside_is_the_same_item_once_that_is_clear(bench: Bench) -> None:
    for _ in range(3):
        bench.look(("cube", 0.50, 0.0), ("duck", 0.6, 0.1))
    for _ in range(3):
        bench.look(("cube", 0.56, 0.0), ("duck", 0.6, 0.1))
    states = {row["item"]: (row["state"], row["why"]) for row in bench.ledger.rows()}
    assert states == {"cube-1": ("seen", ""), "duck-1": ("seen", ""), "cube-2": ("phantom", "it is cube-1")}
    assert bench.ledger.is_sure("cube-1")


@pytest.mark.parametrize(
    ("label", "x"), [("duck", 0.56), ("cube", 0.64)], ids=["another class", "too far away to be pushed"]
)
def test_what_turns_up_elsewhere_without_the_robots_doing_is_another_object(
    bench: Bench, label: str, x: float
) -> None:
    for _ in range(3):
        bench.look(("cube", 0.50, 0.0))
    for _ in range(5):
        bench.look((label, x, 0.0))
    assert bench.ledger.balance()["phantom"] == 0


def test_what_stood_there_before_the_other_vanished_is_not_that_one(bench: Bench) -> None:
    for _ in range(3):
        bench.look(("cube", 0.50, 0.0), ("cube", 0.56, 0.0))
    for _ in range(5):
        bench.look(("cube", 0.56, 0.0))
    bench.ledger.close()
    assert [row["state"] for row in bench.ledger.rows()] == ["lost", "rejected"]


def test_what_lies_where_something_was_invented_before_the_table_changed_is_new(bench: Bench) -> None:
    for _ in range(4):
        bench.look(("cube", 0.6, 0.1))
    bench.look(("cube", 0.6, 0.1), ("duck", 0.5, 0.0))
    assert bench.ledger.records[1].probability < 0.5, "nothing was there in four looks"
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1")
    for _ in range(3):
        bench.look(("cube", 0.5, 0.02))
    assert [record.item for record in bench.ledger.records if record.state.value == "seen"] == ["cube-1"]
