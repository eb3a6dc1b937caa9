"""One run of a skill in a situation, to its end or until it is halted, with everything noted."""

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
from executive.testing.conformance.situations import Arrange, Situation, begin
from executive.testing.conformance.source import place_in
from executive.testing.faults import FaultyCell, during
from executive.tree.skill_run import SkillRun

MAX_TIME = 60.0
"""Time on the run's clock after which a skill must have ended [s]: nothing takes so long on a fake table."""
STUCK_TIMEOUT = 10.0
"""Time by the wall clock after which a skill that gets no further is stuck [s]."""

LOOKS = 2
"""Number of looks in this time: a machine that slept has let one pass at most."""
_ROLES = ("arm", "tool", "camera", "detector", "ledger", "localizer", "operator")


@dataclass(frozen=True)
class Call:
    """A call of a part of the cell.

    Attributes:
        tick: Control step in which it was made.
        name: Part and method, for instance `arm.start`.
        arguments: Arguments of the call.
    """

    tick: int
    name: str
    arguments: tuple[Any, ...]


class SkillRehearsal:
    """One run of a skill, driven as the tree would.

    Args:
        skill: Class of the skill.
        situation: Situation in which the run begins.
        arrange: Changes of the stage by the author of the skill.
        fault: Injected fault, or None.
        halt_at: Control step before which the skill is halted; None for a run to its end.

    Attributes:
        where: The situation and the fault, for a sentence.
        status: `SUCCESS`, `FAILURE`, `HALTED`, `RUNNING` if it did not end, `STUCK` if a tick did not come
            back, or `FAULT`.
        reason: Reason of a failure.
        message: Sentence of a failure or fault, or where a tick got stuck.
        ticks: Control steps it took, that of its end left out.
        outputs: Its outputs after success.
        calls: Every call it made of the cell.
        durations: Computing time of every tick, by the wall clock [s].
        changed: Names of the params and inputs that are no longer what they were.
        held: The tool held something when it began.
        holds: The tool holds something at the end.
        is_known: The ledger believes an item in the tool at the end.
        at_rest: The arm has nothing left to do at the end.
    """

    def __init__(
        self,
        skill: type[Skill],
        situation: Situation,
        arrange: Arrange,
        fault: NamedFault | None = None,
        halt_at: int | None = None,
    ) -> None:
        stage, values = begin(skill, situation, arrange)
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
        watched = intercept(cell.cell, self._watch, _ROLES)
        try:
            with patience(skill, lambda: self.ticks):
                self.status = self._act(values, cell, watched, fault.tick if fault else 0)
        except Stuck as stuck:
            self.status, self.message = "STUCK", str(stuck)
        self.changed = [name for name in values if not is_same(values[name], before[name])]
        self.holds, self.is_known = fake.tool.holding, fake.ledger.find_held_item() is not None
        self.at_rest = fake.arm.at_rest

    @property
    def end(self) -> str:
        """Place and kind of its end, as a part of a sentence."""
        words = {
            "SUCCESS": "it succeeded",
            "FAILURE": f'it failed with "{self.reason}" ({self.message})',
            "HALTED": f"it was halted at tick {self.ticks}",
            "RUNNING": "it was not over",
        }
        return f"{self.where} {words.get(self.status, f'it ended as a fault: {self.message}')}"

    @property
    def has_moved(self) -> bool:
        """True if it started the arm."""
        return any(call.name == "arm.start" for call in self.calls)

    def _watch(self, access: Access) -> Any:
        if access.is_call and access.role in _ROLES:
            self.calls.append(Call(self.ticks, access.name, access.all_arguments))
        return access.proceed()

    def _act(self, values: Mapping[str, Any], cell: FaultyCell, watched: Cell, fault_tick: int) -> str:
        """Run the skill and return its status at the end."""
        skill = self._skill
        run: SkillRun | None = None
        try:
            while self.ticks < MAX_TIME / STEP:
                if run is not None and self.ticks == self._halt_at:
                    run.halt()
                    return "HALTED"
                if self.ticks == fault_tick:
                    cell.hear(TimedEvent(0, 0.0, NodeStarted("skill")))
                began = perf_counter()
                run = run or SkillRun(skill(**values), watched)
                has_succeeded = run.step()
                self.durations.append(perf_counter() - began)
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
            place = place_in(skill, ((frame.filename, frame.lineno or 0) for frame in reversed(frames)))
            kind = "" if isinstance(error, Fault) else f"{type(error).__name__}: "
            self.message = f"{kind}{error}" + (f" ({place})" if place else "")
            return "FAULT"
        return "RUNNING"


class Stuck(BaseException):
    """A skill did not come back; the text, to follow its name, says for how long and where.

    It is no Exception, so that a skill that catches those is broken off like any other.
    """


@contextmanager
def patience(skill: type[Skill], progress: Callable[[], object]) -> Iterator[None]:
    """Break off what is done inside as soon as `progress` returns the same for `STUCK_TIMEOUT`.

    Python hands signals to its main thread alone: in another one nothing is broken off.

    Raises:
        Stuck: It was broken off.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    last, looks = progress(), 0

    def look(_: int, frame: FrameType | None) -> None:
        nonlocal last, looks
        now = progress()
        looks, last = (looks + 1 if now == last else 0), now
        if looks >= LOOKS:
            where = place_in(skill, ((f.f_code.co_filename, line) for f, line in walk_stack(frame)))
            raise Stuck(f"did not come back for {STUCK_TIMEOUT:g} s{where and f', at {where}'}")

    answered = signal.signal(signal.SIGALRM, look)
    before = signal.setitimer(signal.ITIMER_REAL, STUCK_TIMEOUT / LOOKS, STUCK_TIMEOUT / LOOKS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, *before)
        signal.signal(signal.SIGALRM, answered or signal.SIG_DFL)


def is_same(one: Any, other: Any) -> bool:
    """Return True if two values are equal part by part; values that cannot be taken apart count as equal."""
    try:
        return pickle.dumps(one) == pickle.dumps(other)
    except (pickle.PicklingError, TypeError, AttributeError):
        return True
