"""Checks of the variables: who writes what, and who reads it."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.case import Case
from executive.mission.findings import Finding, alternatives, error
from executive.mission.model import Node, SkillNode, UseNode
from executive.mission.wiring import wires
from executive.skill import Direction


def shadowed_params(case: Case) -> Iterator[Finding]:
    """Find every output that would write a variable of the same name as a param of the mission."""
    for node, skill in case.known_skills():
        for wire in wires(node, skill, Direction.OUT):
            if wire.variable in case.mission.params:
                message = (
                    f"{node.skill}.{wire.port.name} would write ${wire.variable}, "
                    "but that is a param of the mission"
                )
                hint = f"Rename the param, or write {wire.port.name}: $other."
                yield error(wire.mark, "shadowed-param", message, hint)


def unwritten_inputs(case: Case) -> Iterator[Finding]:
    """Find every input whose variable nothing in the mission ever writes."""
    if case.tree is None:
        return
    written = _written(case, case.tree)
    for node in case.tree.walk():
        if not isinstance(node, SkillNode):
            continue
        for wire in wires(node, case.skills[node.skill], Direction.IN):
            if wire.variable in written or not (wire.port.required or wire.explicit):
                continue
            message = f"{node.skill}.{wire.port.name} reads ${wire.variable}, which nothing writes"
            writers = [
                name
                for name, skill in case.skills.items()
                if wire.variable in skill.ports and skill.ports[wire.variable].direction is Direction.OUT
            ]
            hint = f"It is written by: {', '.join(writers)}." if writers else ""
            names = [f"${name}" for name in sorted(written)]
            listed = alternatives(f"${wire.variable}", names, "Variables that are written")
            yield error(wire.mark, "unwritten", message, hint or listed)


def broken_promises(case: Case) -> Iterator[Finding]:
    """Find every variable that a subtree says it `returns` and that nothing in it writes."""
    if case.tree is None:
        return
    for use in case.tree.walk():
        if isinstance(use, UseNode) and use.body is not None:
            subtree = case.mission.trees[use.name]
            written = _written(case, use.body)
            for name, mark in subtree.returns.items():
                if name not in written:
                    message = f'the subtree "{use.name}" returns ${name}, which nothing in it writes'
                    hint = alternatives(name, sorted(written), "It writes")
                    yield error(mark, "unwritten", message, hint)


def _written(case: Case, root: Node) -> set[str]:
    return {
        wire.variable
        for node in root.walk()
        if isinstance(node, SkillNode)
        for wire in wires(node, case.skills[node.skill], Direction.OUT)
    }
