"""One run of a mission: the tick loop, the only place where intent becomes motion."""

from __future__ import annotations

import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from types import FrameType
from typing import Any

from py_trees.common import Status

from executive.cell import Operator
from executive.control.failure import Failure
from executive.control.halting import halt
from executive.control.scope import Scope
from executive.errors import ExecutiveError, Fault
from executive.events import Event, Observer
from executive.mission.build import build
from executive.mission.load import LoadedMission
from executive.runtime.cells import cell_kind
from executive.runtime.operator import ScriptedOperator, TerminalOperator
from executive.skill import Skill
from executive.workcell import CellOptions, Workcell

LONGEST_BRAKING = 2.0
"""Time after which an arm that was told to brake must be at rest [s]."""


@dataclass(frozen=True)
class _Ending:
    """How the tick loop ended; see `Outcome`."""

    status: str
    reason: str = ""
    message: str = ""
    node: str = ""
    traceback: str = ""


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `FAULT` or `HALTED`.
        reason: What failed, for instance `Transit.dropped`; "" on success.
        message: One sentence with numbers.
        node: Path of the deciding node, or "".
        ticks: Control steps taken.
        robot_time: Time on the run's clock [s].
    """

    status: str
    reason: str
    message: str
    node: str
    ticks: int
    robot_time: float


class Run:
    """A mission on a cell, ready to be executed once.

    Args:
        loaded: The mission and its cell, as loaded.
        skills: Installed skills by name.
        seed: Decides everything random.
        observers: Told of every event, in order.
        gui: Show the simulated world in a window.
        realtime: Pace the run by the wall clock.
        requests: What the operator asks for, or None to ask at the terminal.
        kind: Makes the work cell; by default the installed kind that the cell file names.

    Raises:
        InputError: The cell is of a kind that is not installed, or a request names no class.
    """

    def __init__(
        self,
        loaded: LoadedMission,
        skills: Mapping[str, type[Skill]],
        *,
        seed: int,
        observers: Sequence[Observer] = (),
        gui: bool = False,
        realtime: bool = False,
        requests: Sequence[str] | None = None,
        kind: Callable[..., Workcell] | None = None,
    ) -> None:
        self._loaded = loaded
        self._seed = seed
        self._observers = list(observers)
        self._realtime = realtime
        self._tick = 0
        self._interrupted = False
        self._workcell: Workcell | None = None
        kind = kind or cell_kind(loaded.cell_config.kind)
        operator: Operator
        if requests is None:
            operator = TerminalOperator(self._emit, interrupted=lambda: self._interrupted)
        else:
            operator = ScriptedOperator(requests, tuple(loaded.routes), self._emit)
        self._workcell = kind(
            loaded.cell_config,
            seed=seed,
            routes=loaded.routes,
            emit=self._emit,
            options=CellOptions(operator, base=loaded.cell_path.parent, gui=gui),
        )
        self.root = build(loaded, skills, self._workcell.cell, Scope(), self._emit)

    def observe(self, observer: Observer) -> None:
        """Tell `observer` of every event from now on."""
        self._observers.append(observer)

    @property
    def workcell(self) -> Workcell:
        """The cell this run drives."""
        assert self._workcell is not None
        return self._workcell

    def execute(self) -> Outcome:
        """Tick the tree to its end and return how it ended; the arm is then at rest.

        Ctrl-C halts the tree and brakes the arm; a second one ends the process at once.
        """
        self._emit("run", mission=self._loaded.mission.name, seed=self._seed, params=self._loaded.params)
        with self._interruptible():
            ending = self._loop()
            problems = [*halt(self.root), *self._brake()]
        if ending.traceback:
            # Only now: a record that cannot be written must not keep the arm from braking.
            self._emit("fault", traceback=ending.traceback)
        if problems and ending.status != "FAULT":
            ending = _Ending("FAULT", "fault", problems[0])
        self.workcell.accounts.close()
        lost = self.workcell.accounts.balance()["lost"]
        if ending.status == "SUCCESS" and lost:
            ending = _Ending("FAILURE", "lost", f"{lost} object(s) were lost and not found again")
        now = round(self.workcell.cell.clock.now, 6)
        outcome = Outcome(
            ending.status, ending.reason, ending.message, ending.node, ticks=self._tick, robot_time=now
        )
        self._emit("end", **asdict(outcome))
        return outcome

    def items(self) -> dict[str, Any]:
        """Return the ledger's balance, and a row per item under `rows`."""
        accounts = self.workcell.accounts
        return {**accounts.balance(), "rows": accounts.rows()}

    def audit(self) -> Mapping[str, int] | None:
        """Return what really became of the objects; call it only after `execute`."""
        return self.workcell.audit()

    def close(self) -> None:
        """Give the cell back."""
        self.workcell.close()

    def _loop(self) -> _Ending:
        began = time.monotonic()
        try:
            while not self._interrupted:
                self.root.tick_once()
                if self._interrupted:
                    # At a question to the operator Ctrl-C looks like their wish to quit: it is none.
                    break
                if self.root.status is not Status.RUNNING:
                    return self._verdict()
                self.workcell.advance()
                self._tick += 1
                if self._realtime:
                    time.sleep(max(0.0, began + self.workcell.cell.clock.now - time.monotonic()))
        except Exception as error:
            named = str(error) if isinstance(error, ExecutiveError) else f"{type(error).__name__}: {error}"
            node = error.node if isinstance(error, Fault) else ""
            return _Ending("FAULT", "fault", named, node, traceback.format_exc())
        return _Ending("HALTED", "halted", "halted by the user")

    def _verdict(self) -> _Ending:
        failure: Failure | None = self.root.failure
        if failure is None:
            return _Ending("SUCCESS")
        return _Ending("FAILURE", str(failure), failure.message, failure.path)

    def _brake(self) -> list[str]:
        """Let the arm come to rest; return what went wrong on the way."""
        arm, clock = self.workcell.cell.arm, self.workcell.cell.clock
        try:
            arm.stop()
            deadline = clock.now + LONGEST_BRAKING
            while not arm.at_rest:
                if clock.now > deadline:
                    return [f"the arm is not at rest {LONGEST_BRAKING:.0f} s after it was told to brake"]
                self.workcell.advance()
                self._tick += 1
        except Exception as error:
            return [f"the arm could not be braked: {error}"]
        return []

    def _emit(self, kind: str, **data: Any) -> None:
        clock = self._workcell.cell.clock.now if self._workcell is not None else 0.0
        event = Event(kind, self._tick, round(clock, 6), data)
        for observer in self._observers:
            observer(event)

    @contextmanager
    def _interruptible(self) -> Iterator[None]:
        """Turn the first Ctrl-C (or SIGTERM) into a wish to halt; the second is Python's own."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def wish(number: int, frame: FrameType | None) -> None:
            del number, frame
            self._interrupted = True
            for name, handler in previous.items():
                signal.signal(name, handler)

        previous = {name: signal.getsignal(name) for name in (signal.SIGINT, signal.SIGTERM)}
        for name in previous:
            signal.signal(name, wish)
        try:
            yield
        finally:
            for name, handler in previous.items():
                signal.signal(name, handler)
