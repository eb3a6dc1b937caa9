"""Taking a run up again that was cut off: what was under way begins anew, in a cell that nobody watched."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.protocols import Cell
from executive.cell.workcell import CellPast
from executive.replay.input_log import Past
from executive.tree.skill_leaf import SkillNode


def reconcile(cell: Cell, last_intent: str) -> None:
    """Make the ledger agree with the tool's sensor, and put everything on the table in doubt.

    Nobody watched the cell since the run was cut off: whatever lies there may have been moved, and what hung
    on the tool may have fallen.

    Args:
        cell: The cell, its arm at rest.
        last_intent: What the tool was told last, `open` or `close`; "" where it was told nothing.
    """
    believed, holding = cell.ledger.in_tool(), cell.tool.holding
    if believed is None and holding:
        # It was sealed and never lifted: the run had not yet known that it holds.
        cell.tool.open()
    elif believed is not None and not holding and last_intent == "close":
        cell.tool.open()
        cell.ledger.dropped(believed)
    # What the run itself had let go hangs nowhere: the skill that did begins anew and says where it is.
    cell.ledger.bumped()


def cell_past(past: Past, log: Path) -> CellPast:
    """Return the state of a cell at the end of a recorded run, from the record and the log of its world."""
    frames, turns = (past.number_of_answers(f"camera.{name}") for name in ("frame", "next_pose"))
    return CellPast(log, past.last_tick, frames, turns)


def begin_anew(root: Behaviour, rest: Callable[[], None]) -> None:
    """End every skill under way, let the arm come to rest, and have each begin anew at the coming tick.

    Control nodes stay where they are: attempts count on, variables keep their values.
    """
    running = [
        node for node in root.iterate() if isinstance(node, SkillNode) and node.status is Status.RUNNING
    ]
    for node in running:
        node.stop(Status.INVALID)
    rest()
