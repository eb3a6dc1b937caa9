"""A disturbed cell is the cell it wraps, but for what is done to it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from executive.discovery import discover
from executive.errors import InputError
from executive.events import ignore
from executive.mission.load import load_mission
from executive.runtime.run import Run
from executive.testing.disturbances import (
    DisturbedCell,
    after,
    disturbed,
    during,
    object_removed,
    seal_fails,
    table_bumped,
    workspace_hidden,
)
from executive.testing.disturbances.hand import hand_of
from executive.testing.fake_cell import FakeCell, SilentOperator, bare_table
from executive.testing.wrapped_cell import WrappedCell
from executive.workcell import CellOptions


def test_everything_else_is_the_cell_it_wraps() -> None:
    fake = FakeCell()
    cell = DisturbedCell(fake, [])
    for _ in range(3):
        cell.advance()
    assert (cell.steps, cell.cell.clock.now) == (3, fake.cell.clock.now)
    assert cell.accounts is fake.ledger
    assert cell.cell.ledger is fake.ledger
    assert cell.cell.bins is fake.cell.bins
    assert cell.audit() == fake.audit()
    assert cell.inner is fake


def test_it_is_a_kind_of_cell_that_any_run_can_have() -> None:
    kind = disturbed(FakeCell, [during("*/Grasp", seal_fails(), nth=1)])
    run = Run(load_mission("sort_overhead", discover()), discover(), seed=0, kind=kind, requests=())
    assert isinstance(run.workcell, DisturbedCell)
    run.observe(run.workcell.hear)
    told: list[Any] = []
    run.observe(lambda event: told.append(event.data) if event.kind == "disturbance" else None)
    assert run.execute().status == "SUCCESS"
    assert [data["what"] for data in told] == ["seal_fails"]


def test_a_kind_is_used_for_one_run_after_the_other() -> None:
    kind = disturbed(FakeCell, [after(0.0, table_bumped())])
    options = CellOptions(SilentOperator(), base=Path())
    for _ in range(2):
        cell = kind(bare_table(), seed=0, routes={}, emit=ignore, options=options)
        cell.advance()
        assert cell.cell.ledger.epoch == 1


def test_what_acts_on_several_questions_at_once_is_told_once_a_control_step() -> None:
    told: list[str] = []
    script = [after(0.0, workspace_hidden())]
    cell = DisturbedCell(FakeCell(), script, lambda kind, **data: told.append(data["what"]))
    for count in (1, 2):
        assert not cell.cell.camera.sees_table()
        assert not cell.cell.camera.capture().visible.any()
        assert told == ["workspace_hidden"] * count
        cell.advance()


def test_a_cell_whose_truth_nobody_knows_has_no_audit() -> None:
    class Hardware(WrappedCell):
        """A cell without an audit."""

        def audit(self) -> None:
            return None

    assert DisturbedCell(Hardware(FakeCell()), []).audit() is None


def test_a_hand_reaches_through_whatever_is_wrapped_around_a_cell() -> None:
    fake = FakeCell()
    fake.world.put("cube", 0.5, 0.0)
    assert [thing.label for thing in hand_of(WrappedCell(WrappedCell(fake))).things] == ["cube"]


def test_a_cell_of_an_unknown_kind_needs_a_hand_of_its_own() -> None:
    class Strange:
        """No cell that anybody knows."""

        cell = FakeCell().cell

        def advance(self) -> None:
            """Do nothing."""

    strange: Any = Strange()
    cell = DisturbedCell(strange, [after(0.0, object_removed(1))])
    with pytest.raises(
        InputError, match="nobody knows how to reach into a Strange; give `disturbed` a `hand`"
    ):
        cell.advance()
    kind = disturbed(
        lambda **options: strange, [after(0.0, object_removed(1))], hand=lambda _: hand_of(FakeCell())
    )
    kind().advance()
