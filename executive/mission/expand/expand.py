"""Putting subtrees in the place of every `use`, and params and arguments in the place of every `$name`.

What is left of the references afterwards are variables. Checks and the built tree see only the
expanded tree, so an argument is checked with the value it has at each place of use.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import TypeVar, cast

from executive.mission.findings import Finding, alternatives, error, suggest, warning
from executive.mission.model.mission import Mission, Subtree
from executive.mission.model.nodes import Node, SectionNode, SkillNode, UnknownNode, UseNode
from executive.mission.model.paths import word_of
from executive.mission.model.values import Named, Reference, Setting, Value
from executive.mission.model.wiring import find_all_written_variables, find_written_variables
from executive.mission.source import Mark
from executive.skill import Direction, Skill

_MAX_DEPTH = 40
_MAX_NODES = 5000
_OUTER_PREFIX = "^"
"""Stands before the variables of the place of use while those of the subtree are renamed."""

Names = Mapping[str, Value]
"""Values of `$name` for params and arguments, by name."""

P = TypeVar("P")


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


def expand(mission: Mission, skills: Mapping[str, type[Skill]]) -> Expanded:
    """Return the mission's tree with nothing left to look up but variables."""
    expander = _Expander(mission, skills)
    tree = None if mission.tree is None else expander.expand_tree(mission.tree, expander.params)
    unused = []
    used = {use.name for tree in mission.trees.values() for use in tree.do.walk() if isinstance(use, UseNode)}
    for subtree in mission.trees.values():
        if subtree.name in expander.used or subtree.library or isinstance(subtree.do, UnknownNode):
            continue
        if subtree.name not in used:
            message = f'nothing uses the subtree "{subtree.name}"'
            expander.findings.append(warning(subtree.mark, "unused-tree", message))
        defaults = {name: argument.default for name, argument in subtree.args.items()}
        given = {name: default for name, default in defaults.items() if default is not None}
        if len(given) == len(defaults):
            body = expander.expand_tree(subtree.do, {**expander.params, **given})
            unused += [body] if body else []
    expander.findings += expander.find_unused_names()
    return Expanded(tree, tuple(unused), tuple(expander.findings))


class _TooLargeError(Exception):
    """The expansion was given up; the findings say why."""


class _Expander:
    def __init__(self, mission: Mission, skills: Mapping[str, type[Skill]]) -> None:
        self.mission, self.skills = mission, skills
        self.params: Names = {name: param.value for name, param in mission.params.items()}
        self.findings: list[Finding] = []
        self.used: set[str] = set()
        self._looked_up: set[tuple[str, str]] = set()
        self._count = 0
        self._outermost: Mark | None = None
        self._uses: Counter[str] = Counter()

    def expand_tree(self, tree: Node, names: Names) -> Node | None:
        try:
            return self._expand_node(tree, names, (), 0)
        except _TooLargeError:
            return None

    def find_unused_names(self) -> Iterator[Finding]:
        """Find every param and argument that no `$name` of a tree that was put in refers to."""
        for name, param in self.mission.params.items() if self.mission.tree else ():
            if ("", name) not in self._looked_up and f"${name}" not in param.mark.source.text:
                yield warning(param.mark, "unused-param", f'nothing uses the param "{name}"')
        for subtree in self.mission.trees.values():
            if isinstance(subtree.do, UnknownNode) or not self._uses[subtree.name]:
                continue
            for name, argument in subtree.args.items():
                if (subtree.name, name) not in self._looked_up:
                    message = f'nothing in the subtree "{subtree.name}" uses its argument "{name}"'
                    yield error(argument.mark, "unused-argument", message)

    def _expand_node(self, node: Node, names: Names, inside: tuple[str, ...], depth: int) -> Node:
        self._count += 1
        if depth > _MAX_DEPTH or self._count > _MAX_NODES:
            deep, large = f"is more than {_MAX_DEPTH} levels deep", f"has more than {_MAX_NODES} nodes"
            message = f"with its subtrees put in, the tree {deep if depth > _MAX_DEPTH else large}"
            self.findings.append(error(self._outermost or node.mark, "too-large", message))
            raise _TooLargeError

        def fill(part: object) -> object:
            """Return a part of the node with everything looked up."""
            if isinstance(part, Node):
                return self._expand_node(part, names, inside, depth + 1)
            if isinstance(part, Reference):
                return self._resolve(part, names, inside)
            return _map_parts(part, fill)

        self.findings += self._find_shadowed(node, names)
        rebuilt = _map_parts(node, fill)
        return self._expand_use(rebuilt, inside, depth) if isinstance(rebuilt, UseNode) else rebuilt

    def _find_shadowed(self, node: Node, names: Names) -> Iterator[Finding]:
        """Find every variable that a node would write under the name of a param or argument."""
        for _, variable in find_written_variables(node):
            if variable.name in names:
                owner = self._describe_name(variable.name)
                message = f"{word_of(node)} would write ${variable.name}, but that is {owner}"
                yield error(variable.mark, "shadowed-param", message, "Call one of them otherwise.")
        if not isinstance(node, SkillNode) or node.skill not in self.skills:
            return
        for name, port in self.skills[node.skill].ports.items():
            if port.direction is Direction.OUT and name in names and name not in node.settings:
                message = f"{node.skill}.{name} would write ${name}, but that is {self._describe_name(name)}"
                hint = f"Rename that, or write {name}: $other."
                yield error(node.mark, "shadowed-param", message, hint)

    def _describe_name(self, name: str) -> str:
        return "a param of the mission" if name in self.params else "an argument here"

    def _resolve(self, reference: Reference, names: Names, inside: tuple[str, ...]) -> Value:
        value = names.get(reference.name)
        # Who writes a name a little wrong has not forgotten it.
        meant = reference.name if value is not None else suggest(reference.name, names)
        own = bool(inside) and meant in self.mission.trees[inside[-1]].args
        self._looked_up.add((inside[-1] if own else "", meant or ""))
        if value is None:
            return reference
        if isinstance(value, Reference):
            return value
        # The place of the value is the one to correct; the place of its use is named beside it.
        origin = f"${reference.name} in {reference.mark.place(value.mark.source)}"
        return replace(value, origin=origin, reference_mark=reference.mark)

    def _expand_use(self, use: UseNode, inside: tuple[str, ...], depth: int) -> Node:
        self.used.add(use.name)
        subtree = self.mission.trees.get(use.name)
        if subtree is None and not self.mission.is_complete:
            return use
        if subtree is None:
            self.used.add(suggest(use.name, self.mission.trees) or "")
            hint = alternatives(use.name, self.mission.trees, "The mission's subtrees")
            self.findings.append(error(use.mark, "unknown-tree", f'there is no subtree "{use.name}"', hint))
            return use
        if use.name in inside:
            ring = " -> ".join((*inside[inside.index(use.name) :], use.name))
            message = f"a subtree cannot use itself: {ring}"
            self.findings.append(error(use.mark, "recursive-use", message))
            return use
        arguments = self._find_arguments(use, subtree)
        returns = self._name_returns(use, subtree)
        if arguments is None:
            return use
        self._uses[use.name] += 1
        self._outermost = self._outermost if inside else use.mark
        # A library knows its own arguments only: it must mean the same in every mission.
        around: Names = {} if subtree.library else self.params
        if subtree.returns is None:
            body = self._expand_node(subtree.do, {**around, **arguments}, (*inside, use.name), depth + 1)
            return replace(use, body=body)
        arguments = {name: _mark_as_outer(value) for name, value in arguments.items()}
        body = self._expand_node(subtree.do, {**around, **arguments}, (*inside, use.name), depth + 1)
        return replace(
            use, body=self._rename_own_variables(use, body, returns), returned=tuple(returns.values())
        )

    def _rename_own_variables(self, use: UseNode, body: Node, returns: Mapping[str, str]) -> Node:
        """Return the body with the variables that it keeps to itself under names of their own."""
        number = self._uses[use.name]
        own = f"{use.name}." if number == 1 else f"{use.name}-{number}."
        kept = find_all_written_variables(body, self.skills)

        def rename(name: str) -> str:
            if name.startswith(_OUTER_PREFIX):
                return name.removeprefix(_OUTER_PREFIX)
            if name in returns:
                return returns[name]
            return own + name if name in kept else name

        def rename_part(part: object) -> object:
            if isinstance(part, Reference | Named):
                return replace(part, name=rename(part.name))
            part = _map_parts(part, rename_part)
            if isinstance(part, UseNode):
                return replace(part, returned=tuple(map(rename, part.returned)))
            if isinstance(part, SkillNode) and part.skill in self.skills:
                ports = self.skills[part.skill].ports
                return replace(part, names={port: rename(part.names.get(port, port)) for port in ports})
            return part

        return cast("Node", rename_part(body))

    def _name_returns(self, use: UseNode, subtree: Subtree) -> dict[str, str]:
        """Return what each variable that the subtree returns is called at the place of use."""
        known = subtree.returns or {}
        names = {name: name for name in known}
        for name, setting in use.returns.items():
            if name not in known:
                hint = alternatives(name, known, "It returns")
                message = f'the subtree "{subtree.name}" does not return "{name}"'
                self.findings.append(error(setting.key, "unknown-return", message, hint))
            elif isinstance(setting.value, Reference):
                names[name] = setting.value.name
            else:
                message = f'returns.{name} takes the variable to write, as "$mine"'
                self.findings.append(error(setting.value.mark, "wrong-type", message))
        return names

    def _find_arguments(self, use: UseNode, subtree: Subtree) -> dict[str, Value] | None:
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


def _mark_as_outer(value: Value) -> Value:
    return replace(value, name=_OUTER_PREFIX + value.name) if isinstance(value, Reference) else value


def _map_parts(part: P, change: Callable[[object], object]) -> P:
    """Return a node, or a part of a node, with `change` applied to each of its direct parts."""
    mapped: object = part
    if isinstance(part, tuple):
        mapped = tuple([change(item) for item in part])
    elif isinstance(part, dict):
        mapped = {key: change(item) for key, item in part.items()}
    elif isinstance(part, Node | Setting | SectionNode):
        values = {field.name: change(getattr(part, field.name)) for field in fields(part)}
        mapped = replace(part, **values)  # type: ignore[arg-type] # `change` keeps the type of each field.
    return cast("P", mapped)
