"""The cell of a fault script: when things happen, to which kind of cell, and what is refused."""

from __future__ import annotations

import math
import pickle
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from executive.cell.workcell import CellOptions, CellWrapper
from executive.cells.fake.cell import FakeCell, SilentOperator, load_empty_cell
from executive.errors import InputError
from executive.events import FaultInjected, FrameSearched, NodeEnded, ToolCommanded, discard_event
from executive.testing import faults as effects
from executive.testing.faults import (
    FaultyCell,
    ScheduledFault,
    after,
    between,
    during,
    with_faults,
    with_probability,
)
from executive.testing.faults.script import NodeActivations
from executive.testing.faults.world_access import open_world
from executive.testing.run_mission import MissionResult, run_mission

SLIPS = effects.seal_fails()
SHARE = "a fraction of a motion must be more than 0 and less than 1"


def sorted_with(*script: ScheduledFault) -> MissionResult:
    return run_mission("sort_overhead", faults=script)


def slipped(result: MissionResult) -> list[int]:
    """Return which grasps missed, counted from 1."""
    events = (one.event for one in result.events)
    ends = [event.status for event in events if isinstance(event, NodeEnded) and event.skill == "Grasp"]
    return [number for number, status in enumerate(ends, start=1) if status == "FAILURE"]


@pytest.mark.parametrize(("nth", "missed"), [((1, 3), [1, 3]), ((), [1, 2, 3])])
def test_it_happens_in_the_activations_it_is_meant_for(nth: int | Sequence[int], missed: list[int]) -> None:
    result = sorted_with(during("*/Grasp", SLIPS, activations=nth))
    assert slipped(result)[: len(missed)] == missed
    assert len(slipped(result)) == len(missed) or nth == ()
    assert len(result.list_injected_faults()) == len(slipped(result))
    assert result.agrees


def test_it_lasts_from_one_time_until_before_another() -> None:
    result = sorted_with(between(2.0, 6.0, effects.detector_dead()))
    times = [one.clock for one in result.events if isinstance(one.event, FaultInjected)]
    assert times
    assert 2.0 <= min(times) <= max(times) < 6.0
    assert max(event.clock for event in result.events) > 6.0


def test_after_a_time_it_lasts_until_the_end() -> None:
    result = sorted_with(after(3.0, effects.seal_fails()))
    assert result.status == "INCOMPLETE"
    closed = [one.clock for one in result.events if one.event == ToolCommanded("close")]
    fault = [one.clock for one in result.events if isinstance(one.event, FaultInjected)]
    assert fault == [clock for clock in closed if clock >= 3.0]
    assert result.items["rejected"] == result.audit["left"] > 0  # type: ignore[index]


@pytest.mark.parametrize("probability", [0.0, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("seed", range(5))
def test_a_chance_is_met_as_often_as_it_says(probability: float, seed: int) -> None:
    time = with_probability(probability, "*", SLIPS, seed=seed).time
    assert isinstance(time, NodeActivations)
    share = sum(time.includes(number) for number in range(1, 401)) / 400
    # Four standard deviations.
    assert abs(share - probability) <= 4 * math.sqrt(probability * (1 - probability) / 400)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: during("*", SLIPS, activations=0), "the number of an activation must be at least 1, not 0"),
        (lambda: between(5, 5, SLIPS), "0 <= start < end, not 5 s and 5 s"),
        (lambda: after(-1, SLIPS), "not -1 s and inf s"),
        (lambda: with_probability(1.5, "*", SLIPS, seed=0), "a probability must be 0 to 1, not 1.5"),
        (lambda: effects.seal_breaks(1.0), f"{SHARE}, not 1"),
        (lambda: effects.arm_collides(fraction=0.0), f"{SHARE}, not 0"),
        (lambda: effects.object_removed(fraction=1.0), f"{SHARE}, not 1"),
        (lambda: effects.object_removed(0), "the number of an object must be at least 1, not 0"),
        (lambda: effects.object_moved((0.1, 0.0), -1), "the number of an object must be at least 1, not -1"),
        (lambda: effects.detector_slow(-0.5), "the delay of a detector must be at least 0 s, not -0.5 s"),
    ],
)
def test_a_script_that_makes_no_sense_is_refused(make, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        make()


def test_a_script_is_a_value_that_can_be_sent_to_another_process_and_used_again() -> None:
    script = [
        during("*/Grasp", SLIPS, activations=2),
        between(4.0, 9.0, effects.detector_hangs()),
        after(1.0, effects.object_moved((0.1, 0))),
    ]
    assert pickle.loads(pickle.dumps(script)) == script


def test_a_fault_of_a_node_is_recorded_with_node_item_and_object() -> None:
    result = sorted_with(
        during("*/Transit", effects.seal_breaks(), activations=1), between(500.0, 600.0, SLIPS)
    )
    (fault,) = result.list_injected_faults()
    assert (fault.name, fault.node.rpartition("/")[2]) == ("seal_breaks", "Transit")
    assert fault.item.startswith(f"{fault.object}-") and len(fault.position) == 3


def test_a_mission_waits_for_a_detector_and_a_test_for_a_mission_for_so_long_only() -> None:
    result = sorted_with(between(4.0, 9.0, effects.detector_hangs()))
    assert not [
        one for one in result.events if isinstance(one.event, FrameSearched) and 4.1 < one.clock < 9.0
    ]
    assert (result.status, result.agrees) == ("SUCCESS", True)
    script = [during("tree/look/*/Detect", effects.detector_hangs())]
    result = run_mission("sort_overhead", faults=script, timeout=5.0)
    assert result.message == "the mission has not ended after 5 s on its clock"


def test_everything_else_is_the_cell_that_it_wraps() -> None:
    fake = FakeCell()
    cell = FaultyCell(fake, [])
    for _ in range(3):
        cell.advance()
    assert (cell.steps, cell.cell.clock.now) == (3, fake.cell.clock.now)
    assert cell.accounts is cell.cell.ledger is fake.ledger
    assert cell.cell.bins is fake.cell.bins
    assert (cell.audit(), cell.inner) == (fake.audit(), fake)
    assert cell.cell.arm.q is fake.arm.q


def test_a_kind_of_cell_has_faults_in_one_run_after_the_other() -> None:
    kind = with_faults(FakeCell, [after(0.0, effects.table_bumped())])
    options = CellOptions(SilentOperator(), cell_folder=Path())
    for _ in range(2):
        cell = kind(load_empty_cell(), seed=0, routes={}, emit=discard_event, options=options)
        cell.advance()
        assert cell.cell.ledger.change_count == 1


def test_the_world_of_a_wrapped_cell_is_opened_and_that_of_an_unknown_cell_is_refused() -> None:
    fake = FakeCell()
    fake.world.put("cube", 0.5, 0.0)
    assert [thing.label for thing in open_world(CellWrapper(CellWrapper(fake))).objects] == ["cube"]
    gone = [after(0.0, effects.object_removed(1))]
    strange: Any = SimpleNamespace(cell=FakeCell().cell, accounts=None, advance=lambda: None)
    with pytest.raises(
        InputError, match="faults cannot change the world of a SimpleNamespace; pass a function `open_world`"
    ):
        FaultyCell(strange, gone).advance()
    with_faults(lambda **_: strange, gone, open_world=lambda _: open_world(fake))().advance()
    assert fake.world.objects == []
