"""Faults of arm, tool, camera, localizer, table and operator.

An effect lasts until its fault ends, or happens once if its docstring says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from executive.cell.arm import Motion, Planning
from executive.cell.frame import Frame
from executive.errors import Blocked, NoDepth, Unreachable
from executive.testing.faults.effect import Effect, Occurrence, validate_fraction


def seal_fails() -> Effect:
    """Return an effect: the cup cannot seal, and `Grasp` fails with `missed`; held objects stay held."""
    return Effect("seal_fails", interceptors={"close": _return_constant}, arguments=(None,))


def seal_breaks(fraction: float | None = 0.5) -> Effect:
    """Return an effect: the seal breaks once, the object falls, and `Transit` fails with `dropped`.

    Args:
        fraction: Fraction of the motion after which the seal breaks, 0 to 1; None: at once, also at rest.

    Raises:
        InputError: The fraction is not between 0 and 1, both excluded.
    """
    return Effect("seal_breaks", _break_seal, arguments=(validate_fraction(fraction),))


def seal_breaks_over_wrong_bin() -> Effect:
    """Return an effect: the seal breaks once, and the object falls into a bin that is wrong for its class."""
    return Effect("seal_breaks", _break_seal_over_wrong_bin)


def tool_does_not_release() -> Effect:
    """Return an effect: the object sticks to the opened tool, and `Release` fails with `stuck`."""
    return Effect("tool_does_not_release", interceptors={"open": _prevent_opening})


def arm_collides(obstacle: str = "something", fraction: float = 0.5) -> Effect:
    """Return an effect: the arm collides once and brakes, and the skill fails with `blocked`.

    Args:
        obstacle: Name of the obstacle in the message of the failure.
        fraction: Fraction of the motion after which the arm collides, 0 to 1.

    Raises:
        InputError: The fraction is not between 0 and 1, both excluded.
    """
    return Effect("arm_collides", _collide_arm, arguments=(obstacle, validate_fraction(fraction)))


def no_path(*, is_blocked: bool = False) -> Effect:
    """Return an effect: planning fails; the reason is `blocked` if `is_blocked`, otherwise `unreachable`."""
    return Effect("no_path", interceptors={"plan": _fail_planning}, arguments=(is_blocked,))


def workspace_occluded() -> Effect:
    """Return an effect: the arm occludes the table, and `Detect` fails with `hidden`, or detects nothing."""
    return Effect("workspace_occluded", interceptors={"sees_table": _hide_table, "capture": _occlude_frame})


def no_depth() -> Effect:
    """Return an effect: no detection can be localized, and `Localize` fails with `no_depth`."""
    return Effect("no_depth", interceptors={"localize": _raise_no_depth})


def table_bumped() -> Effect:
    """Return an effect: the table is bumped once; skills with older frames or targets fail with `stale`."""
    return Effect("table_bumped", _bump_table)


def operator_quits() -> Effect:
    """Return an effect: the operator quits, and `AwaitRequest` fails with `quit`."""
    return Effect("operator_quits", interceptors={"ask": _return_constant}, arguments=(None,))


def operator_asks_rescan() -> Effect:
    """Return an effect: the operator requests a new scan, and `AwaitRequest` fails with `rescan`."""
    return Effect("operator_asks_rescan", interceptors={"ask": _return_constant}, arguments=("rescan",))


def _return_constant(proceed: Callable[[], object], occurrence: Occurrence, answer: object) -> object:
    """Return `answer` without calling the method of the cell."""
    del proceed
    occurrence.emit_event()
    return answer


def _prevent_opening(proceed: Callable[[], None], occurrence: Occurrence) -> None:
    """Open the tool only if it is empty."""
    held_object = occurrence.context.world.held_object
    if held_object is None:
        proceed()
    else:
        occurrence.emit_event(held_object)


def _break_seal(occurrence: Occurrence, fraction: float) -> bool:
    context, held_object = occurrence.context, occurrence.context.world.held_object
    if held_object is None or context.motion_progress < fraction:
        return False
    occurrence.emit_event(held_object)
    context.world.break_seal()
    return True


def _break_seal_over_wrong_bin(occurrence: Occurrence) -> bool:
    context, held_object = occurrence.context, occurrence.context.world.held_object
    if held_object is None or context.motion_progress == 0.0:
        return False
    permitted_bin_names = context.cell.routes.get(held_object.label, ())
    wrong_bins = [bin for name, bin in context.cell.bins.items() if name not in permitted_bin_names]
    is_over_wrong_bin = any(bin.contains(held_object.position) for bin in wrong_bins)
    return is_over_wrong_bin and _break_seal(occurrence, 0.0)


def _collide_arm(occurrence: Occurrence, obstacle: str, fraction: float) -> bool:
    if occurrence.context.motion_progress < fraction:
        return False
    occurrence.emit_event()
    occurrence.context.world.simulate_collision(f"the arm ran into {obstacle}")
    return True


def _bump_table(occurrence: Occurrence) -> bool:
    occurrence.emit_event()
    occurrence.context.cell.ledger.invalidate_positions()
    return True


def _hide_table(proceed: Callable[[], object], occurrence: Occurrence) -> object:
    return _return_constant(proceed, occurrence, False)


def _occlude_frame(proceed: Callable[[], Frame], occurrence: Occurrence) -> Frame:
    """Return the captured frame with all pixels marked as occluded by the arm."""
    occurrence.emit_event()
    frame = proceed()
    return replace(frame, visible=np.zeros_like(frame.visible))


def _raise_no_depth(proceed: Callable[[], Any], occurrence: Occurrence) -> Any:
    """Raise NoDepth instead of localizing the detection."""
    del proceed
    occurrence.emit_event()
    raise NoDepth("the frame has no depth there (injected fault)")


@dataclass(frozen=True)
class FailingPlanning:
    """A planning that ends without a motion; implements `Planning`.

    Attributes:
        planning: The original planning; the failure is reported when this planning ends.
        is_blocked: True if the planning fails with Blocked; False if it fails with Unreachable.
    """

    planning: Planning
    is_blocked: bool

    @property
    def ready(self) -> bool:
        """True if the planning has ended."""
        return self.planning.ready

    def result(self) -> Motion:
        """Raise Blocked or Unreachable."""
        if self.is_blocked:
            raise Blocked("an obstacle blocks the goal (injected fault)")
        raise Unreachable("the planner finds no motion (injected fault)")


def _fail_planning(proceed: Callable[[], Planning], occurrence: Occurrence, is_blocked: bool) -> Planning:
    occurrence.emit_event()
    return FailingPlanning(proceed(), is_blocked)
