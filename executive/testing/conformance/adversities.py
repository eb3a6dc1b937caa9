"""What may go wrong in a cell, one thing at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from executive.arm import Motion
from executive.errors import Blocked, ExecutiveError, NoDepth, Unreachable
from executive.geometry import Array
from executive.messages import Detection
from executive.skill import Skill
from executive.testing.conformance.stage import look
from executive.testing.conformance.watch import Watch
from executive.testing.fake_arm import FakeMotion
from executive.testing.fake_cell import FakeCell

BREAKS = 20
"""Moments, spread over a run, at which a seal breaks."""

LOOKS = 4
"""Looks after which a table on which nothing is found is believed empty."""

Strike = Callable[[FakeCell, Watch], None]


@dataclass(frozen=True)
class Adversity:
    """One thing that goes wrong.

    Attributes:
        name: For a sentence: `while nothing seals`.
        strike: Does it to the cell, or to what a skill is told of it.
        tick: Control step before which it happens.
        uses: What a skill must use, one of these, to have to do with it; empty: any skill may.
    """

    name: str
    strike: Strike
    tick: int = 0
    uses: tuple[str, ...] = ()


def _nothing(fake: FakeCell, watch: Watch) -> None:
    del fake, watch


NOTHING = Adversity("", _nothing)
"""All is well."""


def adversities(skill: type[Skill], ticks: int) -> Iterator[Adversity]:
    """Yield what may go wrong around a skill that otherwise takes so many control steps."""
    for adversity in _ADVERSITIES:
        if not adversity.uses or any(part in skill.uses for part in adversity.uses):
            yield adversity
    if "tool" in skill.uses:
        for tick in sorted({round(ticks * part / BREAKS) for part in range(BREAKS + 1)}):
            yield Adversity(f"while the seal breaks at tick {tick}", _breaks, tick)


def _breaks(fake: FakeCell, watch: Watch) -> None:
    del watch
    fake.tool.open()


def _does_not_seal(fake: FakeCell, watch: Watch) -> None:
    del watch
    fake.tool.seals = lambda: False


def _does_not_come_off(fake: FakeCell, watch: Watch) -> None:
    if fake.tool.holding:
        watch.instead["tool.open"] = lambda: None


def _is_gone(fake: FakeCell, watch: Watch) -> None:
    del watch
    fake.world.objects[:] = [thing for thing in fake.world.objects if thing is fake.world.held]


def _has_changed(fake: FakeCell, watch: Watch) -> None:
    del watch
    fake.ledger.bumped()


def _is_given_up(fake: FakeCell, watch: Watch) -> None:
    del watch
    for record in fake.ledger.records:
        if fake.ledger.is_open(record.item):
            fake.ledger.rejected(record.item, "given up")
    for _ in range(LOOKS):
        look(fake, "full")


def _was_dropped(fake: FakeCell, watch: Watch) -> None:
    del watch
    fake.tool.open()
    if (item := fake.ledger.in_tool()) is not None:
        fake.ledger.dropped(item)


def _runs_into(fake: FakeCell, watch: Watch) -> None:
    del watch
    fake.arm.runs_into = "link 4 ran into a hand"


def _still_moves(fake: FakeCell, watch: Watch) -> None:
    del watch
    fake.arm.start(FakeMotion([fake.arm.tool_pose] * 24))


@dataclass(frozen=True)
class _NoPlan:
    """A plan that there is none; implements `executive.arm.Planning`."""

    error: ExecutiveError
    ready: bool = True

    def result(self) -> Motion:
        """Raise the error."""
        raise self.error


def _no_way(error: ExecutiveError) -> Strike:
    def plan(*_: Any, **__: Any) -> _NoPlan:
        return _NoPlan(error)

    def strike(fake: FakeCell, watch: Watch) -> None:
        del fake
        watch.instead["arm.plan"] = plan

    return strike


def _hides(fake: FakeCell, watch: Watch) -> None:
    del watch
    fake.camera.sees = lambda: False
    fake.camera.hides = [fake.camera.area("full")]


def _no_depth(fake: FakeCell, watch: Watch) -> None:
    del fake

    def locate(*_: Any, **__: Any) -> Array:
        raise NoDepth("no depth in the box")

    watch.instead["localizer.locate"] = locate


def _detectors_say(answer: Callable[[Sequence[Detection]], Sequence[Detection] | str]) -> Strike:
    def strike(fake: FakeCell, watch: Watch) -> None:
        del watch
        for detector in fake.detectors.values():
            detector.answers = lambda _, true: answer(true)

    return strike


def _unsure(true: Sequence[Detection]) -> Sequence[Detection]:
    return [replace(detection, confidence=0.01) for detection in true]


def _nonsense(true: Sequence[Detection]) -> Sequence[Detection]:
    return [replace(detection, box=(math.nan, *detection.box[1:])) for detection in true]


def _operator_says(answer: str | None) -> Strike:
    def strike(fake: FakeCell, watch: Watch) -> None:
        del fake

        def ask(*_: Any, **__: Any) -> str | None:
            return answer

        watch.instead["operator.ask"] = ask

    return strike


_ADVERSITIES = (
    Adversity("while nothing seals", _does_not_seal, uses=("tool",)),
    Adversity("while what the tool holds does not come off", _does_not_come_off, uses=("tool",)),
    Adversity("while everything on the table is gone", _is_gone),
    Adversity("while the table has changed since the look", _has_changed),
    Adversity("while every item is given up", _is_given_up),
    Adversity("while the item was dropped before", _was_dropped, uses=("tool",)),
    Adversity("while the arm runs into something", _runs_into, uses=("arm",)),
    Adversity("while the arm still moves at the start", _still_moves, uses=("arm",)),
    Adversity("while no plan reaches the goal", _no_way(Unreachable("out of reach")), uses=("arm",)),
    Adversity("while every way is blocked", _no_way(Blocked("a wall is in the way")), uses=("arm",)),
    Adversity("while the arm hides the table", _hides),
    Adversity("while no depth is seen", _no_depth),
    Adversity("while no detector answers", _detectors_say(lambda _: "no answer within 5 s")),
    Adversity("while the detectors see nothing", _detectors_say(lambda _: ())),
    Adversity("while the detectors are unsure", _detectors_say(_unsure)),
    Adversity("while the detectors talk nonsense", _detectors_say(_nonsense)),
    Adversity("while the operator quits", _operator_says(None)),
    Adversity("while the operator wants a fresh look", _operator_says("rescan")),
)
