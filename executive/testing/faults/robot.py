"""Effects on arm, tool, camera, localizer, table and operator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from executive.cell.arm import Motion, Planning
from executive.cell.detection import Observation
from executive.cell.frame import Frame
from executive.errors import Blocked, NoDepth, Unreachable
from executive.testing.faults.effect import Effect, Occasion, checked_share


@dataclass(frozen=True)
class SealFails(Effect):
    """Nothing seals to the tool; an object that hangs there already stays."""

    name = "seal_fails"

    def close(self, do: Callable[[], None], now: Occasion) -> None:
        """Leave the tool as it is."""
        del do
        now.tell()


@dataclass(frozen=True)
class SealBreaks(Effect):
    """The seal gives way, once, when the arm has carried an object so far."""

    name = "seal_breaks"
    share: float

    def act(self, now: Occasion) -> bool:
        """Part tool and object, if the tool holds one and the arm is so far."""
        held = now.scene.hand.held
        if held is None or now.scene.progress < self.share:
            return False
        now.tell(held)
        now.scene.hand.part()
        return True


@dataclass(frozen=True)
class SealBreaksOverWrongBin(Effect):
    """The seal gives way, once, when the object hangs over a bin that is wrong for it."""

    name = "seal_breaks"

    def act(self, now: Occasion) -> bool:
        """Part tool and object there."""
        scene, held = now.scene, now.scene.hand.held
        if held is None or scene.progress == 0.0:
            return False
        right = scene.cell.routes.get(held.label, ())
        bins = scene.cell.bins.items()
        if not any(name not in right and bin.contains(held.position) for name, bin in bins):
            return False
        now.tell(held)
        scene.hand.part()
        return True


@dataclass(frozen=True)
class ToolSticks(Effect):
    """The tool does not let go of what hangs there when it opens."""

    name = "tool_sticks"

    def open(self, do: Callable[[], None], now: Occasion) -> None:
        """Leave the tool closed, if it holds something."""
        if (held := now.scene.hand.held) is None:
            do()
        else:
            now.tell(held)


@dataclass(frozen=True)
class ArmRunsInto(Effect):
    """The arm runs into something, once, when it has gone so far."""

    name = "arm_runs_into"
    what: str
    share: float

    def act(self, now: Occasion) -> bool:
        """Stand in the way, if the arm is so far."""
        if now.scene.progress < self.share:
            return False
        now.tell()
        now.scene.hand.stand_in_the_way(f"the arm ran into {self.what}")
        return True


@dataclass(frozen=True)
class NoWay(Effect):
    """The planner finds no motion."""

    name = "no_way"
    is_blocked: bool

    def plan(self, ask: Callable[[], Planning], now: Occasion) -> Planning:
        """Take as long as ever, and find none."""
        now.tell()
        return PlanInVain(ask(), self.is_blocked)


@dataclass(frozen=True)
class PlanInVain:
    """A motion being planned that does not exist; implements `Planning`."""

    planning: Planning
    is_blocked: bool

    @property
    def ready(self) -> bool:
        """True once a motion would be known."""
        return self.planning.ready

    def result(self) -> Motion:
        """Raise Blocked or Unreachable."""
        if self.is_blocked:
            raise Blocked("something is in the way, as the test wants it")
        raise Unreachable("the planner finds no way, as the test wants it")


@dataclass(frozen=True)
class WorkspaceHidden(Effect):
    """The arm hides everything from the camera."""

    name = "workspace_hidden"

    def sees_table(self, ask: Callable[[], bool], now: Occasion) -> bool:
        """Say no."""
        del ask
        now.tell()
        return False

    def capture(self, ask: Callable[[], Frame], now: Occasion) -> Frame:
        """Return a frame that shows the arm alone."""
        now.tell()
        frame = ask()
        return replace(frame, visible=np.zeros_like(frame.visible))


@dataclass(frozen=True)
class DepthMissing(Effect):
    """No detection can be localized."""

    name = "no_depth"

    def localize(self, ask: Callable[[], Sequence[Observation]], now: Occasion) -> Sequence[Observation]:
        """Raise NoDepth."""
        del ask
        now.tell()
        raise NoDepth("the frame has no depth there, as the test wants it")


@dataclass(frozen=True)
class TableBumped(Effect):
    """Something bumps the table, once, and the ledger is informed: nothing need be where it was."""

    name = "table_bumped"

    def act(self, now: Occasion) -> bool:
        """Put every position in doubt."""
        now.tell()
        now.scene.cell.ledger.bumped()
        return True


@dataclass(frozen=True)
class OperatorSays(Effect):
    """The operator gives an answer first, and only then those that they would have given."""

    name: str
    answer: str | None

    def ask(self, ask: Callable[[], str | None], now: Occasion) -> str | None:
        """Answer for the operator."""
        del ask
        now.tell()
        return self.answer


def seal_fails() -> Effect:
    """Nothing seals to the tool while it lasts: `Grasp` is `missed`."""
    return SealFails()


def seal_breaks(share: float | None = 0.5) -> Effect:
    """The seal gives way in mid-carry, once, and the object falls: `Transit` is `dropped`.

    Args:
        share: Share of its motion that the arm has then behind it, 0 to 1; None: at once, at rest too.

    Raises:
        InputError: There is no such share.
    """
    return SealBreaks(checked_share(share))


def seal_breaks_over_wrong_bin() -> Effect:
    """The seal gives way, once, over a bin that is wrong for the object, which falls in."""
    return SealBreaksOverWrongBin()


def tool_sticks() -> Effect:
    """The tool does not let go when it is opened while it lasts: `Release` is `stuck`."""
    return ToolSticks()


def arm_runs_into(what: str = "something", share: float = 0.5) -> Effect:
    """The arm runs into something on its way, once, and breaks its motion off: the skill is `blocked`.

    Args:
        what: The obstacle, for the text of the failure.
        share: Share of its motion that the arm has then behind it, 0 to 1.

    Raises:
        InputError: There is no such share.
    """
    return ArmRunsInto(what, checked_share(share))


def no_way(*, is_blocked: bool = False) -> Effect:
    """The planner finds no way while it lasts: the skill is `unreachable`, or `blocked`.

    Args:
        is_blocked: Something is in the way; else the goal is out of reach.
    """
    return NoWay(is_blocked)


def workspace_hidden() -> Effect:
    """The arm hides everything from the camera while it lasts: `Detect` is `hidden`, or sees nothing."""
    return WorkspaceHidden()


def no_depth() -> Effect:
    """No detection can be localized while it lasts: `Localize` fails with `no_depth`."""
    return DepthMissing()


def table_bumped() -> Effect:
    """Something bumps the table, once, and the ledger hears of it: frames and targets are `stale`."""
    return TableBumped()


def operator_quits() -> Effect:
    """The operator wants nothing more while it lasts: `AwaitRequest` fails with `quit`."""
    return OperatorSays("operator_quits", None)


def operator_asks_rescan() -> Effect:
    """The operator wants a fresh look while it lasts: `AwaitRequest` fails with `rescan`."""
    return OperatorSays("operator_asks_rescan", "rescan")
