"""Skills that go wrong by themselves, in the activations that a fault names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import count
from typing import cast

from executive.campaign.faults.fault import Breakage, InjectedError
from executive.cell import Cell, Steps
from executive.skill import EMPTY, Skill
from executive.slip import slipped
from executive.testing.substitutes import raising, raising_when_halted

WANTED = "as the campaign wants it"
"""What a skill says that fails by itself."""


def broken_skills(breakages: Iterable[Breakage], skills: Mapping[str, type[Skill]]) -> dict[str, type[Skill]]:
    """Return what runs instead of each node's skill; `skills` are the nodes' own by path."""
    found: dict[str, type[Skill]] = {}
    for breakage in breakages:
        skill = found.get(breakage.node, skills[breakage.node])
        found[breakage.node] = _in_starts(skill, _broken(skill, breakage), breakage.starts)
    return found


def _broken(skill: type[Skill], breakage: Breakage) -> type[Skill]:
    if breakage.how == "fails":
        return _failing(skill, breakage.reason)
    error = InjectedError("a bug that the campaign put in")
    if breakage.how == "raises":
        return raising(skill, error, after=breakage.after)
    return raising_when_halted(skill, error)


def _failing(skill: type[Skill], reason: str) -> type[Skill]:
    """Return the skill that fails at its start; where that leaves the tool empty, what it held has fallen.

    Where the tool sticks besides, that cannot be: the skill does what it does.
    """
    empties = skill.tool_left.get(reason) is EMPTY

    def run(self: Skill, cell: Cell) -> Steps:
        if empties:
            cell.tool.open()
            if cell.tool.holding:
                yield from skill.run(self, cell) or ()
                return
            if (item := cell.ledger.in_tool()) is not None:
                slipped(cell, item)
        raise self.failed(reason, WANTED)

    return _subclass(skill, run)


def _in_starts(skill: type[Skill], broken: type[Skill], starts: tuple[int, ...]) -> type[Skill]:
    """Return the skill that is the broken one in these of its activations."""
    number = count(1)

    def run(self: Skill, cell: Cell) -> Steps:
        runs = broken if next(number) in starts or not starts else skill
        yield from runs.run(self, cell) or ()

    return _subclass(skill, run)


def _subclass(skill: type[Skill], run: object) -> type[Skill]:
    members = {"run": run, "__doc__": skill.__doc__, "__module__": skill.__module__}
    return cast(type[Skill], type(f"Broken{skill.__name__}", (skill,), members))
