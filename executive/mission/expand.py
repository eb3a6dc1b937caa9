"""Putting subtrees in the place of every `use`, and params and arguments in the place of every `$name`.

What is left of the references afterwards are variables. Checks and the built tree see only the
expanded tree, so an argument is checked with the value it has at each place of use.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from executive.mission.findings import Finding, alternatives, error, warning
from executive.mission.model import Catch, Literal, Mission, Node, Reference, Setting, Subtree, UseNode, Value

_DEEPEST = 40
_MOST_NODES = 5000

Names = Mapping[str, Value]
"""What `$name` stands for where it is not a variable."""


@dataclass(frozen=True)
class Expanded:
    """A mission without subtrees.

    Attributes:
        tree: The tree that runs, or None where it could not be expanded.
        unused: Subtrees that nothing uses, with their default arguments.
    """

    tree: Node | None
    unused: tuple[Node, ...]
    findings: tuple[Finding, ...]


def expand(mission: Mission) -> Expanded:
    """Return the mission's tree with nothing left to look up but variables."""
    expander = _Expander(mission)
    tree = None if mission.tree is None else expander.whole(mission.tree, mission.params)
    unused = []
    for subtree in mission.trees.values():
        if subtree.name in expander.used:
            continue
        expander.findings.append(
            warning(subtree.mark, "unused-tree", f'nothing uses the subtree "{subtree.name}"')
        )
        defaults = {name: argument.default for name, argument in subtree.args.items()}
        given = {name: default for name, default in defaults.items() if default is not None}
        if len(given) == len(defaults):
            body = expander.whole(subtree.do, {**mission.params, **given})
            unused += [body] if body else []
    return Expanded(tree, tuple(unused), tuple(expander.findings))


class _TooLargeError(Exception):
    """The expansion was given up; the findings say why."""


class _Expander:
    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.findings: list[Finding] = []
        self.used: set[str] = set()
        self._count = 0

    def whole(self, tree: Node, names: Names) -> Node | None:
        try:
            return self._node(tree, names, (), 0)
        except _TooLargeError:
            return None

    def _node(self, node: Node, names: Names, inside: tuple[str, ...], depth: int) -> Node:
        self._count += 1
        if depth > _DEEPEST or self._count > _MOST_NODES:
            limit = f"{_DEEPEST} levels deep" if depth > _DEEPEST else f"to {_MOST_NODES} nodes"
            message = f"with its subtrees put in, the tree grows more than {limit}"
            self.findings.append(error(node.mark, "too-large", message))
            raise _TooLargeError

        def filled(part: Any) -> Any:
            """Return a part of the node with everything looked up; what it is made of does not matter."""
            if isinstance(part, Node):
                return self._node(part, names, inside, depth + 1)
            if isinstance(part, Reference):
                return _resolved(part, names)
            if isinstance(part, Setting | Catch):
                return _rebuilt(part)
            if isinstance(part, tuple):
                return tuple([filled(item) for item in part])
            if isinstance(part, dict):
                return {key: filled(item) for key, item in part.items()}
            return part

        def _rebuilt(part: Any) -> Any:
            return replace(part, **{field.name: filled(getattr(part, field.name)) for field in fields(part)})

        rebuilt: Node = _rebuilt(node)
        return self._use(rebuilt, inside, depth) if isinstance(rebuilt, UseNode) else rebuilt

    def _use(self, use: UseNode, inside: tuple[str, ...], depth: int) -> Node:
        self.used.add(use.name)
        subtree = self.mission.trees.get(use.name)
        if subtree is None:
            hint = alternatives(use.name, self.mission.trees, "The mission's subtrees")
            self.findings.append(error(use.mark, "unknown-tree", f'there is no subtree "{use.name}"', hint))
            return use
        if use.name in inside:
            ring = " -> ".join((*inside[inside.index(use.name) :], use.name))
            message = f"a subtree cannot use itself: {ring}"
            self.findings.append(error(use.mark, "recursive-use", message))
            return use
        arguments = self._arguments(use, subtree)
        if arguments is None:
            return use
        names = {**self.mission.params, **arguments}
        body = self._node(subtree.do, names, (*inside, use.name), depth + 1)
        return replace(use, body=body)

    def _arguments(self, use: UseNode, subtree: Subtree) -> dict[str, Value] | None:
        """Return the value of every argument of the subtree, or None if one is missing."""
        for name, setting in use.arguments.items():
            if name not in subtree.args:
                hint = alternatives(name, subtree.args, "Its arguments")
                message = f'the subtree "{subtree.name}" has no argument "{name}"'
                self.findings.append(error(setting.key, "unknown-argument", message, hint))
        values: dict[str, Value] = {}
        for name, argument in subtree.args.items():
            if name in use.arguments:
                values[name] = use.arguments[name].value
            elif argument.default is not None:
                values[name] = argument.default
            else:
                message = f'the subtree "{subtree.name}" needs the argument "{name}"'
                hint = f"Write with: {{{name}: ...}} beside it."
                self.findings.append(error(use.mark, "missing-argument", message, hint))
        return values if len(values) == len(subtree.args) else None


def _resolved(reference: Reference, names: Names) -> Value:
    value = names.get(reference.name)
    if value is None:
        return reference
    if isinstance(value, Reference):
        return Reference(value.name, reference.mark)
    # The place of the value is the one to correct; the place of its use is named beside it.
    return Literal(value.value, value.mark, f"${reference.name} in line {reference.mark.line}")
