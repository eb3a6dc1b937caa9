from __future__ import annotations

import pytest

from executive.cell.arm import Goal
from executive.cells.fake.cell import FakeCell
from executive.testing.run_skill import SkillResult, run_skill
from skills.select_target import SelectTarget


def select(fake: FakeCell, targets, **values) -> SkillResult:
    return run_skill(SelectTarget(targets=targets, **values), fake)


def put(fake: FakeCell, **places: tuple[float, float]) -> None:
    for label, place in places.items():
        fake.world.put(label, *place)


def test_the_nearest_target_comes_first_with_its_bin(fake: FakeCell, look) -> None:
    put(fake, cube=(0.6, -0.2), duck=(0.45, 0.2))
    result = select(fake, look())
    assert (result.outputs["item"], result.outputs["bin"]) == ("duck-1", "yellow_bin")
    assert result.commands == ["decided duck-1 yellow_bin"]


def test_while_the_arm_moves_the_nearest_is_the_one_nearest_to_where_it_will_be(fake: FakeCell, look) -> None:
    put(fake, cube=(0.45, 0.0), duck=(0.6, -0.2))
    targets = look()
    assert select(fake, targets).outputs["item"] == "cube-1"
    fake.arm.start(fake.arm.plan(Goal((0.6, -0.3, 0.1))).result())
    assert select(fake, targets).outputs["item"] == "duck-1"


def test_of_several_bins_the_one_with_the_fewest_objects_is_next_the_first_among_equals(
    fake: FakeCell, look
) -> None:
    fake.routes["cube"] = ("blue_bin", "red_bin")
    for x in (0.45, 0.55, 0.65):
        fake.world.put("cube", x, 0.0)
    chosen = []
    for target in look():
        chosen.append(select(fake, [target]).outputs["bin"])
        fake.ledger.record_placement(target.item, chosen[-1])
    assert chosen == ["blue_bin", "red_bin", "blue_bin"]


def test_neither_a_rejected_item_nor_a_neighbour_of_a_picked_one_is_taken(fake: FakeCell, look) -> None:
    put(fake, cube=(0.50, 0.0), duck=(0.55, 0.0), sphere=(0.60, 0.2))
    targets = look()
    fake.ledger.record_grasp("cube-1")
    assert select(fake, targets).outputs["item"] == "sphere-1"
    fake.ledger.reject("sphere-1", "slippery")
    assert select(fake, targets).reason == "doubtful", "the duck may have been moved"


def test_only_the_same_item_or_the_wanted_class_will_do(fake: FakeCell, look) -> None:
    put(fake, cube=(0.6, 0.2), duck=(0.45, -0.2))
    targets = look()
    assert select(fake, targets, same="cube-1").outputs["item"] == "cube-1"
    assert select(fake, targets, wanted="cube").outputs["item"] == "cube-1"
    result = select(fake, targets, wanted="sphere")
    assert (result.reason, result.message) == (
        "unseen", "no sphere is in sight, but it is not certain that the table is empty",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("view", "reasons"), [("table", ["unseen"] * 5), ("full", ["unseen", "no_candidate"])]
)
def test_two_empty_looks_at_the_full_frame_alone_are_believed(
    fake: FakeCell, look, view: str, reasons: list[str]
) -> None:
    results = [select(fake, look(view)) for _ in reasons]
    assert [result.reason for result in results] == reasons
    if view == "full":
        assert results[-1].message == "no object to sort is left on the table, except rejected objects"


def test_a_class_can_be_gone_while_others_are_left(fake: FakeCell, look) -> None:
    put(fake, duck=(0.45, -0.2))
    reasons = [select(fake, look("full"), wanted="sphere").reason for _ in range(2)]
    assert reasons == ["unseen", "no_candidate"]
    assert select(fake, look("full"), wanted="duck").outputs["item"] == "duck-1"


def test_a_table_with_only_rejected_items_ends_the_work(fake: FakeCell, look) -> None:
    put(fake, cube=(0.6, 0.2))
    look()
    fake.ledger.reject("cube-1", "slippery")
    assert select(fake, look("full")).reason == "no_candidate"
