"""Effects of faults on a cell: base class, one occurrence, and the state of the cell that effects need."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np

from executive.cell.arm import Motion
from executive.cell.objects import Item
from executive.cell.plain import round_values
from executive.cell.workcell import Workcell
from executive.errors import InputError
from executive.events import Emit, FaultInjected
from executive.geometry import Array
from executive.testing.faults.world_access import TrueObject, WorldAccess

MAX_ITEM_DISTANCE = 0.05
"""Distance from the believed position of an item up to which an object counts as that item [m]."""
TIME_TOLERANCE = 1e-9
"""Rounding error allowed when two times on the run's clock are compared [s]."""

ObjectChoice = int | Literal["node", "nearest"]
"""An object: its number, from 1; the one on the table that is `nearest` to the tool; or that of the `node`.

The object of the node is the one that the ledger takes for its item; without an item, it is the nearest.
"""


class FaultScene:
    """A cell without faults, its world and the motion of its arm.

    Args:
        workcell: The cell without faults.
        open_world: Returns the access to the world of the cell.
        emit: Emits events of the run.

    Attributes:
        cell: The cell that skills would see without faults.
        emit: Emits events of the run.
        motion: Start time [s] and motion of the arm; None if the arm was stopped.
    """

    def __init__(self, workcell: Workcell, open_world: Callable[[Workcell], WorldAccess], emit: Emit) -> None:
        self._workcell, self._open_world = workcell, open_world
        self.cell, self.emit = workcell.cell, emit
        self.motion: tuple[float, Motion] | None = None

    @cached_property
    def world(self) -> WorldAccess:
        """Access to the world, opened at its first use."""
        return self._open_world(self._workcell)

    @property
    def now(self) -> float:
        """Time on the run's clock [s]."""
        return self.cell.clock.now

    @property
    def progress(self) -> float:
        """Completed share of the motion's duration, 0 to 1; 0 without a motion."""
        if self.motion is None or self.motion[1].duration == 0.0:
            return 0.0
        share = (self.now - self.motion[0]) / self.motion[1].duration
        return share if share <= 1.0 else 0.0

    def find(self, which: ObjectChoice, item: Item) -> TrueObject | None:
        """Return an object, or None if there is none now; `item` is the item of the node."""
        if isinstance(which, int):
            return next(iter(self.world.objects[which - 1 : which]), None)
        if which == "nearest" or not item:
            return self._find_nearest(self.cell.arm.tool_pose.position, np.inf)
        known = next((row for row in self._workcell.accounts.summaries() if row.item == item), None)
        if known is None or known.state == "placed":
            return None
        if known.state == "held":
            return self.world.held
        return self._find_nearest(np.array(known.position), MAX_ITEM_DISTANCE)

    def _find_nearest(self, position: Array, max_distance: float) -> TrueObject | None:
        """Return the object on the table whose horizontal distance from `position` `(3,)` [m] is smallest."""
        held, bins = self.world.held, self.cell.bins.values()
        distances = [
            (float(np.linalg.norm((true.position - position)[:2])), true)
            for true in self.world.objects
            if not any(bin.contains(true.position) for bin in bins)
            and (held is None or true.body != held.body)
        ]
        distance, nearest = min(distances, key=lambda pair: pair[0], default=(np.inf, None))
        return nearest if distance <= max_distance else None


@dataclass(frozen=True)
class Effect:
    """Effect of a fault on a cell: an action, or changed answers of the cell; a value without state.

    Attributes:
        name: Name of the effect in the record.
        act: `act(occurrence, *arguments)` changes the cell once and returns True, or returns False while
            this is impossible; called when the effect begins and after each control step. None: no action.
        answers: Functions `answer(proceed, occurrence, *arguments)`, by the member of the cell whose result
            they return: `close`, `open` (tool), `plan` (arm), `sees_table`, `capture` (camera), `request`
            (detector), `localize` (localizer) or `ask` (operator). `proceed` returns the cell's own answer.
        arguments: Further arguments of these functions.
    """

    name: str
    act: Callable[..., bool] | None = None
    answers: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    arguments: tuple[Any, ...] = ()


@dataclass(eq=False)
class Occurrence:
    """One occurrence of an effect.

    Attributes:
        effect: The effect.
        scene: The cell and its world.
        node: Path of the node during which the effect occurs, or "".
        item: Item of this node, or "".
        end: Time at which the effect ends [s].
        has_acted: True after the action.
        is_over: True after the end.
    """

    effect: Effect
    scene: FaultScene
    node: str = ""
    item: str = ""
    end: float = math.inf
    has_acted: bool = False
    is_over: bool = False
    _last_record: float = -math.inf

    def act(self) -> None:
        """Let the effect act, unless it has acted."""
        if self.effect.act is not None and not self.has_acted:
            self.has_acted = self.effect.act(self, *self.effect.arguments)

    def record(self, affected: TrueObject | None = None) -> None:
        """Emit the fault and the affected object; at most one event per control step."""
        if self._last_record == self.scene.now:
            return
        self._last_record = self.scene.now
        label = affected.label if affected else ""
        position = round_values(affected.position, 4) if affected else []
        self.scene.emit(FaultInjected(self.effect.name, self.node, self.item, label, position))


def require_share(share: float | None) -> float:
    """Return the share of a motion after which a fault occurs; 0 for None: at once, also at rest.

    Raises:
        InputError: The share is not more than 0 and less than 1.
    """
    if share is not None and not 0.0 < share < 1.0:
        raise InputError(f"a share of a motion is more than 0 and less than 1, not {share:g}")
    return share or 0.0
