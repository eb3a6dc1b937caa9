"""The nodes `holds`, `if`, `set`, `fail` and `finish`, in missions on a fake cell."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from executive.events import BranchChosen
from executive.testing.run_mission import MissionResult, run_mission

Execute = Callable[..., MissionResult]

HEAD = """
mission: shown
cell: cells/overhead.yaml
library: library/sorting.yaml
routes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}
"""


@pytest.fixture
def execute(tmp_path: Path) -> Execute:
    """Function that runs a mission on a fake cell with two cubes and a duck."""

    def run(text: str, **options: Any) -> MissionResult:
        def put_three(cell: Any) -> None:
            cell.world.objects.clear()
            for place in (("cube", 0.45, 0.15), ("cube", 0.6, -0.15), ("duck", 0.45, -0.1)):
                cell.world.put(*place)

        path = tmp_path / "shown.yaml"
        path.write_text(HEAD + text)
        return run_mission(path, arrange=put_three, **options)

    return run


def list_choices(result: MissionResult) -> list[str]:
    """Return the decisions of all control nodes, in order."""
    return [timed.event.choice for timed in result.events if isinstance(timed.event, BranchChosen)]


def test_a_false_expression_fails_with_the_present_values(execute: Execute) -> None:
    result = execute("variables: {n: 2}\ntree: [{use: look}, {holds: $n > 3 and run.placed > 0}]")
    assert (result.status, result.reason) == ("FAILURE", "holds.false")
    assert result.message == "($n > 3) and (run.placed > 0) is false: $n = 2, run.placed = 0"


@pytest.mark.parametrize(("n", "seconds"), [(1, 0.2), (2, 0.4), (3, 0.4)])
def test_one_branch_of_if_runs(execute: Execute, n: int, seconds: float) -> None:
    branches = "then: {Wait: {seconds: 0.2}}, else: {Wait: {seconds: 0.4}}"
    result = execute(f"variables: {{n: {n}}}\ntree: {{if: {{holds: $n < 2, {branches}}}}}")
    assert (result.status, result.cell.cell.clock.now) == ("SUCCESS", pytest.approx(seconds, abs=0.01))


def test_without_else_a_false_condition_is_a_success(execute: Execute) -> None:
    result = execute("tree: {if: {holds: run.placed > 0, then: {fail: never}}}")
    assert (result.status, list_choices(result)) == ("SUCCESS", ["else"])


def test_a_failure_of_a_branch_is_passed_on(execute: Execute) -> None:
    result = execute('tree: {if: {holds: run.placed < 1, then: {fail: "{run.placed} placed", as: empty}}}')
    assert (result.status, result.reason, result.message) == ("FAILURE", "fail.empty", "0 placed")


def test_handlers_name_a_failure_by_its_label(execute: Execute) -> None:
    result = execute(
        "tree:\n"
        "  try: {fail: no more, as: enough}\n"
        "  catch: [{on: fail.enough, do: {Wait: {seconds: 0.1}}}]\n"
    )
    assert result.status == "SUCCESS"


def test_a_variable_counts_and_each_value_is_recorded(execute: Execute) -> None:
    result = execute(
        "variables: {n: {default: 0, min: 0, max: 9}}\n"
        "tree:\n"
        "  repeat:\n"
        "    until: = $n >= 3\n"
        "    do: [{set: n, to: '= min(9, $n + 1)'}, {Wait: {seconds: = 0.1 * $n}}]\n"
    )
    assert result.cell.cell.clock.now == pytest.approx(0.6, abs=0.05)
    assert list_choices(result) == ["$n = 0", "$n = 1", "$n = 2", "$n = 3", "done, $n >= 3"]


def test_the_variables_of_a_subtree_are_its_own_and_begin_anew(execute: Execute) -> None:
    result = execute(
        "variables: {n: 5}\n"
        "tree: [{use: count, with: {step: = $n - 3}}, {use: count, with: {step: 1}}, {holds: $n == 5}]\n"
        "trees:\n"
        "  count:\n"
        "    args: [step]\n"
        "    variables: {n: 0}\n"
        "    do: [{set: n, to: = $n + $step}, {holds: $n == $step}]\n"
    )
    assert (result.status, result.message) == ("SUCCESS", "")
    assert list_choices(result) == ["$n = 5", "$n = 0", "$n = 2", "$n = 0", "$n = 1"]


def test_a_subtree_with_returns_changes_a_variable_of_the_mission(execute: Execute) -> None:
    result = execute(
        "variables: {n: 1}\n"
        "tree: [{use: double}, {use: double}, {holds: $n == 4}]\n"
        "trees: {double: {returns: [], do: {set: n, to: = 2 * $n}}}\n"
    )
    assert (result.status, result.message) == ("SUCCESS", "")


def test_numbers_of_nodes_and_skills_are_computed_at_their_start(execute: Execute) -> None:
    result = execute(
        "variables: {n: {default: 2, min: 1, max: 9}}\n"
        "tree:\n"
        "  - repeat: {times: = $n, do: {Wait: {seconds: = $n / 10}}}\n"
        "  - try: {retry: {attempts: = $n + 1, do: [{Wait: {seconds: 0.1}}, {holds: $n > 2}]}}\n"
        "    catch: [{on: holds.false, do: succeed}]\n"
        "  - try: {timeout: {seconds: = $n / 4, do: {Wait: {seconds: 5}}}}\n"
        "    catch: [{on: timeout.timeout, do: succeed}]\n"
    )
    assert (result.status, result.cell.cell.clock.now) == (
        "SUCCESS",
        pytest.approx(0.4 + 0.3 + 0.5, abs=0.05),
    )


def test_the_end_of_a_mission_skips_open_items_with_the_reason(execute: Execute) -> None:
    result = execute(
        "tree: {parallel: [{Wait: {seconds: 60}}, [{use: look}, {finish: 'only {run.open} seen'}]]}\n"
    )
    assert (result.status, result.reason, result.agrees) == ("SUCCESS", "", True)
    assert (result.items["skipped"], result.cell.arm.at_rest) == (3, True)
    reasons = {known.reason for known in result.cell.ledger.list_items()}
    assert reasons == {"only 3 seen"}


def test_a_target_is_selected_by_an_expression(execute: Execute) -> None:
    rules = '{where: $target.label == "cube", order_by: $target.y}'
    result = execute(f"tree: [{{use: look}}, {{SelectTarget: {rules}}}, {{holds: $target.y < -0.1}}]")
    assert (result.status, result.message) == ("SUCCESS", "")
    result = execute("tree: [{use: look}, {SelectTarget: {where: $target.z > 0.5}}]")
    assert (result.status, result.reason) == ("FAILURE", "SelectTarget.unseen")


def test_a_guard_evaluates_its_expression_at_every_tick(execute: Execute) -> None:
    result = execute("tree: {guard: {holds: run.elapsed < 0.5, do: {Wait: {seconds: 2}}}}")
    assert (result.reason, result.cell.cell.clock.now) == ("guard.broken", pytest.approx(0.5, abs=0.02))
