"""What has to be true of a run that was halted, whenever that was."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.runtime.outcome import Outcome
from executive.view.figures.halt import FARTHEST, LONGEST_REST, MOST_ACCELERATION, MOST_JERK, Halt
from executive.workcell import Workcell

AFTER = 6
"""Control steps after the end of a run in which the arm must not move any more."""
STILL = 1e-5
"""Joint movement in them that is none [rad]; for a fake arm, movement of its tool [m]."""


def check_ending(outcome: Outcome, root: Behaviour) -> Iterator[str]:
    """Yield what is wrong with how the run ended, and every node that still says it is running."""
    if (outcome.status, outcome.reason) != ("HALTED", "halted"):
        yield f"the run ended as {outcome.status} {outcome.reason}: {outcome.message}"
    for node in root.iterate():
        if node.status is Status.RUNNING:
            yield f"{getattr(node, 'path', node.name)} is still running"


def check_rest(workcell: Workcell) -> Iterator[str]:
    """Yield a sentence if the arm is not at rest; lets a few control steps pass."""
    arm = workcell.cell.arm
    if not arm.at_rest:
        yield "the arm is not at rest"
    positions = [arm.q]
    for _ in range(AFTER):
        workcell.advance()
        positions.append(arm.q)
    moved = float(np.ptp(positions, axis=0).max())
    if moved > STILL:
        yield f"the arm moved by {moved:.1e} after the run had ended"


def check_braking(halt: Halt) -> Iterator[str]:
    """Yield what was longer, farther or harder than allowed on the way to rest."""
    for name, value, most, unit in (
        ("it took", halt.rest, LONGEST_REST, " s to rest"),
        ("a command was", halt.deviation, FARTHEST, " rad off the path"),
        ("the acceleration was", halt.acceleration, MOST_ACCELERATION, " of its stop limit"),
        ("the jerk was", halt.jerk, MOST_JERK, " of its stop limit"),
    ):
        if value is not None and value > most:
            yield f"{name} {value:.4g}{unit}; {most:g} is allowed"


def check_journal(entries: Sequence[Mapping[str, Any]], outcome: Outcome) -> Iterator[str]:
    """Yield what the journal lacks: it has one end, its last entry, and every node that began has ended."""
    ends = [number for number, entry in enumerate(entries) if entry["kind"] == "end"]
    if ends != [len(entries) - 1]:
        yield f"the journal has {len(ends)} ends in its {len(entries)} entries; only the last may be one"
    elif any(entries[-1][key] != getattr(outcome, key) for key in ("status", "holds", "ticks")):
        yield f"the journal ends with {entries[-1]}, and the run with {outcome}"
    running: dict[str, int] = {}
    for entry in entries:
        if entry["kind"] != "status":
            continue
        if entry["status"] != "RUNNING":
            running.pop(entry["node"], None)
        elif entry["node"] in running:
            yield f"the journal lets {entry['node']} begin at tick {entry['tick']} while it runs"
        else:
            running[entry["node"]] = entry["tick"]
    for node, tick in running.items():
        yield f"the journal says no end of {node}, which began at tick {tick}"


def check_books(items: Mapping[str, Any], audit: Mapping[str, int] | None) -> Iterator[str]:
    """Yield where the ledger does not balance, or the audit found something else.

    What nobody had seen yet when the run was halted is on no book and lies where it lay.
    """
    counts = ", ".join(f"{fate} {items[fate]}" for fate in ("seen", "placed", "rejected", "lost"))
    if items["seen"] != items["placed"] + items["rejected"] + items["lost"]:
        yield f"the ledger does not balance: {counts}"
    if audit is None:
        return
    agrees = (
        items["placed"] == audit["right"] + audit["wrong_bin"]
        and items["rejected"] + audit["unseen"] <= audit["left"]
        and items["lost"] == audit["elsewhere"]
        and audit["wrong_bin"] == 0
    )
    if not agrees:
        found = ", ".join(f"{place} {count}" for place, count in audit.items())
        yield f"the ledger says {counts}; the audit {found}"


def check_tool(outcome: Outcome, workcell: Workcell) -> Iterator[str]:
    """Yield a sentence if the run does not tell what its tool holds."""
    holding = workcell.cell.tool.holding
    if holding and outcome.holds not in {row["item"] for row in workcell.accounts.rows()}:
        yield f'the tool holds an object, and the run says "{outcome.holds}"'
    if not holding and outcome.holds:
        yield f'the tool holds nothing, and the run says "{outcome.holds}"'
