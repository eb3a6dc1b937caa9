"""One run of a skill in a scene: to its end, or to where it is taken away, with everything noted."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from traceback import extract_tb
from typing import Any

from executive.clock import STEP
from executive.messages import Item
from executive.skill import Direction, Skill, SkillFailed
from executive.testing.conformance.adversities import NOTHING, Adversity
from executive.testing.conformance.outside import clocks_watched, open_things
from executive.testing.conformance.patience import Stuck, patience
from executive.testing.conformance.same import same
from executive.testing.conformance.situations import Scene
from executive.testing.conformance.source import place_in
from executive.testing.conformance.watch import Call, Watch

LONGEST = 60.0
"""Time on the run's clock after which a skill must have ended [s]: nothing takes so long on a fake table."""


@dataclass(frozen=True)
class Ending:
    """How a skill ended.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `HALTED`, `RUNNING` if it did not end, `STUCK` if a tick did not, or
            `FAULT`.
        reason: Of a failure, declared or not.
        message: The sentence of a failure, or what a fault was and where, or where a tick got stuck.
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
    """What a run of a skill was like.

    Attributes:
        where: The situation, and what went wrong in it, for a sentence.
        ending: How it ended.
        ticks: Control steps it took, that of its end left out.
        given: Those of its params and inputs that are plain values.
        outputs: Its outputs that were set at the end.
        written: Other public attributes that it set.
        rebound: Params and inputs that it set to something else.
        mutated: Params and inputs that are no longer what they were.
        handed: Type of what `run` returned.
        calls: Every call it made of the cell.
        durations: Computing time of every tick, by the wall clock [s].
        held: The tool held something when it began.
        holds: The tool holds something at the end.
        believed: The item that the ledger then believes in the tool, or None.
        at_rest: The arm has nothing left to do of what the skill told it to.
        names: What the cell has of each sort of name at the end: `item`, `bin`, `class`.
        left: Threads, files and processes left behind.
        clocks: Who asked the wall clock.
    """

    where: str
    ending: Ending
    ticks: int
    given: Mapping[str, Any]
    outputs: Mapping[str, Any]
    written: tuple[str, ...]
    rebound: tuple[str, ...]
    mutated: tuple[str, ...]
    handed: type
    calls: tuple[Call, ...]
    durations: tuple[float, ...]
    held: bool
    holds: bool
    believed: Item | None
    at_rest: bool
    names: Mapping[str, tuple[str, ...]]
    left: tuple[str, ...]
    clocks: tuple[str, ...]

    @property
    def seconds(self) -> float:
        """How long it took on the run's clock [s]."""
        return self.ticks * STEP

    @property
    def moved(self) -> bool:
        """True if it started the arm."""
        return any(call.name == "arm.start" for call in self.calls)

    def lean(self) -> Rehearsal:
        """Return this without the arguments of its calls, which may be large: frames are among them."""
        return replace(self, calls=tuple(replace(call, arguments=()) for call in self.calls))


def rehearse(
    skill: type[Skill], scene: Scene, adversity: Adversity = NOTHING, halt_at: int | None = None
) -> Rehearsal:
    """Return what a run was like; with `halt_at`, one that is taken away after so many control steps."""
    values = scene.begin()
    before, fake = scene.copied(values), scene.cell
    held, opened = fake.tool.holding, open_things()
    actor = _Actor(skill, values, scene)
    clocks: list[str] = []
    with clocks_watched(clocks):
        try:
            with patience(skill, lambda: actor.ticks):
                ending = actor.act(adversity, halt_at)
        except Stuck as stuck:
            ending = Ending("STUCK", message=str(stuck))
    attributes = vars(actor.instance) if actor.instance else {}
    outputs = [name for name, port in skill.ports.items() if port.direction is Direction.OUT]
    known = {*skill.params, *skill.ports}
    return Rehearsal(
        where=" ".join(filter(None, (scene.situation.name, adversity.name))),
        ending=ending,
        ticks=actor.ticks,
        given={name: value for name, value in values.items() if isinstance(value, str | float | None)},
        outputs={name: attributes[name] for name in outputs if name in attributes},
        written=tuple(name for name in attributes if name not in known and not name.startswith("_")),
        rebound=tuple(name for name in values if name in attributes and attributes[name] is not values[name]),
        mutated=tuple(name for name in values if not same(values[name], before[name])),
        handed=actor.handed,
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
        left=tuple(sorted(open_things() - opened)),
        clocks=tuple(dict.fromkeys(clocks)),
    )


class _Actor:
    """Drives one skill as the tree would.

    Attributes:
        watch: Stands between it and its cell.
        instance: The skill, once it was made.
        handed: Type of what its `run` returned.
        ticks: Control steps since it was started.
        durations: Computing time of every tick [s].
    """

    def __init__(self, skill: type[Skill], values: Mapping[str, Any], scene: Scene) -> None:
        self._skill, self._values, self._fake = skill, values, scene.cell
        self.watch = Watch(scene.cell.cell)
        self.instance: Skill | None = None
        self.handed: type = type(None)
        self.ticks = 0
        self.durations: list[float] = []
        self._steps: Iterator[Any] = iter(())

    def act(self, adversity: Adversity, halt_at: int | None) -> Ending:
        """Return how the skill ended; nothing it does is an error here but what ends a program."""
        try:
            while self.ticks < LONGEST / STEP:
                if self.ticks == halt_at:
                    return self._halted()
                if self.ticks == adversity.tick:
                    adversity.strike(self._fake, self.watch)
                self.watch.tick = self.ticks
                if self._is_over():
                    return Ending("SUCCESS")
                self._fake.advance()
                self.ticks += 1
        except SkillFailed as failure:
            return Ending("FAILURE", failure.reason, failure.message)
        except Exception as error:
            return Ending("FAULT", message=self._told(error))
        return Ending("RUNNING")

    def _is_over(self) -> bool:
        """Take one step, the first of which starts it."""
        began = perf_counter()
        try:
            if self.instance is None:
                self.instance = self._skill(**self._values)
                handed = self.instance.run(self.watch.cell)
                self.handed, self._steps = type(handed), iter(handed or ())
            yielded = next(self._steps, self)
        finally:
            self.durations.append(perf_counter() - began)
        if yielded is not None and yielded is not self:
            kind = type(yielded).__name__
            raise TypeError(f'it yielded a {kind}; to run the steps of others write "yield from"')
        return yielded is self

    def _halted(self) -> Ending:
        try:
            if isinstance(self._steps, Generator):
                self._steps.close()
        except RuntimeError as error:
            if "GeneratorExit" not in str(error):
                raise
            return Ending("FAULT", message='it yielded in "finally"')
        except SkillFailed as failure:
            return Ending("FAULT", message=f'it failed with "{failure.reason}"')
        return Ending("HALTED")

    def _told(self, error: Exception) -> str:
        """Return what an error says, and where in the skill's own files it came from."""
        frames = ((frame.filename, frame.lineno or 0) for frame in reversed(extract_tb(error.__traceback__)))
        place = place_in(self._skill, frames)
        return f"{type(error).__name__}{place and f' in {place}'}: {error}"
