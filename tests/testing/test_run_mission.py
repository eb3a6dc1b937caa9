"""A whole mission in a test: what it needs, what it says, and that it comes to an end."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from executive.cell.frame import FrameCaptured
from executive.cells.fake.cell import FakeCell
from executive.errors import Fault, InputError
from executive.events import RunEnded, RunStarted, TimedEvent
from executive.mission.load import load_mission
from executive.plugins import load_skills
from executive.run.assembly import RunOptions, assemble
from executive.testing.faults import FaultyCell, after, detector_dead, during, seal_fails
from executive.testing.run_mission import run_mission
from executive.testing.substitutes import make_endless
from skills.detect import Detect
from skills.wait import Wait

LOOK = """\
mission: look_once
cell: cells/overhead.yaml
params: {wait: 0.5}
tree:
  - Wait: {seconds: $wait}
  - Detect
  - Localize
"""


@pytest.fixture
def look(tmp_path: Path) -> Path:
    path = tmp_path / "look_once.yaml"
    path.write_text(LOOK, encoding="utf-8")
    return path


def test_a_shipped_mission_runs_by_its_name_on_the_fake_cell() -> None:
    result = run_mission("sort_overhead", seed=3)
    assert (result.status, result.reason, result.message, result.node) == ("SUCCESS", "", "", "")
    assert isinstance(result.cell, FakeCell)
    assert result.items["placed"] == len(result.cell.world.objects) >= 3
    assert (type(result.events[0].event), type(result.events[-1].event)) == (RunStarted, RunEnded)
    assert result.robot_time == result.events[-1].clock > 5.0
    assert (result.agrees, result.list_injected_faults()) == (True, [])


def test_a_mission_file_runs_with_other_values(look: Path) -> None:
    assert run_mission(look).robot_time == pytest.approx(0.55, abs=0.01)
    later = run_mission(look, set={"wait": "2.0", "cell.detectors.embedded.latency": "0.5"})
    assert later.robot_time == pytest.approx(2.5, abs=0.01)


def test_the_cell_is_arranged_before_the_run(look: Path) -> None:
    def arrange(cell: FakeCell) -> None:
        cell.world.objects.clear()
        cell.world.put("duck", 0.5, 0.1)

    seen: list[TimedEvent] = []
    result = run_mission(look, arrange=arrange, observers=[seen.append])
    assert (list(result.events), [row.item for row in result.accounts.list_items()]) == (seen, ["duck-1"])


def test_entered_and_failed_nodes_are_listed_in_order() -> None:
    result = run_mission("sort_overhead", faults=[during("*/Grasp", seal_fails(), activations=1)])
    assert len(result.list_activated_nodes("*/Grasp")) == result.items["placed"] + 1
    assert (result.list_activated_nodes("tree/look*")[0], result.list_failure_reasons()[0]) == (
        "tree/look/try",
        "missed",
    )
    assert (result.list_failure_reasons("*/Grasp"), result.list_failure_reasons("*/Approach")) == (
        ["missed"],
        [],
    )


def test_a_failure_that_only_passes_through_a_control_node_is_none_of_its_own(look: Path) -> None:
    result = run_mission(look, faults=[after(0.0, detector_dead())])
    assert (result.status, result.reason) == ("FAILURE", "Detect.unavailable")
    assert result.list_failure_reasons() == ["unavailable"]


def test_without_disturbances_a_mission_goes_as_it_always_goes() -> None:
    def without_images(events: Iterable[TimedEvent]) -> list[TimedEvent]:
        return [one for one in events if not isinstance(one.event, FrameCaptured)]

    events: list[TimedEvent] = []
    loaded, options = load_mission("sort_overhead", load_skills()), RunOptions(7, (), make_cell=FakeCell)
    run = assemble(loaded, options, [events.append])
    run.execute()
    assert without_images(run_mission("sort_overhead", seed=7).events) == without_images(events)


def test_a_mission_that_never_ends_ends_as_a_fault(look: Path) -> None:
    result = run_mission(look, substitutes={"*Detect": make_endless(Detect)}, timeout=3.0)
    assert (result.status, result.message) == ("FAULT", "the mission has not ended after 3 s on its clock")
    assert result.robot_time == pytest.approx(3.0, abs=0.01)
    assert result.cell.arm.at_rest


def test_a_cell_whose_time_is_over_says_so_once_so_that_the_arm_can_be_braked() -> None:
    cell = FaultyCell(FakeCell(), [], timeout=0.01)
    cell.advance()
    cell.advance()
    with pytest.raises(Fault, match=r"the mission has not ended after 0\.01 s on its clock"):
        cell.advance()
    cell.advance()
    assert cell.steps == 4


def test_patterns_that_fit_no_node_are_refused(look: Path) -> None:
    sentence = 'the pattern "*/Grasp" of seal_fails matches no path of a node; the paths are: tree/Wait, '
    with pytest.raises(InputError, match=sentence.replace("*", r"\*")):
        run_mission(look, faults=[during("*/Grasp", seal_fails())])
    with pytest.raises(
        InputError, match='no skill node matches "Wait"; the skill nodes are: tree/Wait, tree/Detect'
    ):
        run_mission(look, substitutes={"Wait": make_endless(Wait)})
    with pytest.raises(InputError, match="tree/Detect runs Detect, but EndlessWait is not a subclass; give"):
        run_mission(look, substitutes={"tree/*": make_endless(Wait)})


def test_the_cell_is_closed_whatever_happens(look: Path) -> None:
    closed: list[str] = []

    class Cell(FakeCell):
        """Tells that it was closed."""

        def close(self) -> None:
            closed.append("closed")
            super().close()

    def broken(cell: FakeCell) -> None:
        raise ValueError("the test is wrong")

    run_mission(look, Cell)
    with pytest.raises(ValueError, match="the test is wrong"):
        run_mission(look, Cell, arrange=broken)
    with pytest.raises(InputError):
        run_mission(look, Cell, faults=[during("nowhere", seal_fails())])
    assert closed == ["closed"] * 3
