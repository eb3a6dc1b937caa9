"""What a run acts on: its work cell behind a tape, one control step at a time, and whoever is told."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from executive.cell.protocols import Cell
from executive.cell.workcell import Workcell
from executive.events import Event, Observer
from executive.replay.input_log import Past
from executive.replay.input_recorder import Tape
from executive.replay.recorded_cell import cell_on_tape
from executive.run.planning_ahead import PlanningAhead

LONGEST_BRAKING = 2.0
"""Time after which an arm that was told to brake must be at rest [s]."""

ATTEMPTS = 4
"""Times that an arm is told to brake: each part of the record says once that it cannot be written."""


class Plant:
    """A work cell, its tape and the count of control steps.

    Attributes:
        tick: Control steps taken so far.
        workcell: The cell as it is.
        cell: The cell as the tree sees it.
        tape: What stands between the two.
    """

    workcell: Workcell
    cell: Cell
    tape: Tape

    def __init__(self, observers: Sequence[Observer]) -> None:
        self.tick = 0
        self._observers = list(observers)
        self._recorders: list[Observer] = []
        self._connected = False

    def connect(self, workcell: Workcell, past: Past | None = None) -> None:
        """Act on this cell from now on; first its tape plays a past, if there is one."""
        clock = workcell.cell.clock
        self.workcell = workcell
        step = clock.step if past is None else past.step
        self.tape = Tape(self.emit, step, lambda: clock.now, past)
        self.cell = cell_on_tape(workcell.cell, self.tape, self.emit)
        self._planning_ahead = PlanningAhead(workcell.cell)
        self.observe(self._planning_ahead.observe)
        self._connected = True

    def observe(self, observer: Observer) -> None:
        """Tell `observer` of every event from now on, those of the past among them."""
        self._observers.append(observer)

    def record(self, recorder: Observer) -> None:
        """Tell `recorder` of every event that is not of the past."""
        self._recorders.append(recorder)

    def emit(self, kind: str, **data: Any) -> None:
        """Stamp an event and tell everybody."""
        now = self.tape.now if self._connected else 0.0
        event = Event(kind, self.tick, round(now, 6), data)
        if not (self._connected and self.tape.playing):
            for recorder in self._recorders:
                recorder(event)
        for observer in self._observers:
            observer(event)

    def begin_tick(self) -> None:
        """Begin the control step that `tick` counts."""
        self.tape.begin_tick(self.tick)

    def go_live(self) -> None:
        """Leave the past: what is asked and done from now on, the cell itself is asked and does.

        The count of control steps becomes that of the cell's world.
        """
        self.tick = self.workcell.steps
        self.tape.go_live()
        self.begin_tick()

    def advance(self) -> None:
        """Let one control step pass; in the past it has passed already."""
        if not self.tape.playing:
            self.workcell.advance()
        self.tick += 1

    def plan_ahead(self) -> None:
        """Have the arm plan what it will probably be asked next; in the past nobody plans."""
        if not self.tape.playing:
            self._planning_ahead.step()

    def come_to_rest(self) -> str:
        """Let the arm brake until it is at rest; return what went wrong, or ""."""
        arm, deadline = self.cell.arm, self.tape.now + LONGEST_BRAKING
        problems: list[str] = []
        while len(problems) < ATTEMPTS:
            try:
                arm.stop()
                while not arm.at_rest:
                    if self.tape.now > deadline:
                        return f"the arm is not at rest {LONGEST_BRAKING:.0f} s after it was told to brake"
                    self.advance()
                    self.begin_tick()
            except Exception as error:
                problems.append(str(error))
            else:
                return problems[0] if problems else ""
        return f"the arm could not be braked: {problems[-1]}"
