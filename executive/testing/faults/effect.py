"""Base of the faults that can be injected into a cell, and one occurrence of a fault."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from executive.cell.plain import rounded
from executive.errors import InputError
from executive.events import FaultInjected
from executive.testing.faults.hand import Thing
from executive.testing.faults.scene import FaultScene


@dataclass(frozen=True)
class Effect:
    """A fault of a cell: an action, or other answers of the cell; a value without state.

    Attributes:
        name: Name of the effect in the record.
        act: `act(occasion, *arguments)` changes the cell once and returns True, or returns False as long as
            it cannot; called when the effect begins and after every control step. None: no action.
        answers: Functions `answer(proceed, occasion, *arguments)` by the member of the cell whose result
            they return: `close`, `open` (tool), `plan` (arm), `sees_table`, `capture` (camera), `request`
            (detector), `localize` (localizer) or `ask` (operator). `proceed` asks the cell.
        arguments: Further arguments of these functions.
    """

    name: str
    act: Callable[..., bool] | None = None
    answers: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    arguments: tuple[Any, ...] = ()


@dataclass(eq=False)
class Occasion:
    """One occurrence of an effect.

    Attributes:
        effect: The effect.
        scene: The cell and its world.
        node: Path of the node during which it happens, or "".
        item: Item that this node is about, or "".
        until: Time at which it ends [s].
        done: True once it has acted.
        over: True once it is over.
    """

    effect: Effect
    scene: FaultScene
    node: str = ""
    item: str = ""
    until: float = math.inf
    done: bool = False
    over: bool = False
    _told: float = -math.inf

    def act(self) -> None:
        """Let the effect act, unless it is done."""
        if self.effect.act is not None and not self.done:
            self.done = self.effect.act(self, *self.effect.arguments)

    def record(self, thing: Thing | None = None) -> None:
        """Emit the fault, and the object that it concerns; at most one event per control step."""
        if self._told == self.scene.now:
            return
        self._told = self.scene.now
        label = thing.label if thing else ""
        position = rounded(thing.position, 4) if thing else []
        self.scene.emit(FaultInjected(self.effect.name, self.node, self.item, label, position))


def checked_share(share: float | None) -> float:
    """Return the share of its motion after which a fault happens; 0 for None: at once, at rest too.

    Raises:
        InputError: It is not more than 0 and less than 1.
    """
    if share is not None and not 0.0 < share < 1.0:
        raise InputError(f"a share of a motion is more than 0 and less than 1, not {share:g}")
    return share or 0.0
