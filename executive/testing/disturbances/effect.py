"""What happens to a cell: the base of everything that can disturb one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from executive.arm import Planning
from executive.cell import Request
from executive.geometry import Array
from executive.messages import Frame
from executive.testing.disturbances.hand import Thing
from executive.testing.disturbances.scene import Scene


class Effect:
    """Something that happens to a cell while it lasts; a subclass says what, and leaves the rest as it is.

    An effect is a value without a state of its own: what belongs to one time at which it happens is in its
    `Occasion`. The methods below `act` stand between the skills and the cell: each gets the question that
    was asked, and returns the answer.

    Attributes:
        name: What happens, for the record.
        leaks: Nothing seals to the tool meanwhile.
        sticks: The tool does not let go meanwhile.
    """

    name: ClassVar[str]
    leaks: ClassVar[bool] = False
    sticks: ClassVar[bool] = False

    def act(self, now: Occasion) -> bool:
        """Do something to the cell, once; return False as long as it cannot be done yet.

        Called when the effect begins, and after every control step until it is done or over.
        """
        del now
        return False

    def close(self, do: Callable[[], None], now: Occasion) -> None:
        """Close the tool."""
        del now
        do()

    def open(self, do: Callable[[], None], now: Occasion) -> None:
        """Open the tool."""
        del now
        do()

    def plan(self, ask: Callable[[], Planning], now: Occasion) -> Planning:
        """Begin to plan a motion."""
        del now
        return ask()

    def sees_table(self, ask: Callable[[], bool], now: Occasion) -> bool:
        """Tell whether the whole workspace is in view."""
        del now
        return ask()

    def capture(self, ask: Callable[[], Frame], now: Occasion) -> Frame:
        """Return a frame."""
        del now
        return ask()

    def request(self, ask: Callable[[], Request], now: Occasion) -> Request:
        """Ask a detector."""
        del now
        return ask()

    def locate(self, ask: Callable[[], Array], now: Occasion) -> Array:
        """Localize a detection."""
        del now
        return ask()

    def ask(self, ask: Callable[[], str | None], now: Occasion) -> str | None:
        """Ask the operator."""
        del now
        return ask()


@dataclass(eq=False)
class Occasion:
    """One time at which an effect happens.

    Attributes:
        effect: What happens.
        scene: Where.
        node: Path of the node during which it happens, or "".
        item: What that node is about, or "".
        until: Time at which it ends, whatever runs then [s].
        done: True once it has acted.
        over: True once it is over.
    """

    effect: Effect
    scene: Scene
    node: str = ""
    item: str = ""
    until: float = math.inf
    done: bool = False
    over: bool = False
    _told: float = -math.inf

    def tell(self, thing: Thing | None = None) -> None:
        """Tell the run that the cell is disturbed now, and which object of it; once a control step."""
        if self._told == self.scene.now:
            return
        self._told = self.scene.now
        self.scene.emit(
            "disturbance",
            what=self.effect.name,
            node=self.node,
            item=self.item,
            object=thing.label if thing else "",
            position=[round(float(value), 4) for value in thing.position] if thing else [],
        )
