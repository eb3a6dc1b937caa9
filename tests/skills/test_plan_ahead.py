"""What is planned while the arm carries is known when it is free."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from executive.messages import Target
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.approach import Approach
from skills.grasp import Grasp
from skills.plan_ahead import PlanAhead
from skills.release import Release
from skills.select_target import SelectTarget
from skills.transit import Transit

WAITING = 0.05
"""Time that a plan takes in the shipped cell [s]."""

Plans = list[dict[str, Any]]


@pytest.fixture
def plans() -> Plans:
    """What the run was told of every plan."""
    return []


@pytest.fixture
def fake(plans: Plans) -> FakeCell:
    """A fake cell with a cube in the middle of the table."""

    def emit(kind: str, **data: Any) -> None:
        if kind == "plan":
            plans.append(data)

    fake = FakeCell(emit=emit)
    fake.world.put("cube", 0.5, 0.0)
    return fake


def carry(fake: FakeCell, target: Target, bin: str, meanwhile: Callable[[], object]) -> None:
    """Pick `target` and bring it into `bin`; `meanwhile` is called while the arm is on its way."""
    run_skill(Approach(target=target), fake)
    run_skill(Grasp(target=target, bin=bin), fake)
    steps = Transit(held=target.item, bin=bin).run(fake.cell)
    for tick, _ in enumerate(steps):
        if tick == 30:
            meanwhile()
        fake.advance()
    run_skill(Release(held=target.item, bin=bin), fake)


@pytest.mark.parametrize("label", ["cube", "duck"], ids=["same bin", "other bin"])
def test_an_approach_finds_the_plan_made_during_the_carry_before_it(
    fake: FakeCell, look: Callable[..., list[Target]], plans: Plans, label: str
) -> None:
    fake.world.put(label, 0.6, 0.15)
    first, then = look()
    carry(fake, first, "red_bin", lambda: run_skill(PlanAhead(target=then), fake))
    steps = Approach(target=then).run(fake.cell)
    next(steps)
    assert plans[-1]["ahead"]
    assert plans[-1]["waits"] == 0
    assert not fake.arm.at_rest, "it is under way in its first tick"


def test_what_is_chosen_for_the_time_being_is_what_is_chosen_when_the_arm_is_free(
    fake: FakeCell, look: Callable[..., list[Target]], plans: Plans
) -> None:
    fake.routes["cube"] = ("red_bin", "blue_bin")
    # The one is nearer to the bin, the other to where the arm is when it is asked.
    fake.world.put("cube", 0.45, -0.2)
    fake.world.put("cube", 0.6, 0.1)
    targets = look()
    ahead: dict[str, Any] = {}

    def think() -> None:
        ahead.update(run_skill(SelectTarget(targets=targets, tentative=True), fake).outputs)
        run_skill(PlanAhead(target=ahead["target"]), fake)

    carry(fake, targets[0], "red_bin", think)
    chosen = run_skill(SelectTarget(targets=targets), fake).outputs
    assert (chosen["item"], chosen["bin"]) == (ahead["item"], ahead["bin"]) == ("cube-2", "blue_bin")
    assert run_skill(Approach(target=chosen["target"]), fake).status == "SUCCESS"
    assert plans[-1]["ahead"]


def test_a_target_that_nobody_thought_of_is_waited_for(
    fake: FakeCell, look: Callable[..., list[Target]], plans: Plans
) -> None:
    fake.world.put("duck", 0.6, 0.15)
    fake.world.put("sphere", 0.6, -0.15)
    cube, duck, sphere = look()
    carry(fake, cube, "red_bin", lambda: run_skill(PlanAhead(target=duck), fake))
    run_skill(Approach(target=sphere), fake)
    assert plans[-1] == {"ahead": False, "waits": WAITING, "duration": plans[-1]["duration"]}


def test_what_another_look_has_moved_is_planned_anew(
    fake: FakeCell, look: Callable[..., list[Target]], plans: Plans
) -> None:
    duck = fake.world.put("duck", 0.6, 0.15)
    first, then = look()

    def think() -> None:
        run_skill(PlanAhead(target=then), fake)
        duck.position[0] += 0.002

    carry(fake, first, "red_bin", think)
    moved = next(target for target in look() if target.item == then.item)
    run_skill(Approach(target=moved), fake)
    assert not plans[-1]["ahead"]


@pytest.mark.parametrize("bin", ["red_bin", None])
def test_a_grasp_that_knows_the_bin_has_the_way_there_planned(
    fake: FakeCell, look: Callable[..., list[Target]], plans: Plans, bin: str | None
) -> None:
    (target,) = look()
    run_skill(Approach(target=target), fake)
    run_skill(Grasp(target=target, bin=bin), fake)
    run_skill(Transit(held=target.item, bin="red_bin"), fake)
    known = bin is not None
    assert (plans[-1]["ahead"], plans[-1]["waits"]) == (known, 0 if known else WAITING)


def test_it_succeeds_at_once_and_moves_nothing(fake: FakeCell, look: Callable[..., list[Target]]) -> None:
    (target,) = look()
    result = run_skill(PlanAhead(target=target), fake)
    assert (result.status, result.ticks) == ("SUCCESS", 0)
    assert fake.arm.commanded == []
    assert not PlanAhead.uses


def test_what_cannot_be_reached_is_said_by_the_approach_alone(
    fake: FakeCell, look: Callable[..., list[Target]]
) -> None:
    fake.world.put("duck", 0.80, 0.30)
    far = next(target for target in look("full") if target.label == "duck")
    assert run_skill(PlanAhead(target=far), fake).status == "SUCCESS"
    assert run_skill(Approach(target=far), fake).reason == "unreachable"
