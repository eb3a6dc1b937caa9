"""Checks of what happens at the same time: no two may use one thing or write one variable."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, permutations

from executive.mission.check.case import Case
from executive.mission.findings import Finding, error
from executive.mission.model.instance import inspection_instance, node_of
from executive.mission.model.nodes import InnerNode, Node, SkillNode, UseNode
from executive.mission.model.paths import word_of
from executive.mission.model.wiring import find_read_variables, find_written_variables
from executive.mission.source import Mark
from executive.skill import Direction


def find_shared_resources(case: Case) -> Iterator[Finding]:
    """Find every two branches that run at the same time and use the same part of the cell."""
    for branches in _concurrent(case):
        for first, second in combinations([_uses(case, branch) for branch in branches], 2):
            # Two skills that share arm and tool clash once.
            clashes = {(first[part].mark, second[part].mark): part for part in second if part in first}
            for part in clashes.values():
                one, other = first[part], second[part]
                use = case.library_uses.get(other.path)
                mark = use.mark if use else other.mark
                who = f'{other.skill} in the subtree "{use.name}"' if use else other.skill
                message = (
                    f"{who} uses the {part} while {one.skill} in {one.mark.place(mark.source)} may use it, "
                    "in another branch of the same parallel"
                )
                hint = "Write a sequence, or put both into one branch."
                yield error(mark, "shared-resource", message, hint)


def find_shared_variables(case: Case) -> Iterator[Finding]:
    """Find every two branches that run at the same time and write the same variable."""
    for branches in _concurrent(case):
        for first, second in combinations([_writes(case, branch) for branch in branches], 2):
            for variable, (other, mark, hint) in second.items():
                if variable in first:
                    one, place, _ = first[variable]
                    message = (
                        f"{other} writes ${variable}, and so does {one} in {place.place(mark.source)}, "
                        "in another branch of the same parallel"
                    )
                    yield error(mark, "shared-variable", message, hint)


def find_racing_reads(case: Case) -> Iterator[Finding]:
    """Find every variable that one branch reads while another may write it."""
    for branches in _concurrent(case):
        known = [
            (index, _first(branch), list(_reads(case, branch)), _writes(case, branch))
            for index, branch in enumerate(branches)
        ]
        for (index, first, reads, own), (other_index, _, _, written) in permutations(known, 2):
            # A skill with which an earlier branch begins has read before anything else can write.
            begins = first if index < other_index else None
            for reader, what, variable, mark in reads:
                # What both write is told as such.
                if reader is not begins and variable in written and variable not in own:
                    other, place, hint = written[variable]
                    message = (
                        f"{what} reads ${variable}, while {other} in {place.place(mark.source)} "
                        "may write it, in another branch of the same parallel"
                    )
                    yield error(mark, "shared-variable", message, hint)


def _concurrent(case: Case) -> Iterator[list[Node]]:
    """Yield the children of each node that run at the same time."""
    for node in case.inner_nodes():
        if branches := inspection_instance(node).concurrent_children:
            yield [node_of(branch) for branch in branches]


def _first(node: Node) -> Node:
    """Return the node with which another begins in its first tick."""
    if isinstance(node, UseNode):
        return _first(node.body) if node.body else node
    first = inspection_instance(node).first_child if isinstance(node, InnerNode) else None
    return _first(node_of(first)) if first else node


def _reads(case: Case, branch: Node) -> Iterator[tuple[Node, str, str, Mark]]:
    """Yield everything below `branch` that reads a variable which is or may be written before it."""
    for node in branch.walk():
        entry = case.flow.entry.get(node.path)
        if entry is None:
            continue
        for reference in find_read_variables(node):
            yield node, word_of(node), reference.name, reference.mark
        for wire in case.find_wires(node, Direction.IN):
            # What is surely not written yet is told as unwritten.
            if entry.written is None or wire.variable in entry.written or not wire.port.is_required:
                yield node, str(wire), wire.variable, wire.mark


def _uses(case: Case, branch: Node) -> dict[str, SkillNode]:
    """Return the first user of every part of the cell below `branch`."""
    users: dict[str, SkillNode] = {}
    on_wrist = case.cell is not None and any(c.mount == "wrist" for c in case.cell.cameras.values())
    for node in branch.walk():
        if not isinstance(node, SkillNode) or node.skill not in case.skills:
            continue
        for resource in case.skills[node.skill].uses:
            # A camera on the wrist sees from where the arm is: to look is to use the arm.
            for used in ("arm", resource) if resource == "camera" and on_wrist else (resource,):
                users.setdefault(used, node)
    return users


def _writes(case: Case, branch: Node) -> dict[str, tuple[str, Mark, str]]:
    """Return the first writer of every variable below `branch`, its place, and how to call it otherwise."""
    writers: dict[str, tuple[str, Mark, str]] = {}
    for node in branch.walk():
        for key, variable in find_written_variables(node):
            hint = f"Write to another variable there, as {key.name}: other."
            writers.setdefault(variable.name, (word_of(node), variable.mark, hint))
        for wire in case.find_wires(node, Direction.OUT):
            hint = f"Write to another variable there, as {wire.port.name}: $other."
            writers.setdefault(wire.variable, (wire.skill, wire.mark, hint))
    return writers
