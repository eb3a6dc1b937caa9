"""What a tick costs, beside the same tree in bare py_trees, measured in one run.

Both are ticked in turns, in short blocks with the garbage collector off, and the best block of each
counts. Whatever else the machine does can only make a block slower, so the best is what the code itself
costs; taking turns keeps a change of the processor's speed from favouring either. Time is the thread's
own, on the processor and in the kernel: it stands still while another process has the processor. Status
changes wait for nothing, least of all for the disk, so on an idle machine it is the time on the wall.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from py_trees.behaviour import Behaviour

from executive.campaign.twin_trees import WAITING, Bare, Ours, ending
from executive.events import Event
from executive.record.recorder import Recorder
from executive.record.run_directory import RunDirectory

SIZES = (10, 100, 1000)
"""Nodes of the trees that are measured, control nodes and leaves together."""

MOST_RATIO = 1.3
"""How many times the tick of bare py_trees ours may cost in the steady state."""

MOST_EXTRA = 20.0
"""What a recorded status change may cost more than in bare py_trees [µs]."""

STEADY_TICKS = 300
"""Ticks in a block of a tree that waits."""

ENDING_NODES = 1000
"""Nodes that begin and end in a block, in one tick or several."""


@dataclass(frozen=True)
class SteadyCost:
    """A tick of a tree that waits for its last leaf.

    Attributes:
        shape: Name of its shape, see `executive.campaign.twin_trees.WAITING`.
        nodes: Number of its nodes.
        ours, bare: What a tick costs here and in bare py_trees [µs].
    """

    shape: str
    nodes: int
    ours: float
    bare: float

    @property
    def ratio(self) -> float:
        """How many times the bare tick ours costs."""
        return self.ours / self.bare


@dataclass(frozen=True)
class ChangeCost:
    """A tick in which every node begins and succeeds, ours recorded on the disk as a run is.

    Attributes:
        nodes: Number of nodes of the tree.
        changes: Status changes recorded in a tick: each node begins and ends.
        ours, bare: What a tick costs here and in bare py_trees [µs].
    """

    nodes: int
    changes: int
    ours: float
    bare: float

    @property
    def extra(self) -> float:
        """What one change costs more than in bare py_trees [µs]."""
        return (self.ours - self.bare) / self.changes


def steady_costs(blocks: int, sizes: Sequence[int] = SIZES) -> list[SteadyCost]:
    """Measure a tick of every shape that waits, in every size, with the best of so many blocks."""
    costs = []
    for shape, made in WAITING.items():
        for nodes in sizes:
            ours, bare = made(Ours(), nodes), made(Bare(), nodes)
            # The first tick runs the leaves that end.
            ours.tick_once()
            bare.tick_once()
            costs.append(SteadyCost(shape, nodes, *best_of_turns(ours, bare, blocks, STEADY_TICKS)))
    return costs


def change_costs(blocks: int, folder: Path, sizes: Sequence[int] = SIZES) -> list[ChangeCost]:
    """Measure recorded status changes in every size; the records stay in `folder`."""
    costs = []
    for nodes in sizes:
        directory = RunDirectory(folder / str(nodes))
        directory.path.mkdir()
        with closing(Recorder(directory, frames=False)) as recorder:
            ours, bare = ending(Ours([recorder]), nodes), ending(Bare(), nodes)
            best = best_of_turns(ours, bare, blocks, max(1, ENDING_NODES // nodes))
        costs.append(ChangeCost(nodes, _changes(nodes), *best))
    return costs


def best_of_turns(ours: Behaviour, bare: Behaviour, blocks: int, ticks: int) -> tuple[float, float]:
    """Return what a tick of each costs in its best block of so many ticks [µs]."""
    best_ours = best_bare = math.inf
    with _collector_off():
        for _ in range(blocks):
            best_ours = min(best_ours, _cost(ours, ticks))
            best_bare = min(best_bare, _cost(bare, ticks))
    return best_ours, best_bare


def _cost(root: Behaviour, ticks: int) -> float:
    began = time.thread_time()
    for _ in range(ticks):
        root.tick_once()
    return (time.thread_time() - began) / ticks * 1e6


def _changes(nodes: int) -> int:
    told: list[Event] = []
    ending(Ours([told.append]), nodes).tick_once()
    return len(told)


@contextmanager
def _collector_off() -> Iterator[None]:
    was_on = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
