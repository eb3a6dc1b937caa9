"""Somebody takes an object away, or puts it elsewhere: on the fake cell."""

from __future__ import annotations

import numpy as np
import pytest

from executive.testing.disturbances import DisturbedCell, after, between, during, object_moved, object_removed
from executive.testing.fake_cell import FakeCell
from executive.testing.run_mission import run_mission

PLACES = {"cube": (0.6, -0.15), "sphere": (0.65, 0.1), "duck": (0.45, 0.2)}


def three(cell: FakeCell) -> None:
    """Put three objects on the table, the duck nearest to where the tool begins."""
    cell.world.objects.clear()
    for label, place in PLACES.items():
        cell.world.put(label, *place)


def labels(cell: FakeCell) -> list[str]:
    return [thing.label for thing in cell.world.objects]


def test_what_is_taken_away_under_the_tool_is_lost_and_the_audit_knows_it() -> None:
    result = run_mission(
        "sort_overhead", arrange=three, disturbances=[during("*/Approach", object_removed(), nth=2)]
    )
    (told,) = result.disturbances()
    assert told["item"] == f"{told['object']}-1"
    assert told["object"] not in labels(result.cell)
    assert (result.status, result.reason) == ("FAILURE", "lost")
    assert (result.items["lost"], result.audit["elsewhere"]) == (1, 1)  # type: ignore[index]
    assert result.items["placed"] == 2
    assert result.agrees


def test_with_a_share_it_waits_until_the_arm_is_so_far() -> None:
    begins, half = (
        run_mission("sort_overhead", arrange=three, disturbances=[during("*/Approach", effect, nth=2)])
        for effect in (object_removed(), object_removed(share=0.5))
    )
    (at_once,), (later,) = (
        [event.clock for event in result.events if event.kind == "disturbance"] for result in (begins, half)
    )
    assert later > at_once + 0.1


def test_what_is_taken_out_of_the_tool_was_dropped_nowhere() -> None:
    result = run_mission(
        "sort_overhead", arrange=three, disturbances=[during("*/Transit", object_removed(), nth=2)]
    )
    assert result.reasons("*/Transit") == ["dropped"]
    assert (result.reason, result.items["lost"], len(result.cell.world.objects)) == ("lost", 1, 2)
    assert result.cell.world.held is None
    assert result.agrees


def test_what_nobody_had_seen_is_not_missed() -> None:
    result = run_mission("sort_overhead", arrange=three, disturbances=[after(0.0, object_removed(1))])
    assert labels(result.cell) == ["sphere", "duck"]
    assert (result.status, result.audit["elsewhere"]) == ("SUCCESS", 0)  # type: ignore[index]
    assert result.agrees


@pytest.mark.parametrize(("which", "gone"), [(1, "cube"), (2, "sphere"), ("nearest", "duck")])
def test_one_is_meant_by_its_number_or_by_where_it_is(which, gone: str) -> None:
    result = run_mission("sort_overhead", arrange=three, disturbances=[after(0.0, object_removed(which))])
    assert [told["object"] for told in result.disturbances()] == [gone]
    assert gone not in labels(result.cell)


def test_where_there_is_no_such_object_nothing_happens() -> None:
    result = run_mission("sort_overhead", arrange=three, disturbances=[after(0.0, object_removed(4))])
    assert (result.status, result.disturbances()) == ("SUCCESS", [])


def test_the_nearest_is_none_that_lies_in_a_bin_or_hangs_at_the_tool() -> None:
    script = [during("*/Release", object_removed("nearest"), nth=2)]
    result = run_mission("sort_overhead", arrange=three, disturbances=script)
    (told,) = result.disturbances()
    assert not told["item"].startswith(told["object"])
    assert abs(told["position"][1]) < 0.2
    assert result.items["placed"] == 2
    assert result.agrees


def test_a_node_that_is_about_nothing_means_the_nearest() -> None:
    script = [during("*/Wait", object_moved((0.03, 0.0)), nth=1)]
    (told,) = run_mission("sort_overhead", arrange=three, disturbances=script).disturbances()
    assert told["item"] == ""
    assert told["object"] != ""


def test_what_is_moved_under_the_tool_is_found_where_it_is_now() -> None:
    script = [during("*/Approach", object_moved((0.02, 0.07)), nth=1)]
    result = run_mission("sort_overhead", arrange=three, disturbances=script)
    assert result.reasons("*/Approach") == ["no_contact"]
    assert (result.status, result.items["placed"], result.items["lost"]) == ("SUCCESS", 3, 0)
    assert result.agrees


def test_it_is_moved_by_just_so_much() -> None:
    fake = FakeCell()
    three(fake)
    cell = DisturbedCell(fake, [between(0.5, 0.6, object_moved((0.02, -0.03), "nearest"))])
    for _ in range(240):
        cell.advance()
    duck = fake.world.objects[2]
    assert np.allclose(duck.position, [PLACES["duck"][0] + 0.02, PLACES["duck"][1] - 0.03, 0.028])
