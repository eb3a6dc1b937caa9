"""One run of a skill in a scene, to its end or until it is halted, with everything noted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from traceback import extract_tb
from typing import Any

from executive.errors import Fault
from executive.events import Event
from executive.messages import Item
from executive.skill import Skill, SkillFailed
from executive.skill_steps import SkillRun
from executive.testing.conformance.adversities import Adversity
from executive.testing.conformance.patience import Stuck, patience
from executive.testing.conformance.same import is_same
from executive.testing.conformance.situations import Scene
from executive.testing.conformance.source import place_in
from executive.testing.conformance.watch import Call, Watch
from executive.testing.disturbances import DisturbedCell, during
from executive.testing.fake_world import STEP

MAX_TIME = 60.0
"""Time on the run's clock after which a skill must have ended [s]: nothing takes so long on a fake table."""


@dataclass(frozen=True)
class Ending:
    """The end of a run.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `HALTED`, `RUNNING` if it did not end, `STUCK` if a tick did not, or
            `FAULT`.
        reason: Reason of a failure.
        message: Sentence of a failure or fault, or where a tick got stuck.
    """

    status: str
    reason: str = ""
    message: str = ""

    def __str__(self) -> str:
        if self.status == "FAILURE":
            return f'it failed with "{self.reason}" ({self.message})'
        words = {"SUCCESS": "it succeeded", "HALTED": "it was halted", "RUNNING": "it was not over"}
        return words.get(self.status) or f"it ended as a fault: {self.message}"


@dataclass(frozen=True)
class Rehearsal:
    """Everything noted of one run.

    Attributes:
        where: The situation, and what went wrong in it, for a sentence.
        ending: Its end.
        ticks: Control steps it took, that of its end left out.
        given: Those of its params and inputs that are plain values.
        outputs: Its outputs that were set at the end.
        mutated: Names of the params and inputs that are no longer what they were.
        calls: Every call it made of the cell.
        durations: Computing time of every tick, by the wall clock [s].
        held: The tool held something when it began.
        holds: The tool holds something at the end.
        believed: Item that the ledger then believes in the tool, or None.
        at_rest: The arm has nothing left to do at the end.
        names: Names of the cell by their kind: `item`, `bin`, `class`.
    """

    where: str
    ending: Ending
    ticks: int
    given: Mapping[str, Any]
    outputs: Mapping[str, Any]
    mutated: tuple[str, ...]
    calls: tuple[Call, ...]
    durations: tuple[float, ...]
    held: bool
    holds: bool
    believed: Item | None
    at_rest: bool
    names: Mapping[str, tuple[str, ...]]

    @property
    def seconds(self) -> float:
        """Time it took on the run's clock [s]."""
        return self.ticks * STEP

    @property
    def when(self) -> str:
        """How and where it ended, for a sentence."""
        halted = f" at tick {self.ticks}" if self.ending.status == "HALTED" else ""
        return f"{self.where} {self.ending}{halted}"

    @property
    def moved(self) -> bool:
        """True if it started the arm."""
        return any(call.name == "arm.start" for call in self.calls)

    def without_arguments(self) -> Rehearsal:
        """Return this without the arguments of its calls, which may be large: frames are among them."""
        return replace(self, calls=tuple(replace(call, arguments=()) for call in self.calls))


def rehearse(
    skill: type[Skill], scene: Scene, adversity: Adversity | None = None, halt_at: int | None = None
) -> Rehearsal:
    """Run a skill; with `halt_at`, halt it after so many control steps."""
    values = scene.begin()
    before, fake = scene.copied(values), scene.cell
    held = fake.tool.holding
    actor = _Actor(skill, values, scene, adversity)
    try:
        with patience(skill, lambda: actor.ticks):
            ending = actor.act(halt_at)
    except Stuck as stuck:
        ending = Ending("STUCK", message=str(stuck))
    return Rehearsal(
        where=" ".join(filter(None, (scene.situation.name, adversity.name if adversity else ""))),
        ending=ending,
        ticks=actor.ticks,
        given={name: value for name, value in values.items() if isinstance(value, str | float | None)},
        outputs=actor.outputs,
        mutated=tuple(name for name in values if not is_same(values[name], before[name])),
        calls=tuple(actor.watch.calls),
        durations=tuple(actor.durations),
        held=held,
        holds=fake.tool.holding,
        believed=fake.ledger.in_tool(),
        at_rest=fake.arm.at_rest,
        names={
            "item": tuple(record.item for record in fake.ledger.records),
            "bin": tuple(fake.cell.bins),
            "class": tuple(fake.cell.classes),
        },
    )


class _Actor:
    """One run, driven as the tree would.

    Attributes:
        watch: Stands between the skill and its cell.
        outputs: Its outputs, once it has succeeded.
        ticks: Control steps since it was started.
        durations: Computing time of every tick [s].
    """

    def __init__(
        self, skill: type[Skill], values: Mapping[str, Any], scene: Scene, adversity: Adversity | None
    ) -> None:
        self._skill, self._values, self._adversity = skill, values, adversity
        script = [during("*", adversity.effect)] * adversity.times if adversity else []
        self._cell = DisturbedCell(scene.cell, script)
        self.watch = Watch(self._cell.cell)
        self.outputs: Mapping[str, Any] = {}
        self.ticks = 0
        self.durations: list[float] = []
        self._run: SkillRun | None = None

    def act(self, halt_at: int | None) -> Ending:
        """Run the skill and return its end."""
        try:
            while self.ticks < MAX_TIME / STEP:
                if self._run is not None and self.ticks == halt_at:
                    self._run.halt()
                    return Ending("HALTED")
                if self._adversity is not None and self.ticks == self._adversity.tick:
                    self._cell.hear(Event("status", 0, 0.0, {"node": "skill", "status": "RUNNING"}))
                self.watch.tick = self.ticks
                if self._step():
                    return Ending("SUCCESS")
                self._cell.advance()
                self.ticks += 1
        except SkillFailed as failure:
            return Ending("FAILURE", failure.reason, failure.message)
        except Exception as error:
            return Ending("FAULT", message=self._described(error))
        return Ending("RUNNING")

    def _step(self) -> bool:
        """Take one step, the first of which starts the skill; return True once it has succeeded."""
        began = perf_counter()
        try:
            if self._run is None:
                self._run = SkillRun(self._skill(**self._values), self.watch.cell)
            has_succeeded = self._run.step()
        finally:
            self.durations.append(perf_counter() - began)
        if has_succeeded:
            self.outputs = self._run.outputs()
        return has_succeeded

    def _described(self, error: Exception) -> str:
        """Return the text of an error, and where in the skill's own files it was raised."""
        frames = ((frame.filename, frame.lineno or 0) for frame in reversed(extract_tb(error.__traceback__)))
        place = place_in(self._skill, frames)
        kind = "" if isinstance(error, Fault) else f"{type(error).__name__}: "
        return f"{kind}{error}" + (f" ({place})" if place else "")
