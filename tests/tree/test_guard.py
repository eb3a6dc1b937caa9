"""Guard, and the gate that keeps the events of a rechecked condition out of the journal."""

from __future__ import annotations

from typing import Any

import pytest
from build_nodes import sequence

from executive.errors import Fault
from executive.events import NodeEnded, NodeStarted
from executive.testing.run_mission import make_substitute, run_mission
from executive.tree.sequences import Guard
from skills.conditions import IsReachable
from tests.node_behaviours import build


def make_guard(site: Any, holds: Any, do: Any) -> Any:
    return build(site("guard"), Guard, holds=holds, do=do)


@pytest.mark.parametrize(
    ("condition", "body", "statuses", "reason"),
    [
        (("S",), ("R R S",), "RRS", None),
        (("S",), ("R lost",), "RF", "B.lost"),
        (("off",), ("R S",), "F", "guard.broken"),
        (("S", "S", "off"), ("R R R S",), "RRF", "guard.broken"),
    ],
)
def test_a_guard(
    leaf: Any, site: Any, ticks: Any, condition: Any, body: Any, statuses: str, reason: str | None
) -> None:
    node = make_guard(site, leaf("C", *condition), leaf("B", *body))
    assert ticks(node) == statuses
    assert (str(node.failure) if node.failure else None) == reason


def test_a_broken_guard_halts_its_body_and_names_the_cause(
    leaf: Any, site: Any, ticks: Any, log: Any
) -> None:
    node = make_guard(site, leaf("C", "S", "off"), leaf("B", "R R S"))
    ticks(node)
    assert node.failure.message == "C.off: off happened"
    assert log == ["C starts", "B starts", "C starts", "B halted"]


def test_a_condition_that_takes_time_is_a_fault(leaf: Any, site: Any) -> None:
    with pytest.raises(Fault, match="C is a condition, but returned RUNNING"):
        make_guard(site, leaf("C", "R S"), leaf("B", "R S")).tick_once()


def test_only_the_first_check_and_a_changed_check_are_events(
    leaf: Any, site: Any, ticks: Any, events: Any
) -> None:
    condition = sequence(site("guard/holds"), [leaf("C", *["S"] * 5, "off")])
    ticks(make_guard(site, condition, leaf("B", "R " * 9 + "S")))
    holds = [event for event in events if event.node == "guard/holds"]
    assert holds == [
        NodeStarted("guard/holds"), NodeEnded("guard/holds", "SUCCESS"),
        NodeStarted("guard/holds"),
        NodeEnded("guard/holds", "FAILURE", reason="C.off", message="off happened", origin="C"),
    ]  # fmt: skip


def test_a_guard_in_a_guard_keeps_its_events_to_itself(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    inner = build(site("in"), Guard, holds=sequence(site("in/holds"), [leaf("C")]), do=leaf("B", "R R R S"))
    ticks(make_guard(site, sequence(site("guard/holds"), [leaf("D")]), inner))
    starts = [event.node for event in events if isinstance(event, NodeStarted)]
    assert starts == ["guard", "guard/holds", "in", "in/holds"]


MISSION = """
mission: guarded
cell: cells/overhead.yaml
routes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}
tree:
  - [MoveToScan, Detect, Localize, SelectTarget]
  - guard:
      holds: {all: [IsFresh, run.elapsed < 60, {any: [IsHolding, {not: IsHolding}]}]}
      do: [Approach, Grasp]
  - try:
      - guard: {holds: {all: [run.elapsed < $limit, {not: IsReachable}]}, do: Transit}
      - Release
    catch: [{on: guard.broken, do: [ConfirmGrasp, PutDown]}]
params: {limit: 30.0}
"""


def test_a_broken_guard_stops_the_arm(tmp_path: Any) -> None:
    (tmp_path / "m.yaml").write_text(MISSION)
    checks = 0

    def run(self: Any, cell: Any) -> None:
        nonlocal checks
        checks += 1
        if checks <= 100:
            raise self.failure("unreachable", "not yet")

    late = make_substitute(IsReachable, "Late", run)
    result = run_mission(tmp_path / "m.yaml", substitutes={"*:try/*/IsReachable": late})
    ends = [timed.event for timed in result.events if isinstance(timed.event, NodeEnded)]
    first = next(index for index, end in enumerate(ends) if end.reason == "guard.broken")
    assert (ends[first - 1].skill, ends[first - 1].status) == ("Transit", "INVALID")
    assert ends[first].message == "not.inverted: IsReachable succeeded"
    assert (result.status, result.agrees, result.cell.arm.at_rest) == ("INCOMPLETE", True, True)
    assert len(result.list_activated_nodes("*:try/*/IsReachable")) == 2
