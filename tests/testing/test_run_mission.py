"""A whole mission in a test: its result, its arrangement, and its end; and the pytest plugin."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from executive.errors import Fault, InputError
from executive.events import RunEnded, RunStarted, TimedEvent
from executive.testing.fake_cell import FakeCell
from executive.testing.faults import after, detector_dead, during, grip_fails
from executive.testing.faulty_cell import FaultInjector
from executive.testing.run_mission import make_failing, run_mission
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


def test_the_cell_is_arranged_before_the_run_and_closed_after_it(look: Path) -> None:
    closed: list[str] = []

    class Cell(FakeCell):
        """Tells that it was closed."""

        def close(self) -> None:
            closed.append("closed")
            super().close()

    def arrange(cell: FakeCell) -> None:
        cell.world.objects.clear()
        cell.world.put("duck", 0.5, 0.1)

    def break_down(cell: FakeCell) -> None:
        raise ValueError("the test is wrong")

    seen: list[TimedEvent] = []
    result = run_mission(look, Cell, arrange=arrange, observers=[seen.append])
    assert (list(result.events), [row.item for row in result.ledger.list_items()]) == (seen, ["duck-1"])
    with pytest.raises(ValueError, match="the test is wrong"):
        run_mission(look, Cell, arrange=break_down)
    assert closed == ["closed"] * 2


def test_entered_and_failed_nodes_are_listed_in_order(look: Path) -> None:
    result = run_mission("sort_overhead", faults=[during("*/Grasp", grip_fails(), activations=1)])
    assert len(result.list_activated_nodes("*/Grasp")) == result.items["placed"] + 1
    assert result.list_activated_nodes("tree/look*")[0] == "tree/look/try"
    assert (result.list_failure_reasons()[0], result.list_failure_reasons("*/Grasp")) == (
        "missed",
        ["missed"],
    )
    assert result.list_failure_reasons("*/Approach") == []
    failed = run_mission(look, faults=[after(0.0, detector_dead())])
    assert (failed.status, failed.reason) == ("FAILURE", "Detect.unavailable")
    assert failed.list_failure_reasons() == ["unavailable"], "only of the skill, not of the nodes above"


def test_a_mission_that_never_ends_ends_as_a_fault(look: Path) -> None:
    result = run_mission(look, set={"wait": "1000"}, timeout=3.0)
    assert (result.status, result.message) == ("FAULT", "the mission has not ended after 3 s on its clock")
    assert result.robot_time == pytest.approx(3.0, abs=0.01)


def test_a_cell_whose_time_is_over_says_so_once_so_that_the_arm_can_be_braked() -> None:
    cell = FakeCell()
    FaultInjector([], timeout=0.01).install(cell)
    cell.advance()
    cell.advance()
    with pytest.raises(Fault, match=r"has not ended after 0\.01 s"):
        cell.advance()
    cell.advance()
    assert cell.tick_count == 4


def test_patterns_that_fit_no_node_are_refused(look: Path) -> None:
    failing = make_failing(type("Fail", (Wait,), {"reasons": ("bad",)}), "bad")
    with pytest.raises(InputError, match=r'"\*/Grasp" of grip_fails matches no path.*: tree/Wait, tree/Det'):
        run_mission(look, faults=[during("*/Grasp", grip_fails())])
    with pytest.raises(InputError, match=r'no skill node matches "Wait"; .*: tree/Wait, tree/Detect'):
        run_mission(look, substitutes={"Wait": failing})
    with pytest.raises(InputError, match="tree/Detect runs Detect, but FailingFail is not a subclass"):
        run_mission(look, substitutes={"tree/*": failing})


def test_pytest_starts_without_anything_heavy(tmp_path: Path) -> None:
    heavy = ("pybullet", "cv2", "py_trees", "onnxruntime", "numpy", "pydantic")
    code = f"import sys, executive.testing.plugin; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout.strip() == "[]", done.stderr
