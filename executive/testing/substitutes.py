"""Substitutes of skills, which fail, succeed, raise an error or never end as a test requires.

Each function returns a subclass of the given skill, with its ports, params and reasons, for
`run_mission(substitutes={"*/Grasp": make_failing(Grasp, "missed", times=2)})`. A substitute counts its starts
over all nodes and runs: make a new one for each run.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Generator, Mapping
from contextlib import closing
from itertools import count, islice
from typing import Any, cast

from executive.cell.protocols import Cell, Steps
from executive.errors import InputError
from executive.skill import Direction, Skill

RunMethod = Callable[[Skill, Cell], Steps | None]
"""The method `run` of a skill."""


def make_failing(
    skill: type[Skill], reason: str, *, times: int | None = None, message: str = "injected failure"
) -> type[Skill]:
    """Return a skill that fails in its first `times` starts, and then does its work.

    With None for `times` the skill always fails.

    Raises:
        InputError: The skill does not declare this reason.
    """
    if reason not in skill.reasons:
        raise InputError(
            f'{skill.__name__} cannot fail with "{reason}"; it declares: {", ".join(skill.reasons) or "none"}'
        )

    def run(self: Skill, cell: Cell) -> Steps:
        del cell
        yield from ()
        raise self.failure(reason, message)

    return make_substitute(skill, "Failing", run, _first_starts(times))


def make_succeeding(
    skill: type[Skill], outputs: Mapping[str, Any] | None = None, *, after: int = 0
) -> type[Skill]:
    """Return a skill that does nothing for `after` control steps, and succeeds with these outputs.

    Raises:
        InputError: The names of the outputs are not those of the skill.
    """
    values = dict(outputs or {})
    declared = [name for name, port in skill.ports.items() if port.direction is Direction.OUT]
    if set(values) != set(declared):
        raise InputError(
            f"{skill.__name__} has the outputs {', '.join(declared) or 'none'}, "
            f"and was given {', '.join(values) or 'none'}"
        )

    def run(self: Skill, cell: Cell) -> Steps:
        del cell
        for _ in range(after):
            yield
        for name, value in values.items():
            setattr(self, name, value)

    return make_substitute(skill, "Succeeding", run)


def make_raising(
    skill: type[Skill], error: Exception, *, after: int = 0, times: int | None = None
) -> type[Skill]:
    """Return a skill that raises `error` after `after` control steps, if it still runs then.

    Before the error the skill does its work, and its `finally` blocks are executed.
    """

    def run(self: Skill, cell: Cell) -> Steps:
        steps_done = 0
        with closing(_run_original(skill, self, cell)) as steps:
            for _ in islice(steps, after):
                yield
                steps_done += 1
            if steps_done == after:
                raise error

    return make_substitute(skill, "Raising", run, _first_starts(times))


def make_raising_when_halted(skill: type[Skill], error: Exception) -> type[Skill]:
    """Return a skill that raises `error` when it is halted, like a bug in its `finally`."""

    def run(self: Skill, cell: Cell) -> Steps:
        try:
            yield from _run_original(skill, self, cell)
        except GeneratorExit:
            raise error from None

    return make_substitute(skill, "RaisingWhenHalted", run)


def make_endless(skill: type[Skill]) -> type[Skill]:
    """Return a skill that does nothing and never ends."""

    def run(self: Skill, cell: Cell) -> Steps:
        del self, cell
        while True:
            yield

    return make_substitute(skill, "Endless", run)


def make_substitute(
    skill: type[Skill], prefix: str, run: RunMethod, starts: Container[int] | None = None
) -> type[Skill]:
    """Return a subclass of a skill with another `run`.

    Args:
        skill: The skill.
        prefix: Prefix of the name of the subclass.
        run: The other `run`.
        starts: Numbers of the starts, from 1, in which the other `run` is used; None: all starts.
    """
    numbers = count(1)

    def choose_run(self: Skill, cell: Cell) -> Steps | None:
        is_replaced = starts is None or next(numbers) in starts
        return run(self, cell) if is_replaced else _run_original(skill, self, cell)

    members = {"run": choose_run, "__doc__": skill.__doc__, "__module__": skill.__module__}
    return cast(type[Skill], type(f"{prefix}{skill.__name__}", (skill,), members))


def _first_starts(times: int | None) -> Container[int] | None:
    return None if times is None else range(1, times + 1)


def _run_original(skill: type[Skill], instance: Skill, cell: Cell) -> Generator[None, None, None]:
    """Run `instance` as `skill` does; also a `run` that is no generator becomes one."""
    yield from skill.run(instance, cell) or ()
