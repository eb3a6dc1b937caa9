"""Skills that run instead of a node's own and go wrong on purpose.

Each function returns a subclass of the skill it is given, with its ports, params and reasons, for
`run_mission(substitutes={"*/Grasp": failing(Grasp, "missed", times=2)})`. What it counts it counts over
all nodes and runs that it stands in for: make a new one for every run.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Generator, Mapping
from contextlib import closing
from itertools import count, islice
from typing import Any, cast

from executive.cell.protocols import Cell, Steps
from executive.errors import InputError
from executive.skill import Direction, Skill

Body = Callable[[Skill, Cell], Steps | None]
"""The `run` of a skill."""


def failing(
    skill: type[Skill], reason: str, *, times: int | None = None, message: str = "as the test wants it"
) -> type[Skill]:
    """Return the skill that fails the first so many `times` it is started, and then does its work.

    With None for `times` it always fails.

    Raises:
        InputError: The skill does not declare this reason.
    """
    if reason not in skill.reasons:
        raise InputError(
            f'{skill.__name__} cannot fail with "{reason}"; it declares: {", ".join(skill.reasons) or "none"}'
        )

    def body(self: Skill, cell: Cell) -> Steps:
        del cell
        yield from ()
        raise self.failed(reason, message)

    return in_place_of(skill, "Failing", body, _first(times))


def succeeding(
    skill: type[Skill], outputs: Mapping[str, Any] | None = None, *, after: int = 0
) -> type[Skill]:
    """Return the skill that does nothing, and succeeds with these outputs `after` so many control steps.

    Raises:
        InputError: The skill lacks one of these outputs, or has one more.
    """
    given = dict(outputs or {})
    declared = [name for name, port in skill.ports.items() if port.direction is Direction.OUT]
    if set(given) != set(declared):
        raise InputError(
            f"{skill.__name__} has the outputs {', '.join(declared) or 'none'}, "
            f"and was given {', '.join(given) or 'none'}"
        )

    def body(self: Skill, cell: Cell) -> Steps:
        del cell
        for _ in range(after):
            yield
        for name, value in given.items():
            setattr(self, name, value)

    return in_place_of(skill, "Succeeding", body)


def raising(skill: type[Skill], error: Exception, *, after: int = 0, times: int | None = None) -> type[Skill]:
    """Return the skill with a bug: `error` comes up in it `after` so many control steps, if it runs so long.

    What the skill does before that, and in its `finally`, it does.
    """

    def body(self: Skill, cell: Cell) -> Steps:
        ran = 0
        with closing(_steps(skill, self, cell)) as steps:
            for _ in islice(steps, after):
                yield
                ran += 1
            if ran == after:
                raise error

    return in_place_of(skill, "Raising", body, _first(times))


def raising_when_halted(skill: type[Skill], error: Exception) -> type[Skill]:
    """Return the skill with a bug in its `finally`: `error` comes up when it is taken away."""

    def body(self: Skill, cell: Cell) -> Steps:
        try:
            yield from _steps(skill, self, cell)
        except GeneratorExit:
            raise error from None

    return in_place_of(skill, "RaisingWhenHalted", body)


def endless(skill: type[Skill]) -> type[Skill]:
    """Return the skill that does nothing and never ends."""

    def body(self: Skill, cell: Cell) -> Steps:
        del self, cell
        while True:
            yield

    return in_place_of(skill, "Endless", body)


def in_place_of(
    skill: type[Skill], what: str, body: Body, starts: Container[int] | None = None
) -> type[Skill]:
    """Return a subclass that runs `body` in these of its starts, counted from 1, else what `skill` runs.

    With None for `starts` it always runs `body`.
    """
    number = count(1)

    def run(self: Skill, cell: Cell) -> Steps | None:
        goes_wrong = starts is None or next(number) in starts
        return body(self, cell) if goes_wrong else _steps(skill, self, cell)

    members = {"run": run, "__doc__": skill.__doc__, "__module__": skill.__module__}
    return cast(type[Skill], type(f"{what}{skill.__name__}", (skill,), members))


def _first(times: int | None) -> Container[int] | None:
    return None if times is None else range(1, times + 1)


def _steps(skill: type[Skill], instance: Skill, cell: Cell) -> Generator[None, None, None]:
    """Yield at every step of what `skill` runs."""
    yield from skill.run(instance, cell) or ()
