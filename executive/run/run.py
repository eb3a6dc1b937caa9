"""One run of a mission: the tick loop, the only place where intent becomes motion."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from py_trees.common import Status

from executive.cell.protocols import Operator
from executive.cell.workcell import CellOptions, Workcell
from executive.errors import ExecutiveError, Fault, Stopped
from executive.events import Exact, Observer
from executive.mission.build import build
from executive.mission.load import LoadedMission
from executive.plugins import cell_kind
from executive.replay.input_log import Past
from executive.run.operator import ScriptedOperator, TerminalOperator
from executive.run.outcome import (
    HALTED,
    Ending,
    Outcome,
    close_books,
    end_of_tree,
    judge_items,
    problems_of,
)
from executive.run.resume import begin_anew, cell_past, reconcile
from executive.run.run_context import Plant
from executive.run.run_control import RunControl
from executive.run.signals import stopped_by_signals
from executive.run.versions import versions
from executive.skill import Skill
from executive.tree.blackboard import Scope
from executive.tree.halting import halt


class Run:
    """A mission on a cell, ready to be executed once.

    Whatever the cell answers goes through a tape, which tells the observers. A run with a `past` begins by
    playing what an earlier one was told: its tree, its variables and its ledger come to stand as they stood
    then. It ends with the tape, or with `takes_up` goes on from there on the cell itself.

    Args:
        loaded: The mission and its cell, as loaded.
        skills: Installed skills by name.
        seed: Decides everything random.
        observers: Told of every event, in order.
        gui: Show the simulated world in a window.
        realtime: Pace the run by the wall clock.
        requests: What the operator asks for, or None to ask at the terminal and heed what `control` is asked.
        keyboard: Whether somebody can type at the terminal; otherwise only `control` is heeded.
        kind: Makes the work cell; by default the installed kind that the cell file names.
        substitutes: What runs instead of a node's skill, by a pattern of the node's path (`*/Grasp`).
        past: What an earlier run was told; None: there was none.
        takes_up: The log of the world that the earlier run left, to go on where it was cut off; None: only
            its past is played.
        scene: File that changes the world of a simulated cell; the run does not read it.

    Attributes:
        root: The tree.
        control: Through it the run is stopped, paused and stepped, from any thread.
        played: What it plays first, or None.

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
        keyboard: bool = True,
        kind: Callable[..., Workcell] | None = None,
        substitutes: Mapping[str, type[Skill]] | None = None,
        past: Past | None = None,
        takes_up: Path | None = None,
        scene: Path | None = None,
    ) -> None:
        self._loaded = loaded
        self._seed = seed
        self._requests = requests
        self._keyboard = keyboard
        self._realtime = realtime
        self._past = past
        self._holds, self._empty = "", False
        self.control = RunControl()
        self._plant = Plant(observers)
        self._emit = self._plant.emit
        kind = kind or cell_kind(loaded.cell_config.kind)
        left = cell_past(past, takes_up) if past and takes_up else None
        options = CellOptions(self._operator(), loaded.cell_path.parent, gui, past=left, scene=scene)
        workcell = kind(
            loaded.cell_config, seed=seed, routes=loaded.routes, emit=self._plant.emit, options=options
        )
        self._live_from = past.complete(workcell.steps) if past and takes_up else None
        self.played = past.before(self._live_from) if past and self._live_from is not None else past
        self._plant.connect(workcell, self.played)
        self.root = build(loaded, skills, self._plant.cell, Scope(), self._plant.emit, substitutes)

    def observe(self, observer: Observer) -> None:
        """Tell `observer` of every event from now on, those of the past among them."""
        self._plant.observe(observer)

    def record(self, recorder: Observer) -> None:
        """Tell `recorder` of every event that is not of the past."""
        self._plant.record(recorder)

    def log_to(self, path: Path) -> None:
        """Keep in a file what a simulated world can be rebuilt from at any moment; before `execute`."""
        self.workcell.log_to(path)

    @property
    def tick(self) -> int:
        """Control steps taken so far."""
        return self._plant.tick

    @property
    def loaded(self) -> LoadedMission:
        """Its mission and cell, as loaded."""
        return self._loaded

    @property
    def workcell(self) -> Workcell:
        """The cell this run drives."""
        return self._plant.workcell

    def execute(self) -> Outcome:
        """Tick the tree to its end and return how it ended; the arm is then at rest.

        Ctrl-C halts the tree and brakes the arm; a second one ends the process at once.
        """
        with stopped_by_signals(self.control):
            ending = self._loop()
            problems = [*halt(self.root), *filter(None, [self._plant.come_to_rest()])]
        if ending.traceback:
            # Only now: a record that cannot be written must not keep the arm from braking.
            problems += problems_of(lambda: self._emit("fault", traceback=ending.traceback))
        problems += problems_of(self._ask_tool)
        problems += problems_of(self._note_whether_empty)
        succeeded = ending.status == "SUCCESS"
        problems += problems_of(lambda: close_books(self.workcell.accounts, completed=succeeded))
        if problems and ending.status == "FAULT":
            ending = replace(ending, message="; ".join([ending.message, *problems]))
        elif problems:
            ending = Ending("FAULT", "fault", "; ".join(problems))
        outcome = self._outcome(ending)
        if broken := problems_of(lambda: self._emit("end", **asdict(outcome))):
            outcome = replace(outcome, status="FAULT", reason="fault", message=broken[0], node="")
        return outcome

    def items(self) -> dict[str, Any]:
        """Return the ledger's balance, its `unknown` and `doubts`, and a row per item as `rows`."""
        accounts = self.workcell.accounts
        told = {"unknown": accounts.unknown, "doubts": accounts.doubts, "rows": accounts.rows()}
        return {**accounts.balance(), **told}

    def audit(self) -> Mapping[str, int] | None:
        """Return what really became of the objects; call it only after `execute`."""
        return self.workcell.audit()

    def close(self) -> None:
        """Give the cell back."""
        self.workcell.close()

    def _operator(self) -> Operator:
        if self._requests is None:
            return TerminalOperator(
                self._emit, lambda: self.control.stopped, self.control.requested, keyboard=self._keyboard
            )
        served = self._past.number_of("request") if self._past else 0
        return ScriptedOperator(self._requests, tuple(self._loaded.routes), self._emit, served)

    def _begin(self) -> None:
        loaded = self._loaded
        self._emit(
            "run",
            mission=loaded.mission.name,
            file=str(loaded.path),
            seed=self._seed,
            params=loaded.params,
            overrides=loaded.overrides,
            requests=self._requests,
            base=str(loaded.cell_path.parent.resolve()),
            step=Exact(self._plant.tape.step),
            versions=versions(),
        )

    def _loop(self) -> Ending:
        began = time.monotonic() - self._plant.tape.now
        ticked = False
        try:
            if self._past is None:
                self._begin()
            self.control.wait()
            while not self.control.stopped:
                ticked = False
                self._plant.begin_tick()
                self._take_up()
                if self._halted(before=True):
                    break
                ticked = True
                self.root.tick_once()
                if self.control.stopped or self._halted(before=False):
                    break
                if self.root.status is not Status.RUNNING:
                    if self._is_reopened():
                        self._end_part()
                        continue
                    return end_of_tree(self.root.failure)
                self._plant.plan_ahead()
                self._plant.advance()
                if self._realtime:
                    time.sleep(max(0.0, began + self._plant.tape.now - time.monotonic()))
                self.control.wait()
            ending = HALTED
        except Stopped:
            ending = HALTED
        except Exception as error:
            named = str(error) if isinstance(error, ExecutiveError) else f"{type(error).__name__}: {error}"
            node = error.node if isinstance(error, Fault) else ""
            ending = Ending("FAULT", "fault", named, node, traceback.format_exc())
        if (broken := problems_of(lambda: self._emit("halt", ticked=ticked))) and ending.status != "FAULT":
            ending = Ending("FAULT", "fault", broken[0])
        return ending

    def _take_up(self) -> None:
        """Where a run was cut off, begin anew what was under way."""
        plant = self._plant
        if plant.tape.playing and plant.tick == self._live_from:
            assert self._past is not None
            ticked, intent = plant.tick, self._past.last_intent
            while plant.workcell.steps < ticked:
                plant.workcell.advance()
            plant.go_live()
            self._emit("resume", ticked=ticked, intent=intent, versions=versions())
        elif plant.tape.playing and self._past and plant.tick in self._past.resumes:
            entry = self._past.resumes[plant.tick]
            ticked, intent = entry["ticked"], entry["intent"]
            plant.tick = entry["tick"]
            plant.begin_tick()
        else:
            return
        begin_anew(self.root, self._rest)
        if ticked - 1 in self._past.incomplete:
            plant.workcell.accounts.reopen()
        reconcile(plant.cell, intent)

    def _is_reopened(self) -> bool:
        """Tell whether the run that is played, INCOMPLETE after this step, was resumed then, or is now."""
        if self._past is None or not self._plant.tape.playing:
            return False
        return self._past.is_reopened(self.tick, self._live_from)

    def _end_part(self) -> None:
        """Do what was done at the end of the run that is resumed; the tree begins again at the next step."""
        self._rest()
        self._ask_tool()
        self._note_whether_empty()
        close_books(self.workcell.accounts, completed=True)
        self._plant.tick += 1

    def _rest(self) -> None:
        if problem := self._plant.come_to_rest():
            raise Fault(problem)

    def _halted(self, *, before: bool) -> bool:
        """Tell whether the run that is played was halted here, before or after the tree was ticked."""
        if self._past is None or not self._plant.tape.playing or self._live_from is not None:
            return False
        return self._past.is_halted(self.tick, before=before)

    def _note_whether_empty(self) -> None:
        ledger = self._plant.cell.ledger
        self._empty = ledger.believes_empty() and not ledger.unknown

    def _outcome(self, ending: Ending) -> Outcome:
        if ending.status == "SUCCESS":
            ending = judge_items(self.workcell.accounts)
        end = (self._empty, self._holds, self.tick, round(self._plant.tape.now, 6))
        return Outcome(ending.status, ending.reason, ending.message, ending.node, *end)

    def _ask_tool(self) -> None:
        """Note what the tool holds: the item that the ledger believes there, or `something`."""
        cell = self._plant.cell
        if cell.tool.holding:
            self._holds = cell.ledger.in_tool() or "something"
