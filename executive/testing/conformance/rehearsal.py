"""One recorded run of a skill in a situation, to its end or to a halt."""

from __future__ import annotations

import copy
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from traceback import extract_tb, walk_stack
from types import FrameType
from typing import Any

from executive.cell.clock import STEP
from executive.cell.protocols import Cell
from executive.cell.proxy import Access, intercept
from executive.errors import Fault
from executive.events import NodeStarted, TimedEvent
from executive.skill import Skill, SkillFailed
from executive.testing.conformance.faults import NamedFault
from executive.testing.conformance.situations import Arrange, Situation, prepare
from executive.testing.conformance.source import find_own_line
from executive.testing.faults import FaultyCell, during
from executive.tree.skill_run import SkillRun

MAX_TIME = 60.0
"""Maximum duration of a skill on the run's clock [s]; longer than any skill needs on the fake table."""
STUCK_TIMEOUT = 10.0
"""Wall time without progress after which a tick counts as stuck [s]."""
PROGRESS_CHECKS = 2
"""Number of checks of the progress in this time; the sleep of a machine can delay only one."""
_ROLES = ("arm", "tool", "camera", "detector", "ledger", "localizer", "operator")


@dataclass(frozen=True)
class Call:
    """A call of a part of the cell.

    Attributes:
        tick: Control step of the call.
        name: Part and method, for instance `arm.start`.
        arguments: Arguments of the call.
    """

    tick: int
    name: str
    arguments: tuple[Any, ...]


class SkillRehearsal:
    """One run of a skill, driven as by the tree.

    Args:
        skill: Class of the skill.
        situation: Situation in which the run begins.
        arrange: Changes of the stage by the author of the skill.
        fault: Injected fault, or None.
        halt_at: Control step before which the skill is halted; None for a run to its end.

    Attributes:
        where: Situation and fault, as the beginning of a sentence.
        status: `SUCCESS`, `FAILURE`, `HALTED`, `RUNNING` without an end, `STUCK` if a tick did not return,
            or `FAULT`.
        reason: Reason of a failure.
        message: Message of a failure or fault, or the place of a stuck tick.
        ticks: Number of control steps before that of the end.
        outputs: Outputs after success.
        calls: All calls of the cell.
        durations: Wall time of each tick [s].
        changed: Names of the changed params and inputs.
        held: True if the tool held an object at the start.
        holds: True if the tool holds an object at the end.
        is_known: True if the ledger believes an item in the tool at the end.
        at_rest: True if the arm is at rest at the end.
    """

    def __init__(
        self,
        skill: type[Skill],
        situation: Situation,
        arrange: Arrange,
        fault: NamedFault | None = None,
        halt_at: int | None = None,
    ) -> None:
        stage, values = prepare(skill, situation, arrange)
        fake = stage.cell
        before = values if halt_at else copy.deepcopy(values, {id(fake): fake})
        script = [during("*", fault.effect)] * fault.times if fault else []
        cell = FaultyCell(fake, script)
        self.where = f"{situation.name} {fault.name}" if fault else situation.name
        self.reason = self.message = ""
        self.ticks, self._skill, self._halt_at = 0, skill, halt_at
        self.outputs: Mapping[str, Any] = {}
        self.calls, self.durations = list[Call](), list[float]()
        self.held = fake.tool.holding
        observed_cell = intercept(cell.cell, self._note_call, _ROLES)
        try:
            with stuck_detection(skill, lambda: self.ticks):
                self.status = self._execute(values, cell, observed_cell, fault.tick if fault else 0)
        except TickStuck as stuck:
            self.status, self.message = "STUCK", str(stuck)
        self.changed = [name for name in values if not is_same(values[name], before[name])]
        self.holds, self.is_known = fake.tool.holding, fake.ledger.find_held_item() is not None
        self.at_rest = fake.arm.at_rest

    @property
    def end(self) -> str:
        """Situation and kind of the end, as a part of a sentence."""
        ends = {
            "SUCCESS": "it succeeded",
            "FAILURE": f'it failed with "{self.reason}" ({self.message})',
            "HALTED": f"it was halted at tick {self.ticks}",
            "RUNNING": "it was not over",
        }
        return f"{self.where} {ends.get(self.status, f'it ended as a fault: {self.message}')}"

    @property
    def has_moved(self) -> bool:
        """True if the skill started the arm."""
        return any(call.name == "arm.start" for call in self.calls)

    def _note_call(self, access: Access) -> Any:
        if access.is_call and access.role in _ROLES:
            self.calls.append(Call(self.ticks, access.name, access.all_arguments))
        return access.proceed()

    def _execute(
        self, values: Mapping[str, Any], cell: FaultyCell, observed_cell: Cell, fault_tick: int
    ) -> str:
        """Run the skill and return the status at the end."""
        skill = self._skill
        run: SkillRun | None = None
        try:
            while self.ticks < MAX_TIME / STEP:
                if run is not None and self.ticks == self._halt_at:
                    run.halt()
                    return "HALTED"
                if self.ticks == fault_tick:
                    cell.hear(TimedEvent(0, 0.0, NodeStarted("skill")))
                start = perf_counter()
                run = run or SkillRun(skill(**values), observed_cell)
                has_succeeded = run.step()
                self.durations.append(perf_counter() - start)
                if has_succeeded:
                    self.outputs = run.read_outputs()
                    return "SUCCESS"
                cell.advance()
                self.ticks += 1
        except SkillFailed as failure:
            self.reason, self.message = failure.reason, failure.message
            return "FAILURE"
        except Exception as error:
            frames = extract_tb(error.__traceback__)
            place = find_own_line(skill, ((frame.filename, frame.lineno or 0) for frame in reversed(frames)))
            kind = "" if isinstance(error, Fault) else f"{type(error).__name__}: "
            self.message = f"{kind}{error}" + (f" ({place})" if place else "")
            return "FAULT"
        return "RUNNING"


class TickStuck(BaseException):
    """A tick did not return; the message continues the name of the skill with duration and place.

    The class is no subclass of Exception: a skill that catches exceptions is interrupted, too.
    """


@contextmanager
def stuck_detection(skill: type[Skill], progress: Callable[[], object]) -> Iterator[None]:
    """Interrupt the body if `progress` returns the same value during `STUCK_TIMEOUT`.

    Only the main thread is interrupted, because Python handles signals only there.

    Raises:
        TickStuck: The body was interrupted.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    last, unchanged_checks = progress(), 0

    def check(_: int, frame: FrameType | None) -> None:
        nonlocal last, unchanged_checks
        now = progress()
        unchanged_checks, last = (unchanged_checks + 1 if now == last else 0), now
        if unchanged_checks >= PROGRESS_CHECKS:
            where = find_own_line(skill, ((f.f_code.co_filename, line) for f, line in walk_stack(frame)))
            raise TickStuck(f"did not return for {STUCK_TIMEOUT:g} s{where and f', at {where}'}")

    old_handler = signal.signal(signal.SIGALRM, check)
    old_timer = signal.setitimer(
        signal.ITIMER_REAL, STUCK_TIMEOUT / PROGRESS_CHECKS, STUCK_TIMEOUT / PROGRESS_CHECKS
    )
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, *old_timer)
        signal.signal(signal.SIGALRM, old_handler or signal.SIG_DFL)


def is_same(value: Any, other: Any) -> bool:
    """Return True if two values have equal pickles; values that cannot be pickled count as equal."""
    try:
        return pickle.dumps(value) == pickle.dumps(other)
    except (pickle.PicklingError, TypeError, AttributeError):
        return True
