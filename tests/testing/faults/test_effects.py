"""Every effect on the fake cell: what it does there, and the failure of a skill that comes of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from events import at

from executive.cell.detection import Observation
from executive.cell.protocols import Request
from executive.cells.fake.cell import FakeCell
from executive.errors import Blocked, NoDepth, Unavailable, Unreachable
from executive.events import Event, NodeStarted, RequestGiven
from executive.testing import faults as effects
from executive.testing.faults import FaultyCell, ScheduledFault, between, during
from executive.testing.faults.effect import Effect
from executive.testing.run_mission import run_mission
from executive.testing.run_skill import run_skill
from skills.detect import Detect
from skills.move_to_scan import MoveToScan

LATENCY = 0.05
PLACES = {"cube": (0.6, -0.15), "sphere": (0.65, 0.1), "duck": (0.45, 0.2)}


def cell_with(*what: Effect, start: float = 0.0, end: float = 100.0) -> FaultyCell:
    """Return a cell with faults with three objects, the duck nearest to the tool; `events` are its events."""
    fake = FakeCell()
    for label, place in PLACES.items():
        fake.world.put(label, *place)
    events: list[Event] = []
    script = [between(start, end, effect) for effect in what]
    cell = FaultyCell(fake, script, events.append)
    cell.events, cell.fake = events, fake  # type: ignore[attr-defined]
    return cell


def wait(cell: Any, until: float) -> None:
    while cell.cell.clock.now < until - 1e-9:
        cell.advance()


def follow(cell: Any, pose: str = "aside") -> float:
    """Begin a motion; return the distance [m]."""
    planning = cell.cell.arm.plan(pose)
    while not planning.ready:
        cell.advance()
    start = cell.cell.arm.tool_pose.position
    cell.cell.arm.start(planning.result())
    return float(np.linalg.norm(cell.cell.arm.destination - start))


def hold(cell: Any, label: str = "cube") -> None:
    cell.fake.world.held_object = next(one for one in cell.fake.world.objects if one.label == label)


def labels(cell: Any) -> list[str]:
    return [thing.label for thing in cell.fake.world.objects]


MISSIONS: list[tuple[ScheduledFault, str, list[str], str, int]] = [
    (during("*/Grasp", effects.seal_fails(), activations=2), "*/Grasp", ["missed"], "SUCCESS", 0),
    (during("*/Transit", effects.seal_breaks(), activations=1), "*/Transit", ["dropped"], "SUCCESS", 0),
    (
        during("*/Release", effects.tool_does_not_release(), activations=(2, 3, 4)),
        "*/Release",
        ["stuck"] * 3,
        "FAILURE",
        5,
    ),
    (
        during("*/Approach", effects.arm_collides("a hand"), activations=2),
        "*/Approach",
        ["blocked"],
        "SUCCESS",
        0,
    ),
    (
        during("tree/look/*/Detect", effects.detector_dead(), activations=1),
        "*/Detect",
        ["unavailable"],
        "SUCCESS",
        0,
    ),
    (during("*/Transit", effects.object_removed(), activations=2), "*/Transit", ["dropped"], "FAILURE", 0),
]
"""A fault, a pattern of nodes, their failures, the status of sort_overhead, and what it rejects."""
MORE: list[tuple[ScheduledFault, str, list[str], str, int]] = [
    (
        during("*/Transit", effects.arm_collides(), activations=(1, 2, 3)),
        "*/Transit",
        ["blocked"] * 3,
        "SUCCESS",
        0,
    ),
    (
        during("*/Transit", effects.arm_collides(), activations=tuple(range(1, 37))),
        "*/Transit",
        ["blocked"] * 36,
        "INCOMPLETE",
        6,
    ),
    (during("*/Approach", effects.no_path(), activations=2), "*/Approach", ["unreachable"], "INCOMPLETE", 1),
    (
        during("tree/look/*/Detect", effects.detector_unsure(), activations=1),
        "*/Detect",
        ["unsure"],
        "SUCCESS",
        0,
    ),
    (
        during("tree/look/*/Detect", effects.workspace_occluded(), activations=1),
        "*/Detect",
        ["hidden"],
        "SUCCESS",
        0,
    ),
    (
        during("*/watch/*/Localize", effects.no_depth(), activations=1),
        "*/Localize",
        ["no_depth"],
        "SUCCESS",
        0,
    ),
    (
        during("*/watch/*/Localize", effects.table_bumped(), activations=1),
        "*/Localize",
        ["stale"],
        "SUCCESS",
        0,
    ),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("one", "pattern", "reasons", "status", "rejected"),
    [*MISSIONS, *MORE],
    ids=lambda one: getattr(one, "effect", None),
)
def test_a_mission_deals_with_it_and_its_books_are_right(
    one: ScheduledFault, pattern: str, reasons: list[str], status: str, rejected: int
) -> None:
    result = run_mission("sort_overhead", faults=[one])
    assert result.list_failure_reasons(pattern) == reasons
    assert (result.status, result.items["rejected"], result.agrees) == (status, rejected, True)
    assert {fault.name for fault in result.list_injected_faults()} == {one.effect.name}


def test_an_operator_wants_something_else_first() -> None:
    script = [
        during("*/AwaitRequest", effects.operator_asks_rescan(), activations=1),
        during("*/AwaitRequest", effects.operator_quits(), activations=3),
    ]
    result = run_mission("pick_on_request", requests=["cube", "cube"], faults=script)
    assert result.list_failure_reasons("*/AwaitRequest") == ["rescan", "quit"]
    assert [fault.name for fault in result.list_injected_faults()] == [
        "operator_asks_rescan",
        "operator_quits",
    ]
    assert [one.event.request for one in result.events if isinstance(one.event, RequestGiven)] == ["cube"]


def ask(cell: FaultyCell) -> Request:
    return cell.cell.detectors["embedded"].request(cell.cell.camera.capture(), "table")


def answered(cell: FaultyCell, request: Request) -> float:
    """Return when a request is answered [s]."""
    while not request.ready:
        assert cell.cell.clock.now < 50.0, "it is never answered"
        cell.advance()
    return cell.cell.clock.now


@pytest.mark.parametrize(
    ("script", "asked", "due", "found"),
    [
        ([effects.detector_dead()], 0.0, LATENCY, None),
        ([effects.detector_times_out(2.0)], 0.0, 2.0 + LATENCY, None),
        ([effects.detector_hangs()], 0.5, 0.5 + LATENCY, 3),
        ([effects.detector_hangs()], 1.0, 3.0, 3),
        ([effects.detector_hangs(hang_end=2.0)], 1.0, 2.0, 3),
        ([effects.detector_slow(0.7)], 1.0, 1.7 + LATENCY, 3),
        ([effects.detector_slow(0.2), effects.detector_slow(0.3)], 1.0, 1.5 + LATENCY, 3),
        ([effects.detector_finds_nothing()], 1.0, 1.0 + LATENCY, 0),
    ],
)
def test_a_detector_answers_late_or_not_or_sees_nothing(
    script: list[Effect], asked: float, due: float, found: int | None
) -> None:
    cell = cell_with(*script, start=1.0 if asked else 0.0, end=3.0)
    wait(cell, asked)
    request = ask(cell)
    assert answered(cell, request) == pytest.approx(due, abs=0.01)
    if found is None:
        with pytest.raises(Unavailable, match=r"the detector is dead \(injected fault\)"):
            request.result()
    else:
        assert len(request.result().confident) == found


def test_an_unsure_detector_sees_everything_and_believes_nothing() -> None:
    cell = cell_with(effects.detector_unsure())
    request = ask(cell)
    answered(cell, request)
    answer = request.result()
    assert (answer.confident, [one.label for one in answer.doubtful]) == ((), list(PLACES))
    threshold = answer.error_rates.threshold
    assert [one.confidence for one in answer.doubtful] == pytest.approx([0.9 * threshold] * 3)


@pytest.mark.parametrize("share", [0.2, 0.8])
@pytest.mark.parametrize("name", ["seal_breaks", "arm_collides"])
def test_it_happens_so_far_on_the_way(name: str, share: float) -> None:
    cell: Any = cell_with(getattr(effects, name)(fraction=share))
    hold(cell)
    start = cell.cell.arm.tool_pose.position
    whole = follow(cell)
    while not cell.events:
        cell.advance()
    gone = float(np.linalg.norm(cell.cell.arm.tool_pose.position - start))
    assert gone / whole == pytest.approx(share, abs=0.03)
    if cell.events[0].name == "seal_breaks":
        assert not cell.fake.tool.holding and not cell.cell.arm.at_rest
        assert cell.events[0].object == "cube" and cell.events[0].position[2] > 0.1, "it hung in the air"
        assert cell.fake.world.objects[0].position[2] == pytest.approx(0.025)
    else:
        assert cell.fake.tool.holding and cell.cell.arm.at_rest
        assert cell.cell.arm.collision == "the arm ran into something"


def test_a_seal_breaks_at_once_only_where_something_is_held() -> None:
    cell: Any = cell_with(effects.seal_breaks(None))
    cell.advance()
    assert cell.events == []
    hold(cell)
    cell.advance()
    assert (cell.fake.tool.holding, len(cell.events)) == (False, 1)
    hold(cell)
    cell.advance()
    assert cell.fake.tool.holding, "it happens once"


def test_a_seal_breaks_over_a_wrong_bin() -> None:
    cell: Any = cell_with(effects.seal_breaks_over_wrong_bin())
    follow(cell)
    cell.advance()
    hold(cell)
    cell.fake.world.held_object.position[:2] = cell.cell.bins["red_bin"].slots[0][:2]
    cell._update_occurrences()
    assert cell.fake.tool.holding, "the red bin is right for a cube"
    cell.fake.world.held_object.position[:2] = cell.cell.bins["blue_bin"].slots[0][:2]
    cell._update_occurrences()
    assert not cell.fake.tool.holding


def test_a_tool_that_sticks_lets_go_when_it_is_opened_once_more() -> None:
    cell: Any = cell_with(effects.tool_does_not_release(), end=0.1)
    cell.cell.tool.open()
    assert cell.events == []
    hold(cell)
    cell.cell.tool.open()
    wait(cell, 0.1)
    assert cell.fake.tool.holding and [one.object for one in cell.events] == ["cube"]
    cell.cell.tool.open()
    assert not cell.fake.tool.holding


@pytest.mark.parametrize(
    ("effect", "sealed"),
    [
        (effects.seal_fails(), False),
        (effects.object_unsealable(2), True),
        (effects.object_unsealable(1), False),
    ],
)
def test_nothing_seals_or_one_object_does_not(effect: Effect, sealed: bool) -> None:
    cell: Any = cell_with(effect)
    cell.fake.arm.set_tool_position(np.array([*PLACES["cube"], 0.05]))
    cell.cell.tool.close()
    assert (cell.fake.tool.holding, bool(cell.events)) == (sealed, not sealed)


@pytest.mark.parametrize(("is_blocked", "error"), [(False, Unreachable), (True, Blocked)])
def test_no_way_is_found_after_the_usual_time(is_blocked: bool, error: type[Exception]) -> None:
    cell: Any = cell_with(effects.no_path(is_blocked=is_blocked))
    planning = cell.cell.arm.plan("aside")
    assert not planning.ready
    wait(cell, 1.0)
    assert planning.ready
    with pytest.raises(error, match="injected fault"):
        planning.result()
    result = run_skill(MoveToScan, cell, inputs={"pose": "aside"})
    assert (result.status, cell.fake.arm.commands) == ("FAILURE", [])


def test_an_occluded_object_is_not_seen_and_occlusion_is_recorded_once_per_control_step() -> None:
    cell: Any = cell_with(effects.workspace_occluded())
    assert run_skill(Detect, cell).reason == "hidden"
    assert not cell.cell.camera.sees_table() and not cell.cell.camera.capture().visible.any()
    assert [one.name for one in cell.events] == ["workspace_occluded"]
    assert run_skill(Detect, cell, inputs={"hidden": "pass"}).outputs["detections"].confident == ()


def test_no_detection_can_be_localized() -> None:
    cell: Any = cell_with(effects.no_depth())
    with pytest.raises(NoDepth, match=r"the frame has no depth there \(injected fault\)"):
        cell.cell.localizer.localize(None)


@pytest.mark.parametrize(("which", "gone"), [(1, "cube"), (2, "sphere"), ("nearest", "duck"), (4, "")])
def test_an_object_is_meant_by_its_number_or_by_where_it_is(which: Any, gone: str) -> None:
    cell: Any = cell_with(effects.object_removed(which))
    cell.advance()
    assert labels(cell) == [label for label in PLACES if label != gone]
    assert [one.object for one in cell.events] == [gone] * bool(gone)


def test_the_nearest_is_none_that_lies_in_a_bin_or_hangs_at_the_tool() -> None:
    cell: Any = cell_with(effects.object_removed("nearest"))
    hold(cell, "duck")
    cell.fake.world.objects[0].position[:2] = cell.cell.bins["red_bin"].slots[0][:2]
    cell.advance()
    assert labels(cell) == ["cube", "duck"]


def node(cell: FaultyCell, item: str) -> None:
    cell.on_event(at(1, NodeStarted("tree/Approach", "Approach", item)))


def test_the_object_of_a_node_is_what_the_ledger_takes_for_its_item() -> None:
    def removed(state: str, near: float = 0.0) -> list[str]:
        cell: Any = cell_with()
        script = [during("*/Approach", effects.object_removed())]
        cell = FaultyCell(cell.fake, script)
        look = run_skill(Detect, cell).outputs["detections"]
        places = [Observation(one, np.array([*PLACES[one.label], 0.025]), 0.003) for one in look.confident]
        items = {one.label: one.item for one in cell.cell.ledger.observe(look, places)}
        item = items["sphere"]
        cell.inner.world.objects[1].position[0] += near
        if state != "seen":
            cell.inner.world.held_object = cell.inner.world.objects[1]
            cell.cell.ledger.record_touch(item)
            cell.cell.ledger.record_grasp(item)
        if state == "placed":
            cell.cell.ledger.record_placement(item, "blue_bin")
        node(cell, item)
        return [thing.label for thing in cell.inner.world.objects]

    assert removed("seen") == removed("held") == removed("seen", 0.04) == ["cube", "duck"]
    assert removed("placed") == removed("seen", 0.06) == list(PLACES)


def test_an_object_that_is_moved_is_out_of_the_tool_and_at_rest_elsewhere() -> None:
    cell: Any = cell_with(effects.object_moved((0.1, -0.05), 3))
    hold(cell, "duck")
    cell._update_occurrences()
    duck = cell.fake.world.objects[2]
    assert duck.position[:2] == pytest.approx([0.55, 0.15])
    assert not cell.fake.tool.holding
    assert duck.rest_positions[-1] == pytest.approx(duck.position)


def test_with_a_share_an_object_waits_until_the_arm_is_so_far() -> None:
    cell: Any = cell_with(effects.object_removed("nearest", fraction=0.5))
    wait(cell, 0.2)
    assert len(labels(cell)) == 3
    follow(cell)
    began = cell.cell.clock.now
    while len(labels(cell)) == 3:
        cell.advance()
    half = cell.cell.clock.now - began
    while not cell.cell.arm.at_rest:
        cell.advance()
    assert half == pytest.approx((cell.cell.clock.now - began) / 2, abs=0.02)


X, Y = (0.4, 0.7), (-0.3, 0.3)


@pytest.mark.parametrize(
    ("x", "y", "neighbour", "place"),
    [
        (X, Y, None, (0.66, -0.15)),
        (X, (-0.16, 0.3), (0.66, -0.15), (0.6, -0.09)),
        ((0.59, 0.61), (-0.16, -0.14), None, (0.6, -0.15)),
    ],
    ids=["free", "a neighbour in the way", "no room"],
)
def test_an_object_is_bumped_aside_to_the_first_free_place(
    x: tuple[float, float], y: tuple[float, float], neighbour: Any, place: tuple[float, float]
) -> None:
    cell: Any = cell_with(effects.object_bumped(x, y, 1))
    if neighbour:
        cell.fake.world.put("cube", *neighbour)
    cell.advance()
    assert cell.fake.world.objects[0].position[:2] == pytest.approx(place)
    assert bool(cell.events) is (place != PLACES["cube"])
