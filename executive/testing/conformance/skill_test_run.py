"""Test run of a skill: one run in a situation, to its end or to a halt, with a record of its calls."""

from __future__ import annotations

import copy
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from traceback import extract_tb, walk_stack
from types import FrameType
from typing import Any

from executive.cell.clock import STEP
from executive.cell.proxy import Access, intercept
from executive.cells.fake.cell import FakeCell
from executive.errors import Fault
from executive.events import NodeStarted, TimedEvent
from executive.skill import Skill, SkillFailed
from executive.testing.conformance.situations import Arrange, Situation, prepare_scene
from executive.testing.faults import Effect, FaultyCell, during
from executive.tree.skill_run import SkillRun

MAX_RUN_TIME = 60.0
"""Maximum duration of a skill on the run's clock [s]; no skill needs as long on the fake cell."""
STUCK_TIMEOUT = 10.0
"""Wall time without a new tick after which a tick counts as stuck [s]."""
PROGRESS_CHECKS = 2
"""Number of checks in `STUCK_TIMEOUT`; more than one, because a check after a suspension comes too early."""
_OBSERVED_ROLES = ("arm", "tool", "camera", "detector", "ledger", "localizer", "operator")
"""Parts of the cell whose calls are recorded."""


@dataclass(frozen=True)
class Call:
    """A recorded call of a method of a part of the cell.

    Attributes:
        tick: Number of the control step of the call, from 0.
        name: Part and method, for instance `arm.start`.
        arguments: Arguments of the call; () in a run with a fault or a halt.
    """

    tick: int
    name: str
    arguments: tuple[Any, ...]


@dataclass(frozen=True)
class NamedFault:
    """A fault of the cell in a test run of a skill.

    Attributes:
        name: Description, as a part of a sentence: `while the table is empty`.
        effect: Effect of the fault on the cell.
        resource: Resource that affected skills use: `arm`, `tool` or `camera`; "" if all skills are affected.
        requires_holding: True if the fault affects only runs with an object in the tool at the start.
        tick: Control step before which the fault begins.
    """

    name: str
    effect: Effect
    resource: str = ""
    requires_holding: bool = False
    tick: int = 0


class SkillTestRun:
    """One run of a skill, which is ticked as in a behaviour tree; the constructor executes the run.

    Args:
        skill: Class of the skill.
        situation: Situation in which the run begins.
        arrange: Function of the skill's author that changes the scene and returns params and inputs.
        fault: Injected fault; None: no fault.
        halt_at: Control step before which the skill is halted; None: no halt.

    Attributes:
        skill: The tested skill.
        situation: Situation in which the run began.
        description: Situation and fault, as the beginning of a sentence.
        status: `SUCCESS`; `FAILURE`; `HALTED`; `RUNNING`: no end within `MAX_RUN_TIME`; `STUCK`: a tick did
            not return; `FAULT`: the skill raised an exception or violated its declarations.
        reason: Reason of a failure, or "".
        message: Message of a failure or fault, or duration and place of a stuck tick.
        ticks: Number of complete control steps.
        outputs: Values of the output ports by name, after success.
        cell_calls: All calls of parts of the cell, in order.
        tick_durations: Computing time of each tick [s].
        changed_names: Names of the params and inputs whose values the skill changed.
        holds_object_at_start: True if the tool held an object at the start.
        holds_object_at_end: True if the tool holds an object at the end.
        is_item_held: True if the tool holds an item at the end according to the ledger.
        is_at_rest: True if the arm is at rest at the end.
    """

    def __init__(
        self,
        skill: type[Skill],
        situation: Situation,
        arrange: Arrange,
        fault: NamedFault | None = None,
        halt_at: int | None = None,
    ) -> None:
        scene, values = prepare_scene(skill, situation, arrange)
        fake = scene.cell
        originals = values if halt_at else copy.deepcopy(values, {id(fake): fake})
        self.situation, self.skill, self._fault, self._halt_at = situation, skill, fault, halt_at
        self.description = f"{situation.name} {fault.name}" if fault else situation.name
        self.reason = self.message = ""
        self.ticks = 0
        self.outputs: Mapping[str, Any] = {}
        self.cell_calls, self.tick_durations = list[Call](), list[float]()
        self.holds_object_at_start = fake.tool.holding
        self.status = self._run_skill(values, fake)
        self.changed_names = [name for name in values if not has_equal_pickle(values[name], originals[name])]
        self.holds_object_at_end = fake.tool.holding
        self.is_item_held, self.is_at_rest = fake.ledger.find_held_item() is not None, fake.arm.at_rest

    @property
    def result_description(self) -> str:
        """Situation, fault and result of the run, as a part of a sentence."""
        result_texts = {
            "SUCCESS": "it succeeded",
            "FAILURE": f'it failed with "{self.reason}" ({self.message})',
            "HALTED": f"it was halted at tick {self.ticks}",
            "RUNNING": "it was still running",
        }
        return f"{self.description} {result_texts.get(self.status, f'it raised a fault: {self.message}')}"

    def _record_call(self, access: Access) -> Any:
        if access.is_call and access.role in _OBSERVED_ROLES:
            # Only runs without fault and halt are compared; the arguments may be large, for instance frames.
            arguments = access.all_arguments if self._fault is None and self._halt_at is None else ()
            self.cell_calls.append(Call(self.ticks, access.name, arguments))
        return access.proceed()

    def _run_skill(self, values: Mapping[str, Any], fake: FakeCell) -> str:
        """Tick the skill until its end or halt, and return the status."""
        fault = self._fault
        cell = FaultyCell(fake, [during("*", fault.effect)] if fault else [])
        try:
            recorded_cell = intercept(cell.cell, self._record_call, _OBSERVED_ROLES)
            with interrupt_stuck_ticks(self.skill, lambda: self.ticks):
                run = SkillRun(self.skill(**values), recorded_cell)
                while self.ticks < MAX_RUN_TIME / STEP:
                    if self.ticks == self._halt_at:
                        run.halt()
                        return "HALTED"
                    if fault is not None and self.ticks == fault.tick:
                        cell.on_event(TimedEvent(0, 0.0, NodeStarted("skill")))
                    start_time = perf_counter()
                    has_succeeded = run.step()
                    self.tick_durations.append(perf_counter() - start_time)
                    if has_succeeded:
                        self.outputs = run.read_outputs()
                        return "SUCCESS"
                    cell.advance()
                    self.ticks += 1
        except TickStuck as stuck:
            self.message = str(stuck)
            return "STUCK"
        except SkillFailed as failure:
            self.reason, self.message = failure.reason, failure.message
            return "FAILURE"
        except Exception as error:
            frames = reversed(extract_tb(error.__traceback__))
            place = _find_skill_line(self.skill, ((frame.filename, frame.lineno or 0) for frame in frames))
            kind = "" if isinstance(error, Fault) else f"{type(error).__name__}: "
            self.message = f"{kind}{error}" + (f" ({place})" if place else "")
            return "FAULT"
        return "RUNNING"


class TickStuck(BaseException):
    """A tick or the constructor did not return; the message says so of the skill, with time and place.

    Not a subclass of Exception, so that a skill that catches exceptions is interrupted, too.
    """


@contextmanager
def interrupt_stuck_ticks(skill: type[Skill], count_ticks: Callable[[], int]) -> Iterator[None]:
    """Interrupt the body of the `with` if `count_ticks` returns the same number during `STUCK_TIMEOUT`.

    Outside the main thread, bodies are not interrupted: Python handles signals only in the main thread.

    Raises:
        TickStuck: The body was interrupted.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    last_tick, unchanged_checks = count_ticks(), 0

    def on_timer(_: int, frame: FrameType | None) -> None:
        nonlocal last_tick, unchanged_checks
        tick = count_ticks()
        unchanged_checks, last_tick = (unchanged_checks + 1 if tick == last_tick else 0), tick
        if unchanged_checks >= PROGRESS_CHECKS:
            callers = walk_stack(frame)
            place = _find_skill_line(skill, ((caller.f_code.co_filename, line) for caller, line in callers))
            raise TickStuck(f"did not return for {STUCK_TIMEOUT:g} s{place and f', at {place}'}")

    old_handler = signal.signal(signal.SIGALRM, on_timer)
    period = STUCK_TIMEOUT / PROGRESS_CHECKS
    old_timer = signal.setitimer(signal.ITIMER_REAL, period, period)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, *old_timer)
        signal.signal(signal.SIGALRM, old_handler or signal.SIG_DFL)


def has_equal_pickle(value: Any, other: Any) -> bool:
    """Return True if the pickles of two values are equal; also True if a value cannot be pickled."""
    try:
        return pickle.dumps(value) == pickle.dumps(other)
    except (pickle.PicklingError, TypeError, AttributeError):
        return True


def _find_skill_line(skill: type[Skill], frames: Iterable[tuple[str, int]]) -> str:
    """Return the first `(file, line)` that is in a source file of the skill, as `wave.py:12`, or "".

    The files of a skill are those of its class and its base classes, except base classes of this package.
    """
    package = Skill.__module__.partition(".")[0]
    module_names = [parent.__module__ for parent in skill.__mro__ if issubclass(parent, Skill)]
    modules = [sys.modules.get(name) for name in module_names if name.partition(".")[0] != package]
    files = {getattr(module, "__file__", "") for module in modules}
    return next((f"{Path(file).name}:{line}" for file, line in frames if file in files), "")
