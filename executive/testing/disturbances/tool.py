"""What can happen to the tool: no seal, a seal that breaks, an object that sticks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from executive.testing.disturbances.effect import Effect, Occasion
from executive.testing.disturbances.share import checked_share


@dataclass(frozen=True)
class SealFails(Effect):
    """Nothing seals to the tool; what hangs there already stays."""

    name: ClassVar = "seal_fails"
    leaks: ClassVar = True

    def close(self, do: Callable[[], None], now: Occasion) -> None:
        """Tell that the tool closes in vain."""
        now.tell()
        do()


@dataclass(frozen=True)
class SealBreaks(Effect):
    """The seal gives way once the arm has carried something so far."""

    name: ClassVar = "seal_breaks"
    share: float

    def act(self, now: Occasion) -> bool:
        """Part tool and object, if the tool holds one and the arm is on its way."""
        if now.scene.progress < self.share or (held := now.scene.hand.held) is None:
            return False
        now.tell(held)
        now.scene.hand.part()
        return True


@dataclass(frozen=True)
class ToolSticks(Effect):
    """What hangs at the tool stays there when the tool opens, until it is opened once more without this."""

    name: ClassVar = "tool_sticks"
    sticks: ClassVar = True

    def open(self, do: Callable[[], None], now: Occasion) -> None:
        """Tell that the tool opens in vain, if it holds something."""
        if (held := now.scene.hand.held) is not None:
            now.tell(held)
        do()


def seal_fails() -> Effect:
    """Nothing seals to the tool while it lasts: `Grasp` is `missed`."""
    return SealFails()


def seal_breaks(share: float = 0.5) -> Effect:
    """The seal gives way in mid-carry, once, and the object falls: `Transit` is `dropped`.

    Args:
        share: How much of its motion the arm has behind it then, 0 to 1.

    Raises:
        InputError: There is no such share.
    """
    return SealBreaks(checked_share(share))


def tool_sticks() -> Effect:
    """The tool does not let go when it is opened while it lasts: `Release` is `stuck`."""
    return ToolSticks()
