"""Checks that each variable is written before it is read, and read after it is written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from executive.mission.check.case import Case
from executive.mission.findings import Finding, alternatives, error, suggest, warning
from executive.mission.model.nodes import Node, UseNode
from executive.mission.model.paths import word_of
from executive.mission.model.values import Named, Reference
from executive.mission.model.wiring import (
    find_all_written_variables,
    find_read_variables,
    find_wires,
    find_written_variables,
)
from executive.mission.source import Mark
from executive.skill import Direction, Skill

Read = tuple[Node, str, str, Mark]
"""Node that reads, its input (`Approach.target`), the variable, and the position in the mission file."""


def find_unwritten_inputs(case: Case) -> Iterator[Finding]:
    """Find the inputs in the mission's own file whose variable is not written on every path to them."""
    for _, what, variable, mark in _unwritten(case, libraries=False):
        # In the file, a variable of a subtree has no prefix.
        bare = variable.rpartition(".")[2]
        if variable in case.written:
            message = f"{what} reads ${bare}, which is not written on every path to this node"
            yield error(mark, "unwritten", message, f"It is written by {_writers(case, variable, mark)}.")
        else:
            message = f"{what} reads ${bare}, which nothing writes"
            yield error(mark, "unwritten", message, _who_could(case, variable))


def find_unwritten_library_inputs(case: Case) -> Iterator[Finding]:
    """Find each use of a library's subtree that reads unwritten variables: one finding for all of them."""
    lacking: dict[str, dict[str, str]] = {}
    for node, what, variable, _ in _unwritten(case, libraries=True):
        lacking.setdefault(case.library_uses[node.path].path, {}).setdefault(variable, what)
    uses = {use.path: use for use in case.library_uses.values()}
    for path, missing in lacking.items():
        use = uses[path]
        names = " and ".join(f"${name} (for {what})" for name, what in sorted(missing.items()))
        are = "is" if len(missing) == 1 else "are"
        message = f'the subtree "{use.name}" needs {names}, which {are} not written on every way to here'
        hints = [f"${name} is written by {_who(case, name, use.mark)}." for name in sorted(missing)]
        yield error(use.mark, "unwritten", message, " ".join(hints))


def _unwritten(case: Case, libraries: bool) -> Iterator[Read]:
    """Yield what reads an unwritten variable: where a library says so, or where the mission does."""
    for node, what, variable, mark in _reads(case, case.tree):
        entry = case.flow.entry.get(node.path)
        if entry is None or entry.written is None or variable in entry.written:
            continue
        in_library = node.path in case.library_uses and mark.source is not case.tree.mark.source
        if in_library is libraries:
            yield node, what, variable, mark


def find_unread_variables(case: Case) -> Iterator[Finding]:
    """Find every variable that the mission names for an output and that nothing reads."""
    read = {variable for _, _, variable, _ in _reads(case, case.tree, all_inputs=True)}
    for node in case.tree.walk():
        for _, variable in find_written_variables(node):
            if variable.name not in read | set(case.mission.params):
                message = f"nothing in this {word_of(node)} reads ${variable.name}"
                yield warning(variable.mark, "unread", message, f"Write ${variable.name} where it is meant.")
        for wire in case.find_wires(node, Direction.OUT):
            if wire.explicit and wire.variable not in read:
                message = f"{wire} writes ${wire.variable}, which nothing reads"
                yield warning(wire.mark, "unread", message)
        if not isinstance(node, UseNode):
            continue
        for setting in node.returns.values():
            name = setting.value.name if isinstance(setting.value, Reference) else ""
            if name in node.returned and name not in read:
                message = f"nothing reads ${name}, which the subtree returns here"
                yield warning(setting.value.mark, "unread", message)


def find_overwritten_loop_variables(case: Case) -> Iterator[Finding]:
    """Find every loop whose variable something else writes too: it is gone when the loop ends."""
    writers = {
        wire.variable: wire for node in case.tree.walk() for wire in case.find_wires(node, Direction.OUT)
    }

    def walk(node: Node, around: Mapping[str, Named]) -> Iterator[Finding]:
        for _, each in find_written_variables(node):
            other = writers.get(each.name)
            place = other.mark if other else around[each.name].mark if each.name in around else None
            if place is not None:
                word = word_of(node)
                who = other or f"another {word}"
                message = f"{word} writes ${each.name}, and so does {who} in {place.place(each.mark.source)}"
                yield error(each.mark, "shadowed-variable", message, "Call the loop's variable otherwise.")
            around = {**around, each.name: each}
        for child in node.children:
            yield from walk(child, around)

    yield from walk(case.tree, {})


def find_unwritten_returns(case: Case) -> Iterator[Finding]:
    """Find every variable that a subtree says it `returns` and that it does not write before it succeeds."""
    for use in case.tree.walk():
        if not isinstance(use, UseNode) or use.body is None:
            continue
        subtree = case.mission.trees[use.name]
        after = case.flow.bodies.get(use.path)
        if after is None or after.written is None:
            continue
        written = find_all_written_variables(use.body, case.skills)
        for (name, mark), variable in zip((subtree.returns or {}).items(), use.returned, strict=True):
            if variable not in written:
                message = f'the subtree "{use.name}" returns ${name}, which nothing in it writes'
                shown = sorted(word.rpartition(".")[2] for word in written)
                yield error(mark, "unwritten", message, alternatives(name, shown, "It writes"))
            elif variable not in after.written:
                message = f'the subtree "{use.name}" returns ${name}, which it does not write on every way'
                hint = f"It is written by {_writers(case, variable, mark)}."
                yield error(mark, "unwritten", message, hint)


def _reads(case: Case, tree: Node, all_inputs: bool = False) -> Iterator[Read]:
    """Yield everything that needs a variable; with `all_inputs` also what can do without it."""
    for node in tree.walk():
        for reference in find_read_variables(node):
            yield node, word_of(node), reference.name, reference.mark
        for wire in case.find_wires(node, Direction.IN):
            if all_inputs or wire.port.is_required or wire.explicit:
                yield node, str(wire), wire.variable, wire.mark


def _writers(case: Case, variable: str, mark: Mark) -> str:
    """Return who writes a variable and where, the first in the file first, or ""."""
    found: dict[str, None] = {}
    for node, skill in sorted(case.known_skills(), key=lambda pair: pair[0].mark.line):
        if any(wire.variable == variable for wire in find_wires(node, skill, Direction.OUT)):
            found[f"{node.skill} in {node.mark.place(mark.source)}"] = None
    return " and ".join(found) or "the loop around its body alone"


def _who(case: Case, variable: str, mark: Mark) -> str:
    """Return who writes a variable: in this file, or which skills could."""
    own = [part for part in _writers(case, variable, mark).split(" and ") if " in line " in part]
    could = [name for name, skill in case.skills.items() if _writes(skill, variable)]
    return " and ".join(own) or ", ".join(could) or "nothing"


def _who_could(case: Case, variable: str) -> str:
    keepers = sorted({name.rpartition(".")[0] for name in case.written if name.endswith(f".{variable}")})
    if keepers:
        return f'The subtree "{keepers[0]}" writes one of its own: add {variable} to what it returns.'
    writers = [name for name, skill in case.skills.items() if _writes(skill, variable)]
    if writers:
        return f"It is written by: {', '.join(writers)}."
    # What a subtree keeps to itself has a dot in its name.
    known = sorted(name for name in case.written if "." not in name)
    meant = suggest(variable, known)
    listed = ", ".join(f"${name}" for name in known) or "none"
    return (f'Did you mean "${meant}"? ' if meant else "") + f"Variables that are written: {listed}."


def _writes(skill: type[Skill], name: str) -> bool:
    return name in skill.ports and skill.ports[name].direction is Direction.OUT
