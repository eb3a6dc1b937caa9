"""Weighing of the held item, and correction of its class and its bin."""

from __future__ import annotations

import math

import at_hand
import pytest

from executive.drivers.fake import FakeTool
from executive.geometry import GRAVITY
from executive.skill import SkillFailed
from executive.testing.fake_cell import FakeCell, load_empty_cell
from executive.testing.run_skill import SkillResult, run_skill
from skills.release import Release
from skills.select_target import SelectTarget
from skills.transit import Transit
from skills.weigh import Weigh

ROUTES = {"bottle": ("red_bin",), "full_bottle": ("blue_bin",), "jar": ("yellow_bin",), "duck": ("red_bin",)}


def make_fake(routes: dict[str, tuple[str, ...]] = ROUTES) -> FakeCell:
    """A fake cell with empty and full bottles, which look alike, and jars, which weigh as full bottles."""
    config = load_empty_cell()
    bottle = config.objects["cube"].model_copy(update={"mass": 0.05})
    full = bottle.model_copy(update={"mass": 0.20, "looks_like": "bottle"})
    jar = bottle.model_copy(update={"mass": 0.20})
    objects = {"bottle": bottle, "full_bottle": full, "jar": jar, "duck": config.objects["duck"]}
    return FakeCell(config.model_copy(update={"objects": objects}), routes=routes)


def pick(fake: FakeCell, label: str) -> str:
    """Put an object of a class on the table, look once, and pick it."""
    fake.world.put(label, 0.5, 0.0)
    return at_hand.pick(fake, at_hand.look(fake)[0])


def weigh(fake: FakeCell, item: str) -> SkillResult:
    return run_skill(Weigh(held=item), fake)


@pytest.mark.parametrize(
    ("label", "mass", "bin"), [("bottle", 0.05, "red_bin"), ("full_bottle", 0.20, "blue_bin")]
)
def test_a_full_and_an_empty_bottle_look_alike_and_get_their_own_bins(
    label: str, mass: float, bin: str
) -> None:
    fake = make_fake()
    item = pick(fake, label)
    assert (item, fake.ledger.get_label(item)) == ("bottle-1", "bottle")
    height = fake.arm.tool_pose.position[2]
    result = run_skill(Weigh(held=item, height=0.1), fake)
    assert fake.arm.tool_pose.position[2] == pytest.approx(height + 0.1)
    assert (result.status, result.outputs["bin"]) == ("SUCCESS", bin)
    assert result.outputs["weight"] == pytest.approx(mass * GRAVITY)
    assert fake.ledger.get_label(item) == label


@pytest.mark.parametrize("zero", [-0.1 * GRAVITY, 20.0])
def test_the_load_of_the_empty_tool_before_the_approach_is_the_zero(zero: float) -> None:
    fake = make_fake()
    fake.tool.load_error = zero
    result = weigh(fake, pick(fake, "bottle"))
    assert (result.outputs["weight"], result.outputs["bin"]) == (pytest.approx(0.05 * GRAVITY), "red_bin")


@pytest.mark.parametrize("load", [0.05 * GRAVITY, math.nan])
def test_a_load_that_never_changes_or_is_no_number_is_implausible(
    load: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake = make_fake()
    item = pick(fake, "bottle")
    monkeypatch.setattr(FakeTool, "load", load)
    assert weigh(fake, item).reason == "implausible"


def test_a_weight_of_another_class_that_looks_different_contradicts_the_look() -> None:
    fake = make_fake()
    item = pick(fake, "jar")
    fake.tool.load_error = -0.15 * GRAVITY
    result = weigh(fake, item)
    assert (result.status, result.reason) == ("FAILURE", "contradicted")
    assert "it weighs 0.49 N; expected: jar 1.96 N" in result.message
    assert fake.ledger.get_label(item) == "jar"


def test_a_weight_between_two_classes_contradicts_both() -> None:
    fake = make_fake()
    item = pick(fake, "bottle")
    fake.tool.load_error = 0.07 * GRAVITY
    result = weigh(fake, item)
    assert result.reason == "contradicted"
    assert "it weighs 1.18 N; expected: bottle 0.49 N or full_bottle 1.96 N" in result.message
    fake.ledger.reject(item, "could not be picked")
    (row,) = fake.ledger.list_items()
    assert row.reason.startswith("could not be picked: it weighs 1.18 N")


def test_a_class_without_a_declared_mass_is_weighed_without_a_conclusion() -> None:
    fake = make_fake()
    item = pick(fake, "duck")
    fake.tool.load_error = 3.0
    result = weigh(fake, item)
    assert (result.status, result.outputs["weight"]) == ("SUCCESS", pytest.approx(3.981))


def test_a_class_without_a_route_has_no_bin() -> None:
    fake = make_fake({"bottle": ("red_bin",)})
    result = weigh(fake, pick(fake, "full_bottle"))
    assert (result.reason, result.message[:27]) == ("no_bin", "bottle-1 is a full_bottle: ")


def test_a_look_alike_in_the_list_may_be_of_the_wanted_class() -> None:
    fake = make_fake()
    fake.world.put("full_bottle", 0.5, 0.0)
    targets = [at_hand.look(fake, "full") for _ in range(4)][-1]
    select = SelectTarget(targets=targets, wanted="full_bottle", among=["bottle-1"])
    assert run_skill(select, fake).reason == "unseen"
    fake.ledger.reject("bottle-1", "slippery")
    assert run_skill(select, fake).reason == "no_candidate"


def test_an_item_that_falls_during_the_measurement_is_dropped_and_not_weighed() -> None:
    fake = make_fake()
    item = pick(fake, "bottle")
    steps = Weigh(held=item, settle=0.0).run(fake.cell)
    loads = 0
    with pytest.raises(SkillFailed) as failure:
        while True:
            next(steps)
            fake.advance()
            loads += fake.arm.at_rest
            if loads == 40:
                fake.tool.lose_grip()
    assert failure.value.reason == "dropped"
    assert "broke during the weighing, near (0.50, 0.00" in failure.value.message
    assert fake.ledger.find_held_item() is None


def test_the_bin_of_one_of_two_classes_that_look_alike_is_blocked_until_the_weight_is_certain() -> None:
    fake = make_fake()
    item = pick(fake, "full_bottle")
    fake.tool.load_error = 0.07 * GRAVITY
    assert weigh(fake, item).reason == "contradicted"
    result = run_skill(Transit(held=item, bin="red_bin"), fake)
    assert (result.status, result.reason) == ("FAILURE", "blocked")
    assert "may be a bottle or a full_bottle" in result.message
    assert "red_bin is not permitted for a full_bottle" in result.message
    fake.tool.load_error = 0.0
    weigh(fake, item)
    assert run_skill(Transit(held=item, bin="blue_bin"), fake).status == "SUCCESS"


@pytest.mark.parametrize("bin", ["red_bin", "yellow_bin"])
def test_an_item_that_was_not_weighed_gets_into_a_bin_of_all_classes_or_of_none(bin: str) -> None:
    fake = make_fake({"bottle": ("red_bin",), "full_bottle": ("red_bin", "blue_bin")})
    assert run_skill(Transit(held=pick(fake, "bottle"), bin=bin), fake).status == "SUCCESS"


def finish(fake: FakeCell, label: str, load_error: float = 0.0) -> str:
    """Weigh an object of a class and release it in its bin; return the reason of a failed weighing."""
    item = pick(fake, label)
    result = weigh(fake, item)
    fake.tool.load_error = load_error
    if result.status == "SUCCESS":
        run_skill(Transit(held=item, bin=result.outputs["bin"]), fake)
        run_skill(Release(held=item, bin=result.outputs["bin"]), fake)
    else:
        fake.tool.open()
        fake.ledger.record_drop(item)
    fake.world.objects.clear()
    return result.reason


@pytest.mark.parametrize(("shift", "count"), [(0.1, 0), (0.15 * GRAVITY, 1)])
def test_a_zero_that_moved_during_a_weighing_makes_its_class_uncertain(shift: float, count: int) -> None:
    fake = make_fake()
    finish(fake, "bottle", load_error=shift)
    assert len(fake.ledger.unexplained.events) == count


def test_a_wrong_gain_is_noticed_by_a_class_that_looks_prove(monkeypatch: pytest.MonkeyPatch) -> None:
    fake = make_fake()
    read_load = vars(FakeTool)["load"].fget
    monkeypatch.setattr(FakeTool, "load", property(lambda tool: 4.0 * read_load(tool)))
    assert finish(fake, "bottle") == ""  # taken for a full bottle
    assert finish(fake, "jar") == "contradicted"
    assert "the load cell may be wrong: jar-1" in fake.ledger.unexplained.events[0].text
    assert finish(fake, "bottle") == "contradicted"
