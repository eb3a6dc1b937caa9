"""Cost of a tick and of a status change, compared with the same trees in bare py_trees.

Short blocks of ticks of both trees alternate, without garbage collection; the best block of each counts.
Other load can only make a block slower, so the best block is the cost of the code itself. Because the blocks
alternate, a change of the processor's frequency favours neither tree. Times are the CPU times of the thread,
which do not count other processes.
"""

from __future__ import annotations

import gc
import itertools
import tempfile
import time
import timeit
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.protocols import Cell
from executive.events import Event, Observer, TimedEvent
from executive.record.journal import Recorder
from executive.record.run_directory import RunDirectory
from executive.skill import Skill
from executive.testing.fake_cell import FakeCell
from executive.tree.blackboard import Blackboard, NodeContext, Wiring
from executive.tree.decorators import Timeout
from executive.tree.retry import Retry
from executive.tree.sequences import Sequence as SequenceNode
from executive.tree.skill_leaf import SkillLeaf
from tests.benchmarks.report import Figures, run_command
from tests.node_behaviours import build

SIZES = (10, 100, 1000)
"""Numbers of nodes of the measured trees, control nodes and leaves together."""
MAX_RATIO = 1.3
"""Limit of the cost of a steady tick, divided by that of bare py_trees."""
MAX_EXTRA = 20.0
"""Limit of the cost of a recorded status change above that of bare py_trees [µs]."""
STEADY_TICKS = 300
"""Number of ticks per block of a tree whose last leaf never ends."""
NODE_RUNS_PER_BLOCK = 1000
"""Number of nodes that begin and end in one block; a tree with fewer nodes is ticked more often."""
TIMEOUT = 1e9
"""Limit of every timeout, longer than any measurement [s]."""


def measure(blocks: int = 50) -> Figures:
    """Measure ticks and status changes; each figure is that of the fastest of `--blocks` blocks."""
    ticks = [measure_ticks(nodes, blocks) for nodes in SIZES]
    with tempfile.TemporaryDirectory() as folder:
        changes = [measure_changes(nodes, blocks, Path(folder, str(nodes))) for nodes in SIZES]
    problems = [f"ratio above {MAX_RATIO}: {row}" for row in ticks if row["ratio"] > MAX_RATIO]
    problems += [f"extra_us above {MAX_EXTRA}: {row}" for row in changes if row["extra_us"] > MAX_EXTRA]
    return {"steady tick": ticks, "status changes": changes, "problems": problems}


def measure_ticks(nodes: int, blocks: int) -> Figures:
    """Return the cost of a tick of a tree that waits for its last leaf."""
    ours, bare = build_ours(nodes, _WaitForever), build_bare(nodes, Status.RUNNING)
    # The first tick runs the leaves that end.
    ours.tick_once()
    bare.tick_once()
    ours_us, bare_us = find_best_costs(ours, bare, blocks, STEADY_TICKS)
    return {"nodes": nodes, "ours_us": ours_us, "py_trees_us": bare_us, "ratio": ours_us / bare_us}


def measure_changes(nodes: int, blocks: int, folder: Path) -> Figures:
    """Return the cost of a tick in which every node begins and succeeds, recorded as a run is."""
    events: list[Event] = []
    build_ours(nodes, _SucceedAtOnce, events.append).tick_once()
    folder.mkdir()
    with closing(Recorder(RunDirectory(folder), saves_pictures=False)) as recorder:
        ours, bare = build_ours(nodes, _SucceedAtOnce, recorder), build_bare(nodes, Status.SUCCESS)
        ours_us, bare_us = find_best_costs(ours, bare, blocks, max(1, NODE_RUNS_PER_BLOCK // nodes))
    row = {"changes": len(events), "nodes": nodes, "ours_us": ours_us, "py_trees_us": bare_us}
    return {**row, "extra_us": (ours_us - bare_us) / len(events)}


def find_best_costs(ours: Behaviour, bare: Behaviour, blocks: int, ticks: int) -> tuple[float, float]:
    """Return for each tree the cost of a tick in its fastest block [µs]; a block has `ticks` ticks."""
    gc.collect()
    # `timeit` runs without garbage collection.
    times = [
        [timeit.timeit(root.tick_once, number=ticks, timer=time.thread_time) for root in (ours, bare)]
        for _ in range(blocks)
    ]
    best_ours, best_bare = np.min(times, axis=0) / ticks * 1e6
    return float(best_ours), float(best_bare)


def build_ours(nodes: int, last_skill: type[Skill], *observers: Observer) -> Behaviour:
    """Return a retry of a timeout of a sequence, on a fake cell; the last leaf runs `last_skill`.

    All other leaves succeed at once. Events are stamped and passed on as a run does it.
    """
    cell, blackboard, number = FakeCell().cell, Blackboard(), itertools.count(1)

    def emit(event: Event) -> None:
        timed = TimedEvent(0, round(cell.clock.now, 6), event)
        for observer in observers:
            observer(timed)

    def make_site(name: str) -> NodeContext:
        path = f"tree/repeat/do/{next(number)}:{name}"
        return NodeContext(path, cell.clock, cell.ledger, blackboard, emit=emit)

    skills = [*[_SucceedAtOnce] * (nodes - 4), last_skill]
    leaves = [SkillLeaf(make_site(skill.__name__), "leaf", skill, Wiring(), cell) for skill in skills]
    body = build(make_site("do"), SequenceNode, do=leaves)
    timeout = build(make_site("timeout"), Timeout, seconds=TIMEOUT, do=body)
    return build(make_site("retry"), Retry, attempts=3, do=timeout)


def build_bare(nodes: int, last_status: Status) -> Behaviour:
    """Return a py_trees tree with the structure of `build_ours`; its last leaf returns `last_status`."""
    leaves = [_ConstantStatus(status) for status in (*[Status.SUCCESS] * (nodes - 4), last_status)]
    body = composites.Sequence("do", memory=True, children=leaves)
    return decorators.Retry("retry", decorators.Timeout("timeout", body, TIMEOUT), 3)


class _SucceedAtOnce(Skill):
    """Succeed in the first tick."""

    def run(self, cell: Cell) -> Iterator[None]:
        del cell
        yield from ()


class _WaitForever(Skill):
    """Never end."""

    def run(self, cell: Cell) -> Iterator[None]:
        del cell
        while True:
            yield


class _ConstantStatus(Behaviour):
    def __init__(self, status: Status) -> None:
        super().__init__(status.value)
        self._status = status

    def update(self) -> Status:
        return self._status


if __name__ == "__main__":
    run_command(measure)
