"""Faults of arm, tool, camera, localizer, table and operator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from executive.cell.arm import Motion, Planning
from executive.cell.frame import Frame
from executive.errors import Blocked, NoDepth, Unreachable
from executive.testing.faults.effect import Effect, Occurrence, require_share


def seal_fails() -> Effect:
    """Nothing seals to the tool while this lasts: `Grasp` is `missed`; a held object stays at the tool."""
    return Effect("seal_fails", answers={"close": _answer}, arguments=(None,))


def seal_breaks(share: float | None = 0.5) -> Effect:
    """The seal breaks once, while the arm carries an object, which falls: `Transit` is `dropped`.

    Args:
        share: Share of the motion after which the seal breaks, 0 to 1; None: at once, also at rest.

    Raises:
        InputError: The share is not more than 0 and less than 1.
    """
    return Effect("seal_breaks", _break_seal, arguments=(require_share(share),))


def seal_breaks_over_wrong_bin() -> Effect:
    """The seal breaks once, over a bin that is wrong for the object, which falls into this bin."""
    return Effect("seal_breaks", _break_seal_over_wrong_bin)


def tool_sticks() -> Effect:
    """The tool keeps its object when it opens while this lasts: `Release` is `stuck`."""
    return Effect("tool_sticks", answers={"open": _keep_object})


def arm_runs_into(what: str = "something", share: float = 0.5) -> Effect:
    """The arm runs into an obstacle once and brakes: the skill is `blocked`.

    Args:
        what: The obstacle, for the message of the failure.
        share: Share of the motion after which this happens, 0 to 1.

    Raises:
        InputError: The share is not more than 0 and less than 1.
    """
    return Effect("arm_runs_into", _block_arm, arguments=(what, require_share(share)))


def no_way(*, is_blocked: bool = False) -> Effect:
    """The planner finds no motion while this lasts: the skill is `unreachable`, or `blocked`.

    Args:
        is_blocked: True if an obstacle blocks the goal; False if the goal is out of reach.
    """
    return Effect("no_way", answers={"plan": _fail_planning}, arguments=(is_blocked,))


def workspace_hidden() -> Effect:
    """The arm hides the table from the camera while this lasts: `Detect` is `hidden`, or sees nothing."""
    return Effect("workspace_hidden", answers={"sees_table": _answer, "capture": _hide}, arguments=(False,))


def no_depth() -> Effect:
    """No detection can be localized while this lasts: `Localize` fails with `no_depth`."""
    return Effect("no_depth", answers={"localize": _lose_depth})


def table_bumped() -> Effect:
    """The table is bumped once, and the ledger is informed: frames and targets are `stale`."""
    return Effect("table_bumped", _bump_table)


def operator_quits() -> Effect:
    """The operator quits while this lasts: `AwaitRequest` fails with `quit`."""
    return Effect("operator_quits", answers={"ask": _answer}, arguments=(None,))


def operator_asks_rescan() -> Effect:
    """The operator requests a new look while this lasts: `AwaitRequest` fails with `rescan`."""
    return Effect("operator_asks_rescan", answers={"ask": _answer}, arguments=("rescan",))


def _answer(proceed: Callable[[], object], occurrence: Occurrence, answer: object) -> object:
    """Return `answer` instead of the cell's own answer."""
    del proceed
    occurrence.record()
    return answer


def _keep_object(proceed: Callable[[], None], occurrence: Occurrence) -> None:
    if (held := occurrence.scene.world.held) is None:
        proceed()
    else:
        occurrence.record(held)


def _break_seal(occurrence: Occurrence, share: float) -> bool:
    world = occurrence.scene.world
    if (held := world.held) is None or occurrence.scene.progress < share:
        return False
    occurrence.record(held)
    world.break_seal()
    return True


def _break_seal_over_wrong_bin(occurrence: Occurrence) -> bool:
    scene, held = occurrence.scene, occurrence.scene.world.held
    if held is None or scene.progress == 0.0:
        return False
    right_bins = scene.cell.routes.get(held.label, ())
    bins = scene.cell.bins.items()
    is_over_wrong_bin = any(name not in right_bins and bin.contains(held.position) for name, bin in bins)
    return is_over_wrong_bin and _break_seal(occurrence, 0.0)


def _block_arm(occurrence: Occurrence, obstacle: str, share: float) -> bool:
    if occurrence.scene.progress < share:
        return False
    occurrence.record()
    occurrence.scene.world.block_arm(f"the arm ran into {obstacle}")
    return True


def _bump_table(occurrence: Occurrence) -> bool:
    occurrence.record()
    occurrence.scene.cell.ledger.invalidate_positions()
    return True


def _hide(proceed: Callable[[], Frame], occurrence: Occurrence, answer: object) -> Frame:
    """Return a frame that shows only the arm."""
    del answer
    occurrence.record()
    frame = proceed()
    return replace(frame, visible=np.zeros_like(frame.visible))


def _lose_depth(proceed: Callable[[], Any], occurrence: Occurrence) -> Any:
    del proceed
    occurrence.record()
    raise NoDepth("the frame has no depth there (injected fault)")


@dataclass(frozen=True)
class FailingPlanning:
    """A plan that takes the usual time and finds no motion; implements `Planning`."""

    planning: Planning
    is_blocked: bool

    @property
    def ready(self) -> bool:
        """True if the planning time is over."""
        return self.planning.ready

    def result(self) -> Motion:
        """Raise Blocked or Unreachable."""
        if self.is_blocked:
            raise Blocked("something is in the way (injected fault)")
        raise Unreachable("the planner finds no motion (injected fault)")


def _fail_planning(proceed: Callable[[], Planning], occurrence: Occurrence, is_blocked: bool) -> Planning:
    occurrence.record()
    return FailingPlanning(proceed(), is_blocked)
