"""Substitutes of skills for tests: skills that fail or raise an error.

Each function returns a subclass of a skill, with the same ports, params and reasons, for
`run_mission(substitutes={"*/Grasp": make_failing(Grasp, "missed", start_count=2)})`. A substitute
counts its starts over all nodes and runs, so make a new substitute for each mission run.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Generator
from contextlib import closing
from itertools import count, islice
from typing import cast

from executive.cell.protocols import Cell, Steps
from executive.errors import InputError
from executive.skill import Skill

RunMethod = Callable[[Skill, Cell], Steps | None]
"""Type of the method `run` of a skill."""


def make_failing(
    skill: type[Skill], reason: str, *, start_count: int | None = None, message: str = "injected failure"
) -> type[Skill]:
    """Return a skill whose first `start_count` runs fail (None: all); later runs execute the original skill.

    Raises:
        InputError: The skill does not declare this reason.
    """
    if reason not in skill.reasons:
        declared = ", ".join(skill.reasons) or "none"
        raise InputError(f'{skill.__name__} cannot fail with "{reason}"; it declares: {declared}')

    def run(self: Skill, cell: Cell) -> None:
        del cell
        raise self.failure(reason, message)

    return make_substitute(skill, "Failing", run, _list_first_starts(start_count))


def make_raising(
    skill: type[Skill], error: Exception, *, delay_steps: int = 0, start_count: int | None = None
) -> type[Skill]:
    """Return a skill that raises `error` after `delay_steps` control steps of the original skill.

    The original skill is closed before the error. A run that ends earlier raises no error. The error is
    raised in the first `start_count` runs; in all runs if `start_count` is None.
    """

    def run(self: Skill, cell: Cell) -> Steps:
        steps_done = 0
        with closing(_run_original(skill, self, cell)) as steps:
            for _ in islice(steps, delay_steps):
                yield
                steps_done += 1
            if steps_done == delay_steps:
                raise error

    return make_substitute(skill, "Raising", run, _list_first_starts(start_count))


def make_substitute(
    skill: type[Skill], prefix: str, run: RunMethod, start_numbers: Container[int] | None = None
) -> type[Skill]:
    """Return a subclass of a skill with another method `run`.

    Args:
        skill: Class of the skill.
        prefix: Prefix of the name of the subclass.
        run: Replacement of the method `run`.
        start_numbers: Numbers of the starts, from 1, at which the replacement runs; None: all starts.
    """
    start_counter = count(1)

    def choose_run(self: Skill, cell: Cell) -> Steps | None:
        is_replaced = start_numbers is None or next(start_counter) in start_numbers
        return run(self, cell) if is_replaced else _run_original(skill, self, cell)

    members = {
        "run": choose_run,
        "__doc__": f"Substitute of {skill.__name__}.",
        "__module__": skill.__module__,
    }
    return cast(type[Skill], type(f"{prefix}{skill.__name__}", (skill,), members))


def _list_first_starts(start_count: int | None) -> Container[int] | None:
    """Return the numbers of the first `start_count` starts; None: all starts."""
    return None if start_count is None else range(1, start_count + 1)


def _run_original(skill: type[Skill], instance: Skill, cell: Cell) -> Generator[None, None, None]:
    """Execute the method `run` of `skill` on `instance`; `run` may be a generator or a plain function."""
    yield from skill.run(instance, cell) or ()
