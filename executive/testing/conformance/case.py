"""A skill on trial: everything its checks look at, each found out once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from executive.skill import Skill
from executive.testing.conformance.adversities import NOTHING, Adversity, adversities
from executive.testing.conformance.rehearsal import Rehearsal, rehearse
from executive.testing.conformance.situations import Arrange, NotArranged, NotTried, Scene, situations

BUDGET = 100_000
"""Control steps that the halts of one scene may take together: up to 440 ticks that is one halt at each."""


class GotStuck(NotTried):
    """A tick of a skill did not come back, so that it was not tried any further; the text says where."""


class Case:
    """What the checks of one skill share.

    Args:
        name: What the skill is called.
        skill: Its class.
        arrange: What its author wants to be otherwise on the stage.

    Attributes:
        tries: Runs that were begun.
    """

    def __init__(self, name: str, skill: type[Skill], arrange: Arrange) -> None:
        self.name, self.skill, self._arrange = name, skill, arrange
        self.tries = 0
        self._stuck = ""

    @cached_property
    def _stages(self) -> list[Scene] | NotArranged:
        try:
            scenes = [Scene(self.skill, situation, self._arrange) for situation in situations(self.skill)]
        except NotArranged as problem:
            return problem
        # Where the author says what a param is, its other values are not wanted.
        return [scene for scene in scenes if not scene.given & set(scene.situation.params)]

    @property
    def scenes(self) -> list[Scene]:
        """Every situation, arranged.

        Raises:
            NotArranged: One cannot be.
        """
        if isinstance(self._stages, NotArranged):
            raise self._stages
        return self._stages

    @cached_property
    def twice(self) -> list[tuple[Rehearsal, Rehearsal]]:
        """Two runs to the end in every scene, nothing going wrong."""
        return [(self._tried(scene), self._tried(scene)) for scene in self.scenes]

    @property
    def plain(self) -> list[Rehearsal]:
        """One run to the end in every scene."""
        return [first for first, _ in self.twice]

    @cached_property
    def hard(self) -> list[Rehearsal]:
        """A run to the end in every scene for everything that may go wrong."""
        return [
            self._tried(scene, adversity).lean()
            for scene, plain in zip(self.scenes, self.plain, strict=True)
            # What never ends where all is well would not end here, either.
            if plain.ending.status != "RUNNING"
            for adversity in adversities(self.skill, plain.ticks)
        ]

    @cached_property
    def halted(self) -> list[Rehearsal]:
        """A run for every moment of every scene at which the skill may be taken away."""
        return [
            self._tried(scene, halt_at=tick).lean()
            for scene, plain in zip(self.scenes, self.plain, strict=True)
            for tick in _moments(plain)
        ]

    @property
    def ended(self) -> list[Rehearsal]:
        """Every run to the end."""
        return [*self.plain, *self.hard]

    @property
    def defaults(self) -> Mapping[str, Any]:
        """The params that a mission need not say."""
        return {name: param.default for name, param in self.skill.params.items() if not param.required}

    def _tried(self, scene: Scene, adversity: Adversity = NOTHING, halt_at: int | None = None) -> Rehearsal:
        """Return what a run was like.

        Raises:
            GotStuck: It did not come back, or one before it: to wait once is enough.
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
        # What the skill leaves comes up again, or with its first run; what another thread of this process
        # happens to open meanwhile does not.
        if rehearsal.left and self.tries > 1 and not rehearse(self.skill, scene, adversity, halt_at).left:
            return replace(rehearsal, left=())
        return rehearsal


def _moments(plain: Rehearsal) -> list[int]:
    """Return every tick at which a run may be halted; of a long one those of its calls and some between."""
    count = min(plain.ticks, 2 * BUDGET // max(1, plain.ticks))
    spread = np.linspace(1, plain.ticks, count, dtype=int).tolist()
    around = {call.tick + step for call in plain.calls for step in (0, 1)} if count < plain.ticks else set()
    return sorted(tick for tick in {*spread, *sorted(around)[:count]} if 1 <= tick <= plain.ticks)
