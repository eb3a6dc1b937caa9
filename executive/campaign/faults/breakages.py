"""Skills that go wrong by themselves, in the activations that a fault names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from executive.campaign.faults.fault import Breakage, InjectedError
from executive.cell.protocols import Cell, Steps
from executive.manipulation.drops import slipped
from executive.skill import EMPTY, Skill
from executive.testing.substitutes import in_place_of, raising, raising_when_halted

WANTED = "as the campaign wants it"
"""What a skill says that fails by itself."""


def broken_skills(breakages: Iterable[Breakage], skills: Mapping[str, type[Skill]]) -> dict[str, type[Skill]]:
    """Return what runs instead of each node's skill; `skills` are the nodes' own by path."""
    found: dict[str, type[Skill]] = {}
    for breakage in breakages:
        skill = found.get(breakage.node, skills[breakage.node])
        body = _broken(skill, breakage).run
        found[breakage.node] = in_place_of(skill, "Broken", body, breakage.starts or None)
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

    def body(self: Skill, cell: Cell) -> Steps:
        if empties:
            cell.tool.open()
            if cell.tool.holding:
                yield from skill.run(self, cell) or ()
                return
            if (item := cell.ledger.find_held_item()) is not None:
                slipped(cell, item)
        raise self.failed(reason, WANTED)

    return in_place_of(skill, "Failing", body)
