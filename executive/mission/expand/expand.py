"""Expansion of a mission: subtrees replace each `use`, and values of params and arguments replace `$name`.

After expansion, each remaining reference is a variable. Checks and builder get only the expanded tree, so
each argument is checked with its value at every use.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import TypeVar, cast

from executive.mission.findings import Finding, find_similar_word, list_choices, make_error, make_warning
from executive.mission.model.mission import Mission, Subtree
from executive.mission.model.node_paths import get_type_name
from executive.mission.model.nodes import Node, SectionNode, SkillNode, UnknownNode, UseNode
from executive.mission.model.values import LocatedName, Reference, Setting, Value
from executive.mission.model.wiring import find_control_node_outputs, find_written_variables
from executive.mission.source import Mark
from executive.skill import Direction, Skill

_MAX_DEPTH = 40
"""Maximum depth of an expanded tree."""
_MAX_NODE_COUNT = 5000
"""Maximum number of expanded nodes."""
_CALLER_PREFIX = "^"
"""Temporary prefix that protects variables of the caller while local variables of the subtree are renamed."""

ValuesByName = Mapping[str, Value]
"""Values of params and arguments by name."""

P = TypeVar("P")


@dataclass(frozen=True)
class ExpandedMission:
    """A mission in which the bodies of subtrees are part of the tree.

    Attributes:
        tree: Expanded tree, or None if it could not be expanded.
        unused_subtrees: Expanded subtrees that the tree does not use and whose arguments all have defaults.
        findings: Errors and warnings about subtrees, params and arguments.
    """

    tree: Node | None
    unused_subtrees: tuple[Node, ...]
    findings: tuple[Finding, ...]


def expand(mission: Mission, skills: Mapping[str, type[Skill]]) -> ExpandedMission:
    """Return the mission with expanded subtrees, params and arguments."""
    expander = _Expander(mission, skills)
    tree = None if mission.tree is None else expander.expand_tree(mission.tree, expander.params)
    unused_subtrees = []
    used_in_trees = {
        use.name for tree in mission.trees.values() for use in tree.do.walk() if isinstance(use, UseNode)
    }
    for subtree in mission.trees.values():
        if subtree.name in expander.used_names or subtree.library or isinstance(subtree.do, UnknownNode):
            continue
        if subtree.name not in used_in_trees:
            message = f'the subtree "{subtree.name}" is never used'
            expander.findings.append(make_warning(subtree.mark, "unused-tree", message))
        optional = {name: argument.default for name, argument in subtree.args.items()}
        defaults = {name: default for name, default in optional.items() if default is not None}
        if len(defaults) == len(optional):
            body = expander.expand_tree(subtree.do, {**expander.params, **defaults})
            unused_subtrees += [body] if body else []
    expander.findings += expander.find_unused_names()
    return ExpandedMission(tree, tuple(unused_subtrees), tuple(expander.findings))


class _TooLargeError(Exception):
    """The expanded tree is too large; the findings contain the error."""


class _Expander:
    """Expands the trees of one mission; `used_names` are names of used subtrees, also misspelt ones."""

    def __init__(self, mission: Mission, skills: Mapping[str, type[Skill]]) -> None:
        self.mission, self.skills = mission, skills
        self.params: ValuesByName = {name: param.value for name, param in mission.params.items()}
        self.findings: list[Finding] = []
        self.used_names: set[str] = set()
        # Referenced params and arguments as (subtree, name); the subtree is "" for a param of the mission.
        self._referenced: set[tuple[str, str]] = set()
        self._node_count = 0
        self._outermost_mark: Mark | None = None
        self._use_counts: Counter[str] = Counter()

    def expand_tree(self, tree: Node, values: ValuesByName) -> Node | None:
        """Return the expanded tree, or None if it is too large."""
        try:
            return self._expand_node(tree, values, (), 0)
        except _TooLargeError:
            return None

    def find_unused_names(self) -> Iterator[Finding]:
        """Yield a finding for every param, and every argument of an expanded subtree, without a reference."""
        for name, param in self.mission.params.items() if self.mission.tree else ():
            if ("", name) not in self._referenced and f"${name}" not in param.mark.source.text:
                yield make_warning(param.mark, "unused-param", f'the param "{name}" is never used')
        for subtree in self.mission.trees.values():
            if isinstance(subtree.do, UnknownNode) or not self._use_counts[subtree.name]:
                continue
            for name, argument in subtree.args.items():
                if (subtree.name, name) not in self._referenced:
                    message = f'the subtree "{subtree.name}" never uses its argument "{name}"'
                    yield make_error(argument.mark, "unused-argument", message)

    def _expand_node(self, node: Node, values: ValuesByName, callers: tuple[str, ...], depth: int) -> Node:
        """Return the expanded node; `callers` are the subtrees that contain the node, the outermost first."""
        self._node_count += 1
        if depth > _MAX_DEPTH or self._node_count > _MAX_NODE_COUNT:
            deep, large = f"is more than {_MAX_DEPTH} levels deep", f"has more than {_MAX_NODE_COUNT} nodes"
            message = f"after the expansion of subtrees, the tree {deep if depth > _MAX_DEPTH else large}"
            self.findings.append(make_error(self._outermost_mark or node.mark, "too-large", message))
            raise _TooLargeError

        def expand_part(part: object) -> object:
            """Return a part of the node in which all nodes and references are expanded."""
            if isinstance(part, Node):
                return self._expand_node(part, values, callers, depth + 1)
            if isinstance(part, Reference):
                return self._resolve(part, values, callers)
            return _map_parts(part, expand_part)

        self.findings += self._find_shadowed(node, values)
        expanded = _map_parts(node, expand_part)
        return self._expand_use(expanded, callers, depth) if isinstance(expanded, UseNode) else expanded

    def _find_shadowed(self, node: Node, values: ValuesByName) -> Iterator[Finding]:
        """Yield an error for every output variable of a node that has the name of a param or argument."""
        for _, variable in find_control_node_outputs(node):
            name = variable.name
            if name in values:
                message = f"{get_type_name(node)} writes ${name}, but {name} is {self._describe_kind(name)}"
                yield make_error(variable.mark, "shadowed-param", message, "Rename one of them.")
        if not isinstance(node, SkillNode) or node.skill not in self.skills:
            return
        for name, port in self.skills[node.skill].ports.items():
            if port.direction is Direction.OUT and name in values and name not in node.settings:
                message = f"{node.skill}.{name} writes ${name}, but {name} is {self._describe_kind(name)}"
                hint = f"Let {node.skill} write another variable: {name}: $other."
                yield make_error(node.mark, "shadowed-param", message, hint)

    def _describe_kind(self, name: str) -> str:
        return "a param of the mission" if name in self.params else "an argument of the subtree"

    def _resolve(self, reference: Reference, values: ValuesByName, callers: tuple[str, ...]) -> Value:
        """Return the value of a param or argument, or the reference itself if it is a variable."""
        value = values.get(reference.name)
        # A param or argument with a misspelt reference counts as used.
        name = reference.name if value is not None else find_similar_word(reference.name, values)
        is_argument = bool(callers) and name in self.mission.trees[callers[-1]].args
        self._referenced.add((callers[-1] if is_argument else "", name or ""))
        if value is None:
            return reference
        if isinstance(value, Reference):
            return value
        # Findings have the position of the value; their messages state the position of the reference.
        origin = f"${reference.name} in {reference.mark.describe_place(value.mark.source)}"
        return replace(value, origin=origin, reference_mark=reference.mark)

    def _expand_use(self, use: UseNode, callers: tuple[str, ...], depth: int) -> Node:
        """Return the use with its expanded body, or without body if it has errors."""
        self.used_names.add(use.name)
        subtree = self.mission.trees.get(use.name)
        if subtree is None and not self.mission.is_complete:
            return use
        if subtree is None:
            self.used_names.add(find_similar_word(use.name, self.mission.trees) or "")
            message = f'there is no subtree "{use.name}"'
            hint = list_choices(use.name, self.mission.trees, "Subtrees of the mission")
            self.findings.append(make_error(use.mark, "unknown-tree", message, hint))
            return use
        if use.name in callers:
            cycle = " -> ".join((*callers[callers.index(use.name) :], use.name))
            message = f"a subtree cannot use itself: {cycle}"
            self.findings.append(make_error(use.mark, "recursive-use", message))
            return use
        arguments = self._find_arguments(use, subtree)
        returns = self._map_returns(use, subtree)
        if arguments is None:
            return use
        self._use_counts[use.name] += 1
        self._outermost_mark = self._outermost_mark if callers else use.mark
        # A library has no access to params, so that it has the same meaning in every mission.
        params: ValuesByName = {} if subtree.library else self.params
        if subtree.returns is None:
            body = self._expand_node(subtree.do, {**params, **arguments}, (*callers, use.name), depth + 1)
            return replace(use, body=body)
        arguments = {name: _add_caller_prefix(value) for name, value in arguments.items()}
        body = self._expand_node(subtree.do, {**params, **arguments}, (*callers, use.name), depth + 1)
        body = self._rename_variables(use, body, returns)
        return replace(use, body=body, returned_variables=tuple(returns.values()))

    def _rename_variables(self, use: UseNode, body: Node, returns: Mapping[str, str]) -> Node:
        """Return the body: local variables get unique names, returned variables the names of the caller."""
        number = self._use_counts[use.name]
        prefix = f"{use.name}." if number == 1 else f"{use.name}-{number}."
        written = find_written_variables(body, self.skills)

        def rename(name: str) -> str:
            if name.startswith(_CALLER_PREFIX):
                return name.removeprefix(_CALLER_PREFIX)
            if name in returns:
                return returns[name]
            return prefix + name if name in written else name

        def rename_part(part: object) -> object:
            if isinstance(part, Reference | LocatedName):
                return replace(part, name=rename(part.name))
            part = _map_parts(part, rename_part)
            if isinstance(part, UseNode):
                return replace(part, returned_variables=tuple(map(rename, part.returned_variables)))
            if isinstance(part, SkillNode) and part.skill in self.skills:
                ports = self.skills[part.skill].ports
                variables = {port: rename(part.variables_by_port.get(port, port)) for port in ports}
                return replace(part, variables_by_port=variables)
            return part

        return cast("Node", rename_part(body))

    def _map_returns(self, use: UseNode, subtree: Subtree) -> dict[str, str]:
        """Return the caller's variable for each variable that the subtree returns."""
        known = subtree.returns or {}
        names = {name: name for name in known}
        for name, setting in use.returns.items():
            if name not in known:
                hint = list_choices(name, known, "Returned variables")
                message = f'the subtree "{subtree.name}" does not return "{name}"'
                self.findings.append(make_error(setting.name_mark, "unknown-return", message, hint))
            elif isinstance(setting.value, Reference):
                names[name] = setting.value.name
            else:
                message = f"returns.{name} must be a variable, for example $mine"
                self.findings.append(make_error(setting.value.mark, "wrong-type", message))
        return names

    def _find_arguments(self, use: UseNode, subtree: Subtree) -> dict[str, Value] | None:
        """Return the value of every argument of the subtree, or None if one is missing."""
        for name, setting in use.arguments.items():
            if name not in subtree.args:
                hint = list_choices(name, subtree.args, "Arguments of the subtree")
                message = f'the subtree "{subtree.name}" has no argument "{name}"'
                self.findings.append(make_error(setting.name_mark, "unknown-argument", message, hint))
        values: dict[str, Value] = {}
        for name, argument in subtree.args.items():
            if name in use.arguments:
                values[name] = use.arguments[name].value
            elif argument.default is not None:
                values[name] = argument.default
            else:
                message = f'the subtree "{subtree.name}" needs the argument "{name}"'
                hint = f"Write with: {{{name}: ...}} at the level of use."
                self.findings.append(make_error(use.mark, "missing-argument", message, hint))
        return values if len(values) == len(subtree.args) else None


def _add_caller_prefix(value: Value) -> Value:
    return replace(value, name=_CALLER_PREFIX + value.name) if isinstance(value, Reference) else value


def _map_parts(part: P, change: Callable[[object], object]) -> P:
    """Return a node, or a part of a node, after the application of `change` to each of its direct parts."""
    mapped: object = part
    if isinstance(part, tuple):
        mapped = tuple([change(item) for item in part])
    elif isinstance(part, dict):
        mapped = {key: change(item) for key, item in part.items()}
    elif isinstance(part, Node | Setting | SectionNode):
        values = {field.name: change(getattr(part, field.name)) for field in fields(part)}
        mapped = replace(part, **values)  # type: ignore[arg-type] # `change` keeps the type of each field.
    return cast("P", mapped)
