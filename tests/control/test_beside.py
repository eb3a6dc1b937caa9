"""Beside something else, for as long as that takes."""

from __future__ import annotations

from typing import Any

import pytest

from executive.control.beside import Beside
from executive.errors import Fault


def test_it_ends_with_its_lead_and_halts_the_others(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Beside(site(), [leaf("A", "R R S"), leaf("B", "R R R R S"), leaf("C", "R R R R lost")])
    assert ticks(node) == "RRS"
    assert log == ["A starts", "B starts", "C starts", "B halted", "C halted"]


def test_the_leads_failure_is_its_own(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Beside(site(), [leaf("A", "R lost"), leaf("B", "R R R S")])
    assert ticks(node) == "RF"
    assert str(node.failure) == "A.lost"
    assert log[-1] == "B halted"


def test_what_ends_beside_the_lead_is_not_run_again(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    assert ticks(Beside(site(), [leaf("A", "R R R S"), leaf("B", "R S")])) == "RRRS"
    assert log == ["A starts", "B starts"]


def test_a_failure_beside_the_lead_is_told_and_changes_nothing(
    leaf: Any, site: Any, ticks: Any, events: Any
) -> None:
    assert ticks(Beside(site(), [leaf("A", "R R S"), leaf("B", "R stuck")])) == "RRS"
    told = [(event["choice"], event["reason"]) for event in events if event["kind"] == "choice"]
    assert told == [("go on without it", "B.stuck")]


def test_a_fault_beside_the_lead_ends_everything(leaf: Any, site: Any) -> None:
    def broken() -> None:
        raise Fault("the camera is gone", "B")

    other = leaf("B", "R R")
    other.update = broken  # type: ignore[method-assign]
    node = Beside(site(), [leaf("A", "R R S"), other])
    with pytest.raises(Fault, match="the camera is gone"):
        node.tick_once()


def test_it_starts_anew(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Beside(site(), [leaf("A", "R S", "R S"), leaf("B", "R R R S", "R R R S")])
    assert ticks(node) + ticks(node) == "RSRS"
    assert log == ["A starts", "B starts", "B halted"] * 2
