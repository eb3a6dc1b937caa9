"""Faults of arm, tool, camera, localizer, table and operator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from executive.cell.arm import Motion, Planning
from executive.cell.frame import Frame
from executive.errors import Blocked, NoDepth, Unreachable
from executive.testing.faults.effect import Effect, Occasion, checked_share


def seal_fails() -> Effect:
    """Nothing seals to the tool while this lasts: `Grasp` is `missed`; a held object stays at the tool."""
    return Effect("seal_fails", answers={"close": _answer}, arguments=(None,))


def seal_breaks(share: float | None = 0.5) -> Effect:
    """The seal breaks once, while the arm carries an object, which falls: `Transit` is `dropped`.

    Args:
        share: Share of the motion after which the seal breaks, 0 to 1; None: at once, at rest too.

    Raises:
        InputError: The share is not more than 0 and less than 1.
    """
    return Effect("seal_breaks", _break_seal, arguments=(checked_share(share),))


def seal_breaks_over_wrong_bin() -> Effect:
    """The seal breaks once, over a bin that is wrong for the object, which falls into this bin."""
    return Effect("seal_breaks", _break_seal_over_wrong_bin)


def tool_sticks() -> Effect:
    """The tool keeps its object when it opens while this lasts: `Release` is `stuck`."""
    return Effect("tool_sticks", answers={"open": _keep_object})


def arm_runs_into(what: str = "something", share: float = 0.5) -> Effect:
    """The arm runs into an obstacle once and breaks off its motion: the skill is `blocked`.

    Args:
        what: The obstacle, for the message of the failure.
        share: Share of the motion after which this happens, 0 to 1.

    Raises:
        InputError: The share is not more than 0 and less than 1.
    """
    return Effect("arm_runs_into", _block_arm, arguments=(what, checked_share(share)))


def no_way(*, is_blocked: bool = False) -> Effect:
    """The planner finds no motion while this lasts: the skill is `unreachable`, or `blocked`.

    Args:
        is_blocked: True if an obstacle is in the way; False if the goal is out of reach.
    """
    return Effect("no_way", answers={"plan": _plan_in_vain}, arguments=(is_blocked,))


def workspace_hidden() -> Effect:
    """The arm hides everything from the camera while this lasts: `Detect` is `hidden`, or sees nothing."""
    return Effect("workspace_hidden", answers={"sees_table": _answer, "capture": _hide}, arguments=(False,))


def no_depth() -> Effect:
    """No detection can be localized while this lasts: `Localize` fails with `no_depth`."""
    return Effect("no_depth", answers={"localize": _lose_depth})


def table_bumped() -> Effect:
    """Something bumps the table once, and the ledger is informed: frames and targets are `stale`."""
    return Effect("table_bumped", _bump_table)


def operator_quits() -> Effect:
    """The operator wants nothing more while this lasts: `AwaitRequest` fails with `quit`."""
    return Effect("operator_quits", answers={"ask": _answer}, arguments=(None,))


def operator_asks_rescan() -> Effect:
    """The operator wants a new look while this lasts: `AwaitRequest` fails with `rescan`."""
    return Effect("operator_asks_rescan", answers={"ask": _answer}, arguments=("rescan",))


def _answer(proceed: Callable[[], object], now: Occasion, answer: object) -> object:
    """Return an answer without the cell."""
    del proceed
    now.record()
    return answer


def _keep_object(proceed: Callable[[], None], now: Occasion) -> None:
    if (held := now.scene.hand.held) is None:
        proceed()
    else:
        now.record(held)


def _break_seal(now: Occasion, share: float) -> bool:
    held = now.scene.hand.held
    if held is None or now.scene.progress < share:
        return False
    now.record(held)
    now.scene.hand.part()
    return True


def _break_seal_over_wrong_bin(now: Occasion) -> bool:
    scene, held = now.scene, now.scene.hand.held
    if held is None or scene.progress == 0.0:
        return False
    right = scene.cell.routes.get(held.label, ())
    bins = scene.cell.bins.items()
    is_over_wrong_bin = any(name not in right and bin.contains(held.position) for name, bin in bins)
    return is_over_wrong_bin and _break_seal(now, 0.0)


def _block_arm(now: Occasion, what: str, share: float) -> bool:
    if now.scene.progress < share:
        return False
    now.record()
    now.scene.hand.stand_in_the_way(f"the arm ran into {what}")
    return True


def _bump_table(now: Occasion) -> bool:
    now.record()
    now.scene.cell.ledger.invalidate_positions()
    return True


def _hide(proceed: Callable[[], Frame], now: Occasion, answer: object) -> Frame:
    """Return a frame that shows the arm alone."""
    del answer
    now.record()
    frame = proceed()
    return replace(frame, visible=np.zeros_like(frame.visible))


def _lose_depth(proceed: Callable[[], Any], now: Occasion) -> Any:
    del proceed
    now.record()
    raise NoDepth("the frame has no depth there, as the test wants it")


@dataclass(frozen=True)
class PlanInVain:
    """A plan that takes its time and finds no motion; implements `Planning`."""

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


def _plan_in_vain(proceed: Callable[[], Planning], now: Occasion, is_blocked: bool) -> Planning:
    now.record()
    return PlanInVain(proceed(), is_blocked)
