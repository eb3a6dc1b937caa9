"""Counters of a run, which a mission may use as limits."""

from __future__ import annotations

from typing import Literal, TypeAlias

from executive.cell.protocols import Cell

CounterName: TypeAlias = Literal["placed", "rejected", "elapsed"]
"""Name of a counter: placed items, rejected items, or time since the start of the run [s]."""


def read_counter(cell: Cell, name: CounterName) -> float:
    """Return the current value of a counter."""
    return cell.clock.now if name == "elapsed" else cell.ledger.count_items(name)
