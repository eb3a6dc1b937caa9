"""Recovery of the scene after actions of the tool that nobody recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from at_hand import look, pick

from executive.cell.objects import Target
from executive.cells.fake.cell import FakeCell
from executive.errors import Fault
from executive.ledger.outcomes import REASON_UNTRACKED
from executive.run.resumed_run import recover_scene


def recover(fake: FakeCell) -> None:
    for _ in recover_scene(fake.cell):
        fake.advance()


def move_into_bin(fake: FakeCell, label: str, bin: str) -> None:
    thing = next(one for one in fake.world.objects if one.label == label)
    thing.position[:2] = fake.cell.bins[bin].position[:2]


def states(fake: FakeCell) -> dict[str, str]:
    return {one.item: one.state for one in fake.ledger.list_items()}


def test_items_are_recognized_in_their_bins_and_on_the_table(fake: FakeCell, targets: list[Target]) -> None:
    move_into_bin(fake, "cube", "red_bin")
    recover(fake)
    assert states(fake) == {"cube-1": "placed", "duck-1": "seen"}
    fake.ledger.set_final_states(completed=False)
    assert fake.audit()["right"] == fake.ledger.count_states()["placed"] == 1


def test_an_item_whose_place_stays_unknown_is_rejected(fake: FakeCell, targets: list[Target]) -> None:
    fake.world.remove(fake.world.objects[0])
    recover(fake)
    fake.ledger.set_final_states(completed=True)
    (cube,) = (one for one in fake.ledger.list_items() if one.item == "cube-1")
    assert (cube.state, cube.reason) == ("rejected", REASON_UNTRACKED)


def test_an_object_that_no_look_had_shown_is_counted_in_its_bin(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    fake.world.put("sphere", 0.6, 0.1)
    move_into_bin(fake, "cube", "red_bin")
    move_into_bin(fake, "sphere", "red_bin")
    recover(fake)
    assert states(fake) == {"cube-1": "placed", "sphere-1": "rejected"}
    audit = fake.audit()
    assert (audit["right"], audit["wrong_bin"], audit["unseen"]) == (1, 1, 0)


def test_an_object_in_the_tool_is_put_down_and_seen_again(fake: FakeCell, targets: list[Target]) -> None:
    item = pick(fake, targets[0])
    recover(fake)
    assert (fake.tool.holding, fake.ledger.find_held_item(), states(fake)[item]) == (False, None, "seen")
    assert fake.audit()["left"] == 2


def test_an_object_that_cannot_be_put_down_stays_in_the_tool(fake: FakeCell, targets: list[Target]) -> None:
    pick(fake, targets[0])
    fake.cell = replace(fake.cell, safe_place=np.array([2.0, 0.0, 0.0]))
    with pytest.raises(Fault, match=r"cannot be put down: .* take it out of the tool and resume the run"):
        recover(fake)
    assert fake.tool.holding


def test_a_known_object_in_a_bin_is_counted_once(fake: FakeCell, targets: list[Target]) -> None:
    fake.ledger.record_placement(targets[0].item, "red_bin")
    move_into_bin(fake, "cube", "red_bin")
    look(fake, "full")
    recover(fake)
    assert fake.ledger.count_states()["placed"] == 1
