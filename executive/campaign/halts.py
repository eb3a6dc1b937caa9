"""A mission halted at many moments of one run: what Ctrl-C leaves behind, whenever it comes.

The mission is run once. At each of the moments this process forks; the child wishes a stop, halts as any
run does, is looked at, and ends, while its parent goes on to the next moment. A detector that works in a
process of its own serves both, so a cell with one is better tried with detections from the truth.
"""

from __future__ import annotations

import shutil
import tempfile
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from executive.campaign.braking import CommandLog
from executive.campaign.forks import Forks
from executive.campaign.halt_checks import (
    check_books,
    check_braking,
    check_ending,
    check_journal,
    check_rest,
    check_tool,
)
from executive.campaign.subject import Subject
from executive.errors import ExecutiveError
from executive.events import Event, Observer
from executive.motion.limits import JointLimits
from executive.record.journal import Journal, read_journal
from executive.record.result import ledger_agrees
from executive.record.trace import Trace
from executive.runtime.cells import cell_kind
from executive.runtime.outcome import Outcome
from executive.runtime.run import Run
from executive.sim.arm import SimArm
from executive.testing.wrapped_cell import WrappedCell
from executive.view.figures.halt import Halt, HaltFigures
from executive.workcell import Workcell

PATIENCE = 120.0
"""Time that a child may take to halt, be looked at and run the mission again [s]."""


@dataclass(frozen=True)
class Undisturbed:
    """How the mission goes when nobody halts it: its control steps and its trace."""

    ticks: int
    trace: str


def halt_everywhere(
    subject: Subject,
    *,
    every: int,
    points: int | None = None,
    followed: int = 20,
    progress: Callable[[int, int], None] | None = None,
) -> HaltFigures:
    """Halt a mission at moments all over its run.

    Args:
        subject: The mission.
        every: Control steps from one moment to the next.
        points: How many moments instead, evenly spread.
        followed: Halts after which the mission is run once more in the same process, evenly spread.
        progress: Told how many halts of how many are done.

    Raises:
        ExecutiveError: The mission does not succeed when nobody halts it.
        KeyboardInterrupt: The user ended it before its first halt.
    """
    undisturbed = rehearse(subject)
    ticks = spread_ticks(undisturbed.ticks, every, points)
    with tempfile.TemporaryDirectory() as folder:
        halts = _Campaign(subject, undisturbed, ticks, followed, Path(folder), progress).run()
    return HaltFigures(subject.name, subject.cell, subject.seed, undisturbed.ticks, halts, len(ticks))


def rehearse(subject: Subject) -> Undisturbed:
    """Run a mission to its end and return how it goes.

    Raises:
        ExecutiveError: It does not succeed, or its books are wrong.
        KeyboardInterrupt: The user ended it.
    """
    trace = Trace()
    with closing(_run(subject, trace)) as run:
        outcome = run.execute()
        if outcome.status == "HALTED":
            raise KeyboardInterrupt
        if outcome.status != "SUCCESS":
            raise ExecutiveError(
                f"{subject.name} ended as {outcome.status} {outcome.reason} ({outcome.message}) "
                f"with seed {subject.seed}; halts are tried on a mission that succeeds: choose another seed"
            )
        if not ledger_agrees({"items": run.items(), "audit": run.audit()}):
            raise ExecutiveError(
                f"ledger and audit of {subject.name} disagree with seed {subject.seed} although "
                "nobody halted it; choose another seed"
            )
    return Undisturbed(outcome.ticks, trace.hexdigest())


def spread_ticks(ticks: int, every: int, points: int | None = None) -> Sequence[int]:
    """Return the control steps of a run of `ticks` to halt at."""
    if points is None:
        return range(0, ticks, every)
    return sorted({int(tick) for tick in np.linspace(0, ticks - 1, min(points, ticks))})


class _WatchedCell(WrappedCell):
    """A work cell with something to do before and after every control step."""

    def __init__(self, inner: Workcell, before: Callable[[], None], after: Callable[[], None]) -> None:
        super().__init__(inner)
        self._before, self._after = before, after

    def advance(self) -> None:
        """Let one control step pass, with what is to be done around it."""
        self._before()
        super().advance()
        self._after()


class _CopiedJournal:
    """A journal that a child goes on with in a file of its own."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._journal = Journal(path)

    def __call__(self, event: Event) -> None:
        self._journal(event)

    def part(self) -> None:
        """Go on in a copy of the file."""
        self._path = Path(shutil.copyfile(self._path, self._path.with_name("child.jsonl")))
        self._journal = Journal(self._path, again=True)

    def close(self) -> None:
        """Close the journal."""
        self._journal.close()

    def entries(self) -> list[dict[str, object]]:
        """Close the journal and return what it says; the file is gone then."""
        self.close()
        entries = read_journal(self._path)
        self._path.unlink()
        return entries


class _Campaign:
    """The run, and what its children found so far."""

    def __init__(
        self,
        subject: Subject,
        undisturbed: Undisturbed,
        ticks: Sequence[int],
        followed: int,
        folder: Path,
        progress: Callable[[int, int], None] | None,
    ) -> None:
        self._subject = subject
        self._undisturbed = undisturbed
        self._ticks = frozenset(ticks)
        self._followed = frozenset(ticks[index] for index in spread_ticks(len(ticks), 1, followed))
        self._progress = progress
        self._limits = JointLimits.of(subject.loaded.cell_config.arm.limits)
        self._forks = Forks(PATIENCE)
        self._journal = _CopiedJournal(folder / "journal.jsonl")
        self._trace = Trace()
        self._run = _run(subject, self._journal, self._trace, kind=self._watched)
        arm = self._run.workcell.cell.arm
        self._commands = CommandLog(arm) if isinstance(arm, SimArm) else None
        self._halts: list[Halt] = []
        self._begun = Halt(0, 0.0)

    def run(self) -> tuple[Halt, ...]:
        """Run the mission and return what its children found.

        Raises:
            ExecutiveError: It did not go as it goes when nobody halts it.
        """
        found: Halt | None = None
        with closing(self._run), closing(self._journal):
            try:
                outcome = self._run.execute()
                if self._forks.in_child:
                    found = self._looked_at(outcome)
            except BaseException:
                if not self._forks.in_child:
                    raise
                found = self._with(traceback.format_exc())
            finally:
                # Whatever happened: a child has no business beyond this line.
                if self._forks.in_child:
                    self._forks.tell(found)
        if outcome.status != "HALTED" and self._trace.hexdigest() != self._undisturbed.trace:
            raise ExecutiveError(
                f"the run that was to be halted went otherwise than the one before it: it ended as "
                f"{outcome.status} after {outcome.ticks} ticks, not after {self._undisturbed.ticks}"
            )
        return tuple(self._halts)

    def _watched(self, *args: Any, **options: Any) -> Workcell:
        kind = self._subject.kind or cell_kind(self._subject.loaded.cell_config.kind)
        return _WatchedCell(kind(*args, **options), self._before, self._after)

    def _before(self) -> None:
        """Before a control step, let a child halt here and hear what it found."""
        tick = self._run.tick
        if self._forks.in_child or tick not in self._ticks:
            return
        self._begun = Halt(tick, round(self._run.workcell.cell.clock.now, 6))
        answer = self._forks.fork()
        if answer is None:
            self._begin()
            return
        found, problem = answer
        self._halts.append(found or self._with(problem or "it was ended before it was looked at"))
        if self._progress is not None:
            self._progress(len(self._halts), len(self._ticks))

    def _begin(self) -> None:
        """Wish a stop; this is a child."""
        self._begun = replace(self._begun, moving=not self._run.workcell.cell.arm.at_rest)
        self._journal.part()
        if self._commands is not None:
            self._commands.begin()
        self._run.control.stop()

    def _after(self) -> None:
        if self._commands is not None:
            self._commands.keep()

    def _looked_at(self, outcome: Outcome) -> Halt:
        """Return what is to be said of the halt that this child has made."""
        run, workcell = self._run, self._run.workcell
        halt = replace(
            self._begun,
            rest=(outcome.ticks - self._begun.tick) * workcell.cell.clock.step,
            holds=outcome.holds,
        )
        problems = [
            *check_ending(outcome, run.root),
            *check_journal(self._journal.entries(), outcome),
            *check_books(run.items(), run.audit()),
            *check_tool(outcome, workcell),
            *check_rest(workcell),
        ]
        if self._commands is not None:
            braking = self._commands.braking(self._limits)
            halt = replace(
                halt, deviation=braking.deviation, acceleration=braking.acceleration, jerk=braking.jerk
            )
        problems += check_braking(halt)
        if halt.tick in self._followed:
            run.close()
            problems += self._follow()
            halt = replace(halt, followed=True)
        return replace(halt, problems=tuple(problems))

    def _follow(self) -> Iterator[str]:
        """Run the mission once more in this process; yield a sentence if it does not go as it always does."""
        try:
            again = rehearse(self._subject)
        except ExecutiveError as error:
            yield f"the next run in the same process: {error}"
            return
        if again != self._undisturbed:
            yield (
                f"the next run in the same process took {again.ticks} ticks with the trace {again.trace}; "
                f"the first took {self._undisturbed.ticks} with {self._undisturbed.trace}"
            )

    def _with(self, problem: str) -> Halt:
        return replace(self._begun, problems=(problem,))


def _run(subject: Subject, *observers: Observer, kind: Callable[..., Workcell] | None = None) -> Run:
    """Return a run of a mission, ready to be executed."""
    return Run(
        subject.loaded,
        subject.skills,
        seed=subject.seed,
        observers=observers,
        kind=kind or subject.kind,
        requests=subject.requests,
    )
