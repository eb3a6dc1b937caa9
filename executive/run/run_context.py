"""State of one run: work cell, recorder of inputs, number of control steps, and observers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from executive.cell.clock import StepClock
from executive.cell.protocols import Cell
from executive.cell.workcell import Workcell
from executive.events import Event, Observer, TimedEvent
from executive.replay.input_recorder import InputRecorder
from executive.replay.recorded_cell import record_cell
from executive.run.planning_ahead import PlanningAhead

MAX_BRAKING_TIME = 2.0
"""Time after which an arm that was commanded to brake must be at rest [s]."""
MAX_BRAKING_ATTEMPTS = 4
"""Number of commands to brake; each observer may fail once to record such a command."""


class RunContext:
    """The cell of a run as its tree sees it, and the events of the run.

    The context exists before its work cell, because the work cell emits events.

    Attributes:
        tick: Number of control steps so far.
        workcell: The work cell.
        cell: Cell of the skills: all answers are recorded, and the clock shows the start of the control step.
        planner: Plans motions ahead, or None.
    """

    workcell: Workcell
    cell: Cell

    def __init__(self, observers: Sequence[Observer] = ()) -> None:
        self.tick = 0
        self.planner: PlanningAhead | None = None
        self._observers = list(observers)
        self._recorder = InputRecorder(self.emit)
        self._step = 0.0
        self._ahead = 0.0
        """Time of the cell's clock minus the time of all control steps [s]; 0 in simulation."""

    @property
    def now(self) -> float:
        """Time on the run's clock at which this control step began [s]."""
        return self.tick * self._step + self._ahead

    def connect(self, workcell: Workcell, planner: PlanningAhead | None = None) -> None:
        """Set the work cell and the planner of the run."""
        self.workcell, self.planner = workcell, planner
        if planner is not None:
            self.observe(planner.observe)
        self._step = workcell.cell.clock.step
        clock = StepClock(lambda: self.now, self._step)
        self.cell = record_cell(workcell.cell, self._recorder, clock, self.emit)

    def observe(self, observer: Observer, *, first: bool = False) -> None:
        """Call `observer` with every event from now on; with `first`, before all other observers."""
        self._observers.insert(0 if first else len(self._observers), observer)

    def emit(self, event: Event) -> None:
        """Pass an event with its control step and time to all observers."""
        timed = TimedEvent(self.tick, round(self.now, 6), event)
        for observer in self._observers:
            observer(timed)

    def begin_step(self, tick: int) -> None:
        """Begin the control step number `tick`, and read the clock."""
        self.tick = tick
        self._recorder.begin_step()
        clock, step_time = self.workcell.cell.clock, tick * self._step
        self._ahead = self._recorder.read("clock", lambda: clock.now - step_time)

    def advance(self) -> None:
        """Let one control step pass, and begin the next one."""
        self.workcell.advance()
        self.begin_step(self.tick + 1)

    def plan_ahead(self) -> None:
        """Let the arm plan the probable next motion."""
        if self.planner is not None:
            self.planner.step()

    def come_to_rest(self) -> str:
        """Let the arm brake until it is at rest; return a problem, or ""."""
        return come_to_rest(self.cell, self.advance)


def come_to_rest(cell: Cell, advance: Callable[[], None]) -> str:
    """Let the arm of a cell brake until it is at rest; return a problem, or "".

    `advance` lets one control step pass.
    """
    deadline = cell.clock.now + MAX_BRAKING_TIME
    problems: list[str] = []
    while len(problems) < MAX_BRAKING_ATTEMPTS:
        try:
            cell.arm.stop()
            while not cell.arm.at_rest:
                if cell.clock.now > deadline:
                    return f"the arm is not at rest {MAX_BRAKING_TIME:.0f} s after the command to brake"
                advance()
        except Exception as error:
            problems.append(str(error))
        else:
            return problems[0] if problems else ""
    return f"the arm could not be braked: {problems[-1]}"
