"""Faults on the fake cell: when they happen, what they do there, and how skills fail."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from events import at

from executive.cell.frame import Observation
from executive.cell.protocols import Request
from executive.cell.tools import ToolMeasurement
from executive.errors import InputError, NoDepth, Unavailable, Unreachable
from executive.events import FaultInjected, NodeEnded, NodeStarted, ToolCommanded
from executive.testing import faults as effects
from executive.testing.fake_cell import FakeCell
from executive.testing.faults import after, between, during
from executive.testing.faulty_cell import Effect, FaultyCell, ScheduledFault
from executive.testing.run_mission import run_mission
from executive.testing.run_skill import run_skill
from skills.detect import Detect
from skills.move_to_scan import MoveToScan

LATENCY = 0.05
PLACES = {"cube": (0.6, -0.15), "sphere": (0.65, 0.1), "duck": (0.45, 0.2)}
X = (0.4, 0.7)
Y = (-0.3, 0.3)


class Case:
    """A faulty cell with three objects, the duck nearest to the tool, and the events of its faults."""

    def __init__(self, *script: Effect | ScheduledFault, end: float = 100.0) -> None:
        self.fake = FakeCell()
        for label, place in PLACES.items():
            self.fake.world.put(label, *place)
        self.events: list[Any] = []
        faults = [between(0.0, end, one) if isinstance(one, Effect) else one for one in script]
        self.cell = FaultyCell(self.fake, faults, self.events.append)
        self.parts = self.cell.cell

    @property
    def labels(self) -> list[str]:
        return [one.label for one in self.cell.world.objects]

    def hold(self, label: str = "cube") -> None:
        self.fake.world.held_object = next(one for one in self.fake.world.objects if one.label == label)

    def wait(self, condition: Callable[[], bool]) -> float:
        """Advance the cell until the condition holds; return the time on its clock [s]."""
        while not condition():
            assert self.parts.clock.now < 50.0, "the condition never holds"
            self.cell.advance()
        return self.parts.clock.now

    def start_motion(self) -> float:
        """Begin a motion; return its duration [s]."""
        planning = self.parts.arm.plan("aside")
        self.wait(lambda: planning.ready)
        self.parts.arm.start(planning.result())
        return planning.result().duration

    def request(self) -> Request:
        return self.parts.detectors["embedded"].request(self.parts.camera.capture(), "table")


@pytest.mark.parametrize(("activations", "missed"), [((1, 3), [1, 3]), ((), [1, 2, 3])])
def test_a_fault_occurs_in_its_activations(activations: tuple[int, ...], missed: list[int]) -> None:
    result = run_mission(
        "sort_overhead", faults=[during("*/Grasp", effects.grip_fails(), activations=activations)]
    )
    ends = [
        one.event for one in result.events if isinstance(one.event, NodeEnded) and one.event.skill == "Grasp"
    ]
    failed = [number for number, end in enumerate(ends, start=1) if end.status == "FAILURE"]
    assert failed[: len(missed)] == missed
    assert len(failed) == len(missed) or not activations
    assert (len(result.list_injected_faults()), result.agrees) == (len(failed), True)


def test_a_fault_lasts_from_its_start_until_before_its_end() -> None:
    script = [between(1.0, 3.0, effects.detector_dead()), after(3.0, effects.grip_fails())]
    result = run_mission("sort_overhead", faults=script)
    injected = [one for one in result.events if isinstance(one.event, FaultInjected)]
    dead = [one.clock for one in injected if one.event == FaultInjected("detector_dead", "", "", "", [])]
    assert dead and 1.0 <= min(dead) <= max(dead) < 3.0
    closed = [one.clock for one in result.events if one.event == ToolCommanded("close")]
    assert [one.clock for one in injected[len(dead) :]] == [clock for clock in closed if clock >= 3.0]


def test_a_fault_of_a_node_is_recorded_with_node_item_and_object() -> None:
    script = [
        during("*/Transit", effects.grip_lost(), activations=1),
        between(500.0, 600.0, effects.no_depth()),
    ]
    result = run_mission("sort_overhead", faults=script)
    (fault,) = result.list_injected_faults()
    assert (fault.name, fault.node.rpartition("/")[2]) == ("grip_lost", "Transit")
    assert fault.item.startswith(f"{fault.object}-") and len(fault.position) == 3
    assert result.list_failure_reasons("*/Transit") == ["dropped"]
    assert (result.status, result.agrees) == ("SUCCESS", True)


def test_the_world_of_an_unknown_cell_cannot_be_changed() -> None:
    members = dict.fromkeys(("accounts", "log_to", "visuals", "audit", "close"))
    strange: Any = SimpleNamespace(**members, cell=FakeCell().cell, advance=lambda: None)
    with pytest.raises(InputError, match="not a SimpleNamespace"):
        FaultyCell(strange, [after(0.0, effects.object_removed(1))]).advance()


def test_an_operator_asks_for_a_scan_and_quits() -> None:
    script = [
        during("*/AwaitRequest", effects.operator_asks_rescan(), activations=1),
        during("*/AwaitRequest", effects.operator_quits(), activations=3),
    ]
    result = run_mission("pick_on_request", requests=["cube", "cube"], faults=script)
    assert result.list_failure_reasons("*/AwaitRequest") == ["rescan", "quit"]


@pytest.mark.parametrize(
    ("effect", "due", "found"),
    [
        (effects.detector_dead(), LATENCY, None),
        (effects.detector_hangs(), 3.0, 3),
        (effects.detector_finds_nothing(), LATENCY, 0),
    ],
)
def test_a_detector_answers_late_or_not_or_finds_nothing(
    effect: Effect, due: float, found: int | None
) -> None:
    case = Case(effect, end=3.0)
    request = case.request()
    assert case.wait(lambda: request.ready) == pytest.approx(due, abs=0.01)
    if found is None:
        with pytest.raises(Unavailable, match="injected fault"):
            request.result()
    else:
        assert len(request.result().confident) == found
    late = case.wait(lambda: case.parts.clock.now >= 3.0)
    request = case.request()
    assert case.wait(lambda: request.ready) == pytest.approx(late + LATENCY, abs=0.01)
    assert len(request.result().confident) == 3


def test_an_unsure_detector_finds_everything_below_its_threshold() -> None:
    case = Case(effects.detector_unsure())
    request = case.request()
    case.wait(lambda: request.ready)
    answer = request.result()
    assert (answer.confident, [one.label for one in answer.doubtful]) == ((), list(PLACES))
    confidences = [one.confidence for one in answer.doubtful]
    assert confidences == pytest.approx([0.9 * answer.error_rates.threshold] * 3)


@pytest.mark.parametrize("fraction", [0.2, 0.8])
@pytest.mark.parametrize("name", ["grip_lost", "arm_collides", "object_removed"])
def test_an_effect_waits_for_a_fraction_of_a_motion(name: str, fraction: float) -> None:
    case = Case(getattr(effects, name)(fraction=fraction))
    case.cell.advance()
    assert case.events == [], "no motion has begun"
    case.hold()
    duration = case.start_motion()
    start = case.parts.clock.now
    assert case.wait(lambda: bool(case.events)) - start == pytest.approx(fraction * duration, abs=0.01)
    assert case.fake.tool.holding is (name != "grip_lost")
    assert case.parts.arm.at_rest is (name == "arm_collides")
    if name == "grip_lost":
        assert case.events[0].object == "cube" and case.events[0].position[2] > 0.1, "it hung in the air"
        assert case.fake.world.objects[0].position[2] == pytest.approx(0.025)
    if name == "arm_collides":
        assert case.parts.arm.collision == "the arm ran into something"


def test_a_seal_breaks_once_and_only_if_an_object_is_held() -> None:
    case = Case(effects.grip_lost(None))
    case.cell.advance()
    assert case.events == []
    for is_holding in (False, True):
        case.hold()
        case.cell.advance()
        assert (case.fake.tool.holding, len(case.events)) == (is_holding, 1)


@pytest.mark.parametrize(
    ("effect", "is_holding"),
    [
        (effects.grip_fails(), False),
        (effects.object_ungrippable(2), True),
        (effects.object_ungrippable(1), False),
    ],
)
def test_nothing_seals_or_one_object_does_not(effect: Effect, is_holding: bool) -> None:
    case = Case(effect)
    case.fake.arm.set_tool_position(np.array([*PLACES["cube"], 0.05]))
    case.parts.tool.close()
    assert (case.fake.tool.holding, len(case.events)) == (is_holding, int(not is_holding))


def test_a_tool_that_sticks_opens_after_the_fault() -> None:
    case = Case(effects.tool_does_not_release(), end=0.1)
    case.parts.tool.open()
    assert case.events == []
    case.hold()
    case.parts.tool.open()
    case.wait(lambda: case.parts.clock.now >= 0.1)
    assert case.fake.tool.holding and [one.object for one in case.events] == ["cube"]
    case.parts.tool.open()
    assert not case.fake.tool.holding


def test_no_path_is_found_after_the_usual_time() -> None:
    case = Case(effects.no_path())
    planning = case.parts.arm.plan("aside")
    assert not planning.ready
    case.wait(lambda: planning.ready)
    with pytest.raises(Unreachable, match="injected fault"):
        planning.result()
    result = run_skill(MoveToScan, case.cell, inputs={"pose": "aside"})
    assert (result.status, case.fake.arm.commands) == ("FAILURE", [])


def test_an_occluded_table_is_not_seen_and_is_recorded_once_per_control_step() -> None:
    case = Case(effects.workspace_occluded(), effects.no_depth())
    assert run_skill(Detect, case.cell).reason == "hidden"
    assert not case.parts.camera.sees_table()
    assert [one.name for one in case.events] == ["workspace_occluded"]
    detections: Any = run_skill(Detect, case.cell, inputs={"hidden": "pass"}).outputs["detections"]
    with pytest.raises(NoDepth, match="injected fault"):
        case.parts.localizer.localize(detections)


@pytest.mark.parametrize(("choice", "gone"), [(1, "cube"), (2, "sphere"), ("nearest", "duck"), (4, "")])
def test_an_object_is_chosen_by_its_number_or_place(choice: Any, gone: str) -> None:
    case = Case(effects.object_removed(choice))
    case.cell.advance()
    assert case.labels == [label for label in PLACES if label != gone]
    assert [one.object for one in case.events] == [gone] * bool(gone)


def test_the_nearest_object_is_neither_in_a_bin_nor_held() -> None:
    case = Case(effects.object_removed("nearest"))
    case.hold("duck")
    case.fake.world.objects[0].position[:2] = case.parts.bins["red_bin"].slots[0][:2]
    case.cell.advance()
    assert case.labels == ["cube", "duck"]


@pytest.mark.parametrize(
    ("state", "offset", "is_removed"),
    [
        ("seen", 0.0, True),
        ("held", 0.0, True),
        ("seen", 0.04, True),
        ("placed", 0.0, False),
        ("seen", 0.06, False),
    ],
)
def test_the_object_of_a_node_is_that_of_its_item(state: str, offset: float, is_removed: bool) -> None:
    case = Case(during("*/Approach", effects.object_removed()))
    ledger = case.parts.ledger
    look: Any = run_skill(Detect, case.cell).outputs["detections"]
    places = [Observation(one, np.array([*PLACES[one.label], 0.025]), 0.003) for one in look.confident]
    item = {one.label: one.item for one in ledger.observe(look, places)}["sphere"]
    case.fake.world.objects[1].position[0] += offset
    if state != "seen":
        case.hold("sphere")
        ledger.record_measurement(item, ToolMeasurement())
        ledger.record_grasp(item)
    if state == "placed":
        ledger.record_placement(item, "blue_bin")
    case.cell.on_event(at(1, NodeStarted("tree/Approach", "Approach", item)))
    assert case.labels == ["cube", *["sphere"] * (not is_removed), "duck"]


def test_a_moved_object_leaves_the_tool_and_rests_elsewhere() -> None:
    case = Case(effects.object_moved((0.1, -0.05), 3))
    case.hold("duck")
    case.parts.camera.sees_table()
    assert case.fake.world.objects[2].position[:2] == pytest.approx([0.55, 0.15])
    assert not case.fake.tool.holding


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
    case = Case(effects.object_bumped(x, y, 1))
    if neighbour:
        case.fake.world.put("cube", *neighbour)
    case.cell.advance()
    assert case.fake.world.objects[0].position[:2] == pytest.approx(place)
    assert bool(case.events) is not math.isclose(math.dist(place, PLACES["cube"]), 0.0)
