"""Fault scripts: lists of scheduled faults of a cell, which tests inject into runs.

Examples of faults in a script for `run_mission(faults=[...])`:

* The second grasp fails: `during("*/Grasp", grip_fails(), activations=2)`
* The detector does not answer from 4 s to 9 s: `between(4.0, 9.0, detector_hangs())`
* The object nearest to the tool is removed at 12 s: `after(12.0, object_removed("nearest"))`

An effect lasts until its fault ends, or happens once if its docstring says so. An effect on detectors
concerns the requests that a skill makes while the fault lasts. Two arguments belong to several effects:

* `choice`: the number of an object, from 1; `nearest` to the tool; `held` by the tool; or `node` for the true
  object of the item that the node handles, or for the nearest object if the node handles no item.
* `fraction`: the effect begins after this fraction of a motion of the arm, 0 to 1; None: at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from executive.cell.arm import Motion
from executive.cell.frame import Answer
from executive.errors import InputError, NoDepth, Unavailable, Unreachable
from executive.testing.faulty_cell import Effect, ObjectChoice, Occurrence, ScheduledFault
from executive.testing.oracle import WorldAccess

UNSURE_CONFIDENCE_FRACTION = 0.9
"""Maximum confidence of the detections of an unsure detector, as a fraction of its threshold."""
BUMP_DISTANCE = 0.06
"""Displacement of an object that is bumped aside [m]."""
BUMP_DIRECTION_COUNT = 8
"""Number of evenly spaced directions that are tried, in order, for a free position of a bumped object."""
Interval = tuple[float, float]
"""Minimum and maximum of a coordinate [m]."""
AnswerChange = Callable[[Answer], Answer]
"""Function that returns a changed answer of a detector, or raises Unavailable."""


def during(pattern: str, effect: Effect, *, activations: int | Collection[int] = ()) -> ScheduledFault:
    """Return a fault that lasts while a node runs.

    Args:
        pattern: Pattern that the path of the node matches: `*/Grasp`; `*` matches any text, also with `/`.
        effect: Effect of the fault.
        activations: One or more numbers of activations, from 1 over all matching nodes; empty: all.
    """
    numbers = (activations,) if isinstance(activations, int) else tuple(activations)
    if any(number < 1 for number in numbers):
        raise InputError(f"the number of an activation must be at least 1, not {activations}")
    return ScheduledFault(effect, pattern, numbers)


def between(start: float, end: float, effect: Effect) -> ScheduledFault:
    """Return a fault that lasts from `start` (included) to `end` (excluded) on the run's clock [s]."""
    if not 0.0 <= start < end:
        raise InputError(f"a fault needs times with 0 <= start < end, not {start:g} s and {end:g} s")
    return ScheduledFault(effect, start=start, end=end)


def after(start: float, effect: Effect) -> ScheduledFault:
    """Return a fault that lasts from `start` on the run's clock [s] until the end of the run."""
    return between(start, math.inf, effect)


def grip_fails() -> Effect:
    """Return an effect: the tool cannot grip, and `Grasp` fails with `missed`; held objects stay held."""
    return _make_constant_effect("grip_fails", "tool.close", None)


def workspace_occluded() -> Effect:
    """Return an effect: the camera does not see the whole table, and `Detect` fails with `hidden`."""
    return _make_constant_effect("workspace_occluded", "camera.sees_table", False)


def operator_quits() -> Effect:
    """Return an effect: the operator quits, and `AwaitRequest` fails with `quit`."""
    return _make_constant_effect("operator_quits", "operator.ask", None)


def operator_asks_rescan() -> Effect:
    """Return an effect: the operator requests a new scan, and `AwaitRequest` fails with `rescan`."""
    return _make_constant_effect("operator_asks_rescan", "operator.ask", "rescan")


def _make_constant_effect(name: str, path: str, result: object) -> Effect:
    """Return an effect: the method with this path is not called, and its result is `result`."""
    return Effect(name, interceptors={path: _return_constant}, arguments=(result,))


def _return_constant(proceed: Callable[[], object], occurrence: Occurrence, answer: object) -> object:
    del proceed
    occurrence.emit_event()
    return answer


def object_ungrippable(choice: ObjectChoice) -> Effect:
    """Return an effect: the tool cannot grip one object, and `Grasp` fails with `missed` on this object."""
    return Effect("grip_fails", interceptors={"tool.close": _prevent_grip}, arguments=(choice,))


def _prevent_grip(proceed: Callable[[], None], occurrence: Occurrence, choice: ObjectChoice) -> None:
    chosen_object = occurrence.find_object(choice)
    touched_object = occurrence.find_object("nearest")
    if chosen_object and touched_object and chosen_object.body == touched_object.body:
        occurrence.emit_event(chosen_object)
    else:
        proceed()


def tool_does_not_release() -> Effect:
    """Return an effect: the object sticks to the opened tool, and `Release` fails with `stuck`."""
    return Effect("tool_does_not_release", interceptors={"tool.open": _prevent_opening})


def _prevent_opening(proceed: Callable[[], None], occurrence: Occurrence) -> None:
    held_object = occurrence.context.world.held_object
    if held_object is None:
        proceed()
    else:
        occurrence.emit_event(held_object)


def no_depth() -> Effect:
    """Return an effect: no detection can be localized, and `Localize` fails with `no_depth`."""
    return Effect("no_depth", interceptors={"localizer.localize": _raise_no_depth})


def _raise_no_depth(proceed: Callable[[], object], occurrence: Occurrence) -> None:
    del proceed
    occurrence.emit_event()
    raise NoDepth("the frame has no depth there (injected fault)")


def table_bumped() -> Effect:
    """Return an effect: the table is bumped once; skills with older frames or targets fail with `stale`."""
    return Effect("table_bumped", _bump_table)


def _bump_table(occurrence: Occurrence) -> bool:
    occurrence.emit_event()
    occurrence.context.station.ledger.invalidate_positions()
    return True


def arm_collides(obstacle: str = "something", fraction: float = 0.5) -> Effect:
    """Return an effect: the arm collides once with `obstacle` and brakes; the skill fails with `blocked`."""
    return Effect("arm_collides", _collide_arm, arguments=(obstacle,), fraction=fraction)


def _collide_arm(occurrence: Occurrence, obstacle: str) -> bool:
    occurrence.emit_event()
    occurrence.context.world.driver.collide(f"the arm ran into {obstacle}")
    return True


def grip_lost(fraction: float | None = 0.5) -> Effect:
    """Return an effect: the tool loses its object once, and `Transit` fails with `dropped`."""
    return Effect("grip_lost", _change_object, arguments=("held", WorldAccess.release), fraction=fraction)


def object_removed(choice: ObjectChoice = "node", fraction: float | None = None) -> Effect:
    """Return an effect: an object is removed once, even from the tool."""
    return Effect("object_removed", _change_object, arguments=(choice, WorldAccess.remove), fraction=fraction)


def object_moved(
    displacement: tuple[float, float], choice: ObjectChoice = "node", fraction: float | None = None
) -> Effect:
    """Return an effect: an object is displaced once [m]; a simulated object there is pushed aside."""
    arguments = (choice, WorldAccess.move, displacement)
    return Effect("object_moved", _change_object, arguments=arguments, fraction=fraction)


def _change_object(
    occurrence: Occurrence, choice: ObjectChoice, change: Callable[..., None], *arguments: object
) -> bool:
    """Call `change(world, true_object, *arguments)`; return False if no object matches."""
    true_object = occurrence.find_object(choice)
    if true_object is not None:
        occurrence.emit_event(true_object)
        change(occurrence.context.world, true_object, *arguments)
    return true_object is not None


def object_bumped(
    x: Interval, y: Interval, choice: ObjectChoice = "node", fraction: float | None = None
) -> Effect:
    """Return an effect: an object is bumped once, by `BUMP_DISTANCE`, to a free position in `x`, `y`."""
    return Effect("object_moved", _bump_object, arguments=(choice, x, y), fraction=fraction)


def _bump_object(occurrence: Occurrence, choice: ObjectChoice, x: Interval, y: Interval) -> bool:
    bumped_object = occurrence.find_object(choice)
    if bumped_object is None:
        return False
    for angle in np.linspace(0.0, 2 * math.pi, BUMP_DIRECTION_COUNT, endpoint=False):
        displacement = (BUMP_DISTANCE * math.cos(angle), BUMP_DISTANCE * math.sin(angle))
        position = bumped_object.position[:2] + displacement
        is_inside = x[0] <= position[0] <= x[1] and y[0] <= position[1] <= y[1]
        if is_inside and occurrence.context.world.is_free(position, bumped_object):
            return _change_object(occurrence, choice, WorldAccess.move, displacement)
    return False


def no_path() -> Effect:
    """Return an effect: planning fails, and skills that move the arm fail with `unreachable`."""
    return Effect("no_path", interceptors={"planner.plan": _change_answer}, arguments=(_raise_unreachable,))


def _raise_unreachable(motion: Motion) -> Motion:
    del motion
    raise Unreachable("the planner finds no motion (injected fault)")


def detector_dead() -> Effect:
    """Return an effect: requests fail instead of an answer, and `Detect` fails with `unavailable`."""
    return make_detector_effect("detector_dead", _raise_unavailable)


def detector_hangs() -> Effect:
    """Return an effect: requests are answered when the fault ends; a node that ends before gets no answer."""
    return make_detector_effect("detector_hangs", hangs=True)


def detector_unsure() -> Effect:
    """Return an effect: all confidences are below the threshold, and `Detect` fails with `unsure`."""
    return make_detector_effect("detector_unsure", _reduce_confidence)


def detector_finds_nothing() -> Effect:
    """Return an effect: nothing is detected, and `Detect` succeeds with an empty list."""
    return make_detector_effect("detector_finds_nothing", _remove_detections)


def make_detector_effect(name: str, change_answer: AnswerChange | None = None, hangs: bool = False) -> Effect:
    """Return an effect: the detector answers with changed answers, or not before the end of the fault."""
    return Effect(name, interceptors={"detector.request": _change_answer}, arguments=(change_answer, hangs))


@dataclass(frozen=True, eq=False)
class _ChangedRequest:
    """Pending answer of a detector or a planner, changed, or held back while `is_released` returns False."""

    request: Any
    change: Callable[[Any], Any] | None
    is_released: Callable[[], bool]

    @property
    def ready(self) -> bool:
        return self.request.ready and self.is_released()

    def result(self) -> Any:
        answer = self.request.result()
        return self.change(answer) if self.change else answer


def _change_answer(
    proceed: Callable[[], Any], occurrence: Occurrence, change: Callable[..., Any] | None, hangs: bool = False
) -> _ChangedRequest:
    occurrence.emit_event()
    return _ChangedRequest(proceed(), change, lambda: occurrence.is_over or not hangs)


def _raise_unavailable(answer: Answer) -> Answer:
    raise Unavailable(f"detector {answer.detector}: the detector is dead (injected fault)")


def _reduce_confidence(answer: Answer) -> Answer:
    """Return an answer whose confidences are below the threshold."""
    max_confidence = UNSURE_CONFIDENCE_FRACTION * answer.error_rates.threshold
    detections = sorted((*answer.confident, *answer.doubtful), key=lambda detection: -detection.confidence)
    doubtful = tuple(replace(found, confidence=min(found.confidence, max_confidence)) for found in detections)
    return replace(answer, confident=(), doubtful=doubtful, unknown=())


def _remove_detections(answer: Answer) -> Answer:
    return replace(answer, confident=(), doubtful=(), unknown=())
