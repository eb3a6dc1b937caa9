"""Schedule of a fault script: the disturbances that are happening in a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from executive.events import NodeEnded, NodeStarted, TimedEvent
from executive.testing.faults.effect import Occasion
from executive.testing.faults.scene import Scene
from executive.testing.faults.script import Disturbance, DuringNode, DuringTime

EARLY = 1e-9
"""Rounding allowed when two times on the clock are compared [s]."""


class Schedule:
    """Lets a script happen in one run.

    Args:
        script: The disturbances.
        scene: Where they happen.
    """

    def __init__(self, script: Sequence[Disturbance], scene: Scene) -> None:
        self._scene = scene
        self._by_node = [(one.what, one.when) for one in script if isinstance(one.when, DuringNode)]
        self._to_come = [(one.what, one.when) for one in script if isinstance(one.when, DuringTime)]
        self._activations: Counter[int] = Counter()
        self._happening: list[Occasion] = []

    def hear(self, timed: TimedEvent) -> None:
        """Begin and end what happens while a node runs."""
        match timed.event:
            case NodeStarted(node, _, item):
                self._node_begins(node, item)
            case NodeEnded(node):
                self._end(lambda occasion: occasion.node == node)

    def step(self) -> None:
        """Begin and end what happens at its time, and do what can be done now."""
        now = self._scene.now + EARLY
        due = [(effect, when) for effect, when in self._to_come if when.start <= now]
        self._to_come = [one for one in self._to_come if one not in due]
        for effect, when in due:
            self._begin(Occasion(effect, self._scene, until=when.end))
        self._end(lambda occasion: occasion.until <= now)
        for occasion in self._happening:
            self._act(occasion)

    def through(self, member: str, proceed: Callable[[], Any]) -> Any:
        """Return the answer of a member of the cell, changed by all effects that last now.

        `proceed` asks the cell.
        """
        self.step()
        for occasion in self._happening:
            if answer := occasion.effect.answers.get(member):
                proceed = partial(answer, proceed, occasion, *occasion.effect.arguments)
        return proceed()

    def _node_begins(self, path: str, item: str) -> None:
        for number, (effect, when) in enumerate(self._by_node):
            if when.fits(path):
                self._activations[number] += 1
                if when.chosen(self._activations[number]):
                    self._begin(Occasion(effect, self._scene, path, item))

    def _begin(self, occasion: Occasion) -> None:
        self._happening.append(occasion)
        self._act(occasion)

    def _end(self, ends: Callable[[Occasion], bool]) -> None:
        ended = [occasion for occasion in self._happening if ends(occasion)]
        for occasion in ended:
            occasion.over = True
            self._happening.remove(occasion)

    def _act(self, occasion: Occasion) -> None:
        effect = occasion.effect
        if effect.act is not None and not occasion.done:
            occasion.done = effect.act(occasion, *effect.arguments)
