"""Context of a run: work cell, control step, recorder of inputs, and observers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from executive.cell.protocols import Cell, StepClock
from executive.cell.workcell import Workcell
from executive.errors import Fault
from executive.events import Event, Observer, TimedEvent
from executive.replay.recording_cell import InputRecorder, make_recording_cell
from executive.run.lookahead_planner import LookaheadPlanner

MAX_BRAKING_TIME = 2.0
"""Maximum time from the command to brake until the arm is at rest [s]."""
MAX_BRAKING_ATTEMPTS = 4
"""Maximum number of commands to brake; a command may fail, because an observer may raise an exception."""


class RunContext:
    """Cell and events of a run.

    The context is created before the work cell, because the work cell emits events during its creation.

    Attributes:
        tick: Number of the current control step.
        workcell: Work cell of the run.
        cell: Cell for the skills, which records each value that a skill reads; its clock shows the start of
            the control step.
        planner: Planner of the probable next motion, or None.
    """

    workcell: Workcell
    cell: Cell

    def __init__(self, observers: Sequence[Observer] = ()) -> None:
        self.tick = 0
        self.planner: LookaheadPlanner | None = None
        self._observers = list(observers)
        self._recorder = InputRecorder(self.emit)
        self._control_period = 0.0
        """Duration of a control step [s]."""
        self._clock_offset = 0.0
        """Time of the cell's clock minus the time of all control steps [s]; 0 in simulation."""

    @property
    def now(self) -> float:
        """Time on the run's clock at the start of the current control step [s]."""
        return self.tick * self._control_period + self._clock_offset

    def connect(self, workcell: Workcell, planner: LookaheadPlanner | None = None) -> None:
        """Set the work cell and the planner of the run."""
        self.workcell, self.planner = workcell, planner
        if planner is not None:
            self.add_observer(planner.on_event)
        self._control_period = workcell.cell.clock.step
        clock = StepClock(lambda: self.now, self._control_period)
        self.cell = make_recording_cell(workcell.cell, self._recorder, clock, self.emit)

    def add_observer(self, observer: Observer, *, is_first: bool = False) -> None:
        """Call `observer` with every later event; if `is_first` is True, before all other observers."""
        self._observers.insert(0 if is_first else len(self._observers), observer)

    def emit(self, event: Event) -> None:
        """Pass an event with its control step and time to all observers."""
        timed = TimedEvent(self.tick, round(self.now, 6), event)
        for observer in self._observers:
            observer(timed)

    def begin_step(self, tick: int) -> None:
        """Begin the control step number `tick`, and record the time of the cell's clock."""
        self.tick = tick
        self._recorder.begin_step()
        clock, step_time = self.workcell.cell.clock, tick * self._control_period
        self._clock_offset = self._recorder.read("clock", lambda: clock.now - step_time)

    def advance(self) -> None:
        """Execute one control step of the work cell, and begin the next control step."""
        self.workcell.advance()
        self.begin_step(self.tick + 1)

    def plan_ahead(self) -> None:
        """Let the planner plan the probable next motion."""
        if self.planner is not None:
            self.planner.plan_next_motion(self.tick)


def brake_arm(cell: Cell, advance: Callable[[], None]) -> None:
    """Brake the arm of a cell until it is at rest; `advance` executes one control step.

    Raises:
        Fault: The arm is not at rest, or a command to brake failed.
    """
    deadline = cell.clock.now + MAX_BRAKING_TIME
    problems: list[str] = []
    for _ in range(MAX_BRAKING_ATTEMPTS):
        try:
            cell.arm.stop()
            while not (is_at_rest := cell.arm.at_rest) and cell.clock.now <= deadline:
                advance()
        except Exception as error:
            problems.append(str(error))
            continue
        if not is_at_rest:
            raise Fault(f"the arm is not at rest {MAX_BRAKING_TIME:.0f} s after the command to brake")
        if problems:
            raise Fault(problems[0])
        return
    raise Fault(f"the arm could not be braked: {problems[-1]}")
