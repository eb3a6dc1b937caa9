"""All runs of one skill that its checks look at, each made once."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from executive.skill import Skill
from executive.testing.conformance.adversities import Adversity, adversities
from executive.testing.conformance.rehearsal import Rehearsal, rehearse
from executive.testing.conformance.situations import Arrange, NotArranged, NotTried, Scene, scenes

MAX_HALT_STEPS = 100_000
"""Control steps that the halts of one scene may take together: up to 440 ticks that is one halt at each."""


class GotStuck(NotTried):
    """A tick of a skill did not come back, so that it was not tried any further; the text says where."""


class Case:
    """The runs that the checks of one skill share.

    Args:
        name: Name of the skill.
        skill: Its class.
        arrange: What its author wants to be otherwise on the stage.

    Attributes:
        tries: Number of runs that were begun.
    """

    def __init__(self, name: str, skill: type[Skill], arrange: Arrange) -> None:
        self.name, self.skill, self._arrange = name, skill, arrange
        self.tries = 0
        self._stuck = ""

    @property
    def scenes(self) -> list[Scene]:
        """Every situation, arranged.

        Raises:
            NotArranged: One cannot be.
        """
        if isinstance(self._scenes, NotArranged):
            raise self._scenes
        return self._scenes

    @cached_property
    def _scenes(self) -> list[Scene] | NotArranged:
        try:
            return scenes(self.skill, self._arrange)
        except NotArranged as problem:
            return problem

    @cached_property
    def twice(self) -> list[tuple[Rehearsal, Rehearsal]]:
        """Two runs to the end in every scene, nothing going wrong."""
        return [(self._run(scene), self._run(scene)) for scene in self.scenes]

    @property
    def plain(self) -> list[Rehearsal]:
        """One run to the end in every scene."""
        return [first for first, _ in self.twice]

    @cached_property
    def hard(self) -> list[Rehearsal]:
        """A run to the end in every scene under every adversity."""
        return [
            self._run(scene, adversity).without_arguments()
            for scene, plain in zip(self.scenes, self.plain, strict=True)
            # A run that never ends where all is well would not end here, either.
            if plain.ending.status != "RUNNING"
            for adversity in adversities(self.skill, plain.ticks, holding=plain.held)
        ]

    @cached_property
    def halted(self) -> list[Rehearsal]:
        """A run for every moment of every scene at which the skill may be halted."""
        return [
            self._run(scene, halt_at=tick).without_arguments()
            for scene, plain in zip(self.scenes, self.plain, strict=True)
            for tick in _moments(plain)
        ]

    @property
    def ended(self) -> list[Rehearsal]:
        """Every run to the end."""
        return [*self.plain, *self.hard]

    @property
    def defaults(self) -> Mapping[str, Any]:
        """The params that a mission need not give."""
        return {name: param.default for name, param in self.skill.params.items() if not param.required}

    def _run(self, scene: Scene, adversity: Adversity | None = None, halt_at: int | None = None) -> Rehearsal:
        """Run the skill once.

        Raises:
            GotStuck: It did not come back, or a run before it: to wait once is enough.
        """
        if self._stuck:
            raise GotStuck(self._stuck)
        self.tries += 1
        rehearsal = rehearse(self.skill, scene, adversity, halt_at)
        if rehearsal.ending.status == "STUCK":
            halted = ", halted there," if rehearsal.ticks == halt_at else ""
            self._stuck = (
                f"{rehearsal.where} at tick {rehearsal.ticks}{halted} {self.name} "
                f"{rehearsal.ending.message}. The arm waits for every tick: yield in each loop that waits, "
                "and leave long work to a detector."
            )
            raise GotStuck(self._stuck)
        return rehearsal


def _moments(plain: Rehearsal) -> list[int]:
    """Return every tick at which a run may be halted; of a long one those of its calls and some between."""
    count = min(plain.ticks, 2 * MAX_HALT_STEPS // max(1, plain.ticks))
    spread = np.linspace(1, plain.ticks, count, dtype=int).tolist()
    around = {call.tick + step for call in plain.calls for step in (0, 1)} if count < plain.ticks else set()
    return sorted(tick for tick in {*spread, *sorted(around)[:count]} if 1 <= tick <= plain.ticks)
