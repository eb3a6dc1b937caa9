"""The arm before the lens, no depth, a bumped table, an operator with other wishes: on the fake cell."""

from __future__ import annotations

from executive.events import ignore
from executive.testing.disturbances import (
    DisturbedCell,
    after,
    during,
    no_depth,
    operator_asks_rescan,
    operator_quits,
    table_bumped,
    workspace_hidden,
)
from executive.testing.fake_cell import FakeCell
from executive.testing.run_mission import run_mission
from executive.testing.run_skill import run_skill
from skills.detect import Detect


def test_a_hidden_workspace_is_looked_at_again_from_elsewhere() -> None:
    result = run_mission(
        "sort_overhead", disturbances=[during("tree/look/*/Detect", workspace_hidden(), nth=1)]
    )
    assert result.reasons("*/Detect") == ["hidden"]
    assert "tree/look/try/retry/recover/MoveToScan" in result.entered("*/MoveToScan")
    assert (result.status, result.agrees) == ("SUCCESS", True)


def test_nothing_that_the_arm_hides_is_believed() -> None:
    fake = FakeCell()
    fake.world.put("cube", 0.5, 0.0)
    cell = DisturbedCell(fake, [after(0.0, workspace_hidden())], ignore)
    assert run_skill(Detect, cell).reason == "hidden"
    look = run_skill(Detect, cell, inputs={"hidden": "pass"}).outputs["detections"]
    assert look.found == ()
    assert not look.frame.visible.any()


def test_a_look_without_depth_is_passed_over_while_the_arm_carries() -> None:
    result = run_mission("sort_overhead", disturbances=[during("*/watch/*/Localize", no_depth(), nth=1)])
    assert result.reasons("*/Localize") == ["no_depth"]
    failed = next(e for e in result.events if e.data.get("reason") == "no_depth")
    assert failed.data["message"] == "the frame has no depth there, as the test wants it"
    assert (result.status, result.agrees) == ("SUCCESS", True)


def test_a_bumped_table_makes_a_frame_stale_once() -> None:
    result = run_mission("sort_overhead", disturbances=[during("*/watch/*/Localize", table_bumped(), nth=1)])
    assert result.reasons("*/Localize") == ["stale"]
    assert [told["what"] for told in result.disturbances()] == ["table_bumped"]
    assert (result.status, result.agrees) == ("SUCCESS", True)


def test_an_operator_quits_although_the_list_has_more() -> None:
    script = [during("*/AwaitRequest", operator_quits(), nth=2)]
    result = run_mission("pick_on_request", requests=["cube", "cube", "duck"], disturbances=script)
    assert result.reasons("*/AwaitRequest") == ["quit"]
    assert len(result.entered("*/AwaitRequest")) == 2
    assert [told["what"] for told in result.disturbances()] == ["operator_quits"]


def test_an_operator_wants_a_fresh_look_first_and_then_the_rest_of_the_list() -> None:
    script = [during("*/AwaitRequest", operator_asks_rescan(), nth=1)]
    result = run_mission("pick_on_request", requests=["cube", "q"], disturbances=script)
    assert result.reasons("*/AwaitRequest") == ["rescan", "quit"]
    assert [e.data["wanted"] for e in result.events if e.kind == "request"] == ["cube", None]
