"""Effect of a fault on a cell, occurrence of an effect, and access to the cell for effects."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np

from executive.cell.arm import Motion
from executive.cell.json_values import round_values
from executive.cell.objects import Item
from executive.cell.workcell import Workcell
from executive.errors import InputError
from executive.events import Emit, FaultInjected
from executive.geometry import Array
from executive.testing.faults.world_access import TrueObject, WorldAccess

MAX_ITEM_POSITION_ERROR = 0.05
"""Maximum horizontal distance between the position of an item in the ledger and its true object [m]."""
TIME_TOLERANCE = 1e-9
"""Tolerance for rounding errors in comparisons of times on the run's clock [s]."""

ObjectChoice = int | Literal["node", "nearest"]
"""Choice of an object: the number of an object, from 1; `nearest` to the tool; or the object of the `node`.

`node` chooses the true object of the item that the node handles, or the nearest object without an item.
"""


class FaultContext:
    """The cell without faults, access to its world, and the current motion of its arm.

    Args:
        workcell: The cell without faults.
        open_world: Function that returns the access to the world of a cell.
        emit: Function that emits events of the run.

    Attributes:
        cell: The cell without faults, as skills see it.
        motion: Last motion of the arm and its start time [s]; None before a motion and after a stop.
    """

    def __init__(self, workcell: Workcell, open_world: Callable[[Workcell], WorldAccess], emit: Emit) -> None:
        self._workcell, self._open_world = workcell, open_world
        self.cell, self.emit = workcell.cell, emit
        self.motion: tuple[Motion, float] | None = None

    @cached_property
    def world(self) -> WorldAccess:
        """Access to the world of the cell, opened at the first use."""
        return self._open_world(self._workcell)

    @property
    def now(self) -> float:
        """Time on the run's clock [s]."""
        return self.cell.clock.now

    @property
    def motion_progress(self) -> float:
        """Elapsed fraction of the current motion, 0 to 1; 0 without a motion or after its end."""
        motion, start_time = self.motion or (None, 0.0)
        if motion is None or motion.duration == 0.0:
            return 0.0
        fraction = (self.now - start_time) / motion.duration
        return fraction if fraction <= 1.0 else 0.0

    def find_object(self, choice: ObjectChoice, item: Item) -> TrueObject | None:
        """Return the chosen object, or None if no object matches; `item` is the item of the node, or ""."""
        if isinstance(choice, int):
            return next(iter(self.world.objects[choice - 1 : choice]), None)
        if choice == "nearest" or not item:
            return self._find_nearest(self.cell.arm.tool_pose.position, np.inf)
        summary = next((entry for entry in self._workcell.accounts.list_items() if entry.item == item), None)
        if summary is None or summary.state == "placed":
            return None
        if summary.state == "held":
            return self.world.held_object
        return self._find_nearest(np.array(summary.position), MAX_ITEM_POSITION_ERROR)

    def _find_nearest(self, position: Array, max_distance: float) -> TrueObject | None:
        """Return the object outside of bins and tool that is nearest to `position` `(3,)` [m] horizontally.

        Return None if no object is within `max_distance` [m].
        """

        def measure_distance(true_object: TrueObject) -> float:
            return float(np.linalg.norm((true_object.position - position)[:2]))

        held_object, bins = self.world.held_object, self.cell.bins.values()
        candidates = [
            true_object
            for true_object in self.world.objects
            if not any(bin.contains(true_object.position) for bin in bins)
            and (held_object is None or true_object.body != held_object.body)
            and measure_distance(true_object) <= max_distance
        ]
        return min(candidates, key=measure_distance, default=None)


@dataclass(frozen=True)
class Effect:
    """Stateless effect of a fault on a cell: an action, or changed results of calls.

    Attributes:
        name: Name of the effect in the journal.
        action: Function `action(occurrence, *arguments)`, which is called when the effect begins and after
            each control step until the function returns True. The function changes the cell and returns True,
            or returns False if the change is not possible yet. None: no action.
        interceptors: Functions `interceptor(proceed, occurrence, *arguments)`, by the name of the method of
            the cell whose result they return: `close`, `open` (tool), `plan` (arm), `sees_table`, `capture`
            (camera), `request` (detector), `localize` (localizer), `ask` (operator). `proceed()` calls the
            method.
        arguments: Further arguments of the action and of the interceptors.
    """

    name: str
    action: Callable[..., bool] | None = None
    interceptors: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    arguments: tuple[Any, ...] = ()


@dataclass(eq=False)
class Occurrence:
    """One occurrence of an effect.

    Attributes:
        effect: The effect.
        context: The cell without faults, and access to its world.
        node: Path of the node during which the effect occurs, or "".
        item: Item that the node handles, or "".
        end: Time on the run's clock at which the effect ends [s].
        has_acted: True if the action has changed the cell.
        is_over: True if the effect has ended.
        _last_event_time: Time on the run's clock of the last event [s].
    """

    effect: Effect
    context: FaultContext
    node: str = ""
    item: str = ""
    end: float = math.inf
    has_acted: bool = False
    is_over: bool = False
    _last_event_time: float = -math.inf

    def run_action(self) -> None:
        """Run the action of the effect, unless it has changed the cell already."""
        if self.effect.action is not None and not self.has_acted:
            self.has_acted = self.effect.action(self, *self.effect.arguments)

    def emit_event(self, affected: TrueObject | None = None) -> None:
        """Emit a `FaultInjected` event with the affected object; at most one event per control step."""
        if self._last_event_time == self.context.now:
            return
        self._last_event_time = self.context.now
        label = affected.label if affected else ""
        position = round_values(affected.position, 4) if affected else []
        self.context.emit(FaultInjected(self.effect.name, self.node, self.item, label, position))


def validate_fraction(fraction: float | None) -> float:
    """Return `fraction`, a part of a motion after which a fault occurs; 0 (at once) for None.

    Raises:
        InputError: The fraction is not between 0 and 1, both excluded.
    """
    if fraction is not None and not 0.0 < fraction < 1.0:
        raise InputError(f"a fraction of a motion must be more than 0 and less than 1, not {fraction:g}")
    return fraction or 0.0
