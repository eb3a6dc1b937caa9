"""Skills that declare something wrongly, each in its own way."""

from __future__ import annotations

from typing import Any, ClassVar

from conforming_skills import Pause, Speed

from executive.cell import Cell, Steps
from executive.errors import InputError
from executive.messages import Target
from executive.skill import EMPTY, In, Metres, param


class Mute(Pause):
    def run(self, cell: Cell) -> Steps:
        """Wait."""
        yield


class Terse(Pause):
    """waits"""


class Undescribed(Pause):
    """Wait."""

    gap: Metres = param(0.1)
    target: In[Target]


class Unitless(Pause):
    """Wait."""

    force: float = param(1.0, doc="how hard")
    share: float = param(0.5, ge=0, le=1, doc="how much of it [-]")


class OutOfBounds(Pause):
    """Wait."""

    gap: Metres = param(0.3, le=0.2, doc="how far")


class Unsayable(Pause):
    """Wait."""

    speed: Speed = param(Speed.SLOW, doc="how fast")


class Choosy(Pause):
    """Wait."""

    order: str = param("rows", choices=("columns", "none"), doc="in which order")
    gap: Metres = param("far", doc="how far")
    near: Metres = param(0.1, ge=0.2, doc="how near")
    limit: float | None = param(None, ge=1, doc="at most [-]")


class Unordered(Pause):
    """Wait."""

    name: str = param("b", ge="a", doc="from where")


class Shouting(Pause):
    """Wait."""

    reasons: ClassVar = ("tooTired", "halt", "lost", "lost")


class Lying(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Never come to the point of failing."""
        yield
        if not cell.bins:
            raise self.failed("no_bins", "there are no bins")


class Texts(Pause):
    """Wait."""

    reasons: ClassVar = "tired"
    uses: ClassVar = "arm"
    tool_state: ClassVar = "empty"


class Gripping(Pause):
    """Wait."""

    uses: ClassVar = ("gripper",)


class Floating(Pause):
    """Wait."""

    moves: ClassVar = True


class Confused(Pause):
    """Wait."""

    tool_left: ClassVar = {"dropped": EMPTY, "tired": False}


class Boundless(Pause):
    """Wait."""

    extra: Any = param(1, doc="whatever")


class Lenient(Pause):
    """Wait."""

    def __init__(self, **values: Any) -> None:
        known = {name: value for name, value in values.items() if name in self.params}
        super().__init__(**known)


class Grumpy(Pause):
    """Wait."""

    def __init__(self, **values: Any) -> None:
        if values:
            raise InputError("no")
        super().__init__()


class Single(Pause):
    """Wait."""

    tool_state: ClassVar = EMPTY  # type: ignore[assignment]
