"""Expansion of a mission: subtrees replace each `use`, and values of params and arguments replace `$name`.

The checks and the tree builder get only the expanded tree, in which every reference is a variable.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

from executive.behaviours import Skills
from executive.mission.grammar import SEQUENCE_KEYWORD, SET_KEYWORD
from executive.mission.mission_file import Mission, MissionParam, QuotaKey, Subtree
from executive.mission.ports import find_node_wires, find_written_variables, list_assignments
from executive.skill import Direction
from executive.text.findings import Finding, Span, find_similar_word, make_error, make_warning, suggest_choice
from executive.tree.keys import Children, Elements, KeyOwner, KeySection, KeyValue, Part, map_parts
from executive.tree.node import ControlNode, load_control_nodes
from executive.tree.specification import (
    Constant,
    Expression,
    InvalidNode,
    InvalidValue,
    LocatedName,
    Node,
    Reference,
    SkillNode,
    SubtreeNode,
    Value,
    VariableName,
)

_MAX_DEPTH = 40
"""Maximum depth of an expanded tree."""
_MAX_NODE_COUNT = 5000
"""Maximum number of expanded nodes."""
_CALLER_PREFIX = "^"
"""Temporary prefix that protects the caller's variables while the variables of a subtree are renamed."""

ValuesByName = Mapping[str, Value]
"""Values of params and arguments by name."""
PredefinedLists = Mapping[str, Sequence[str]]
"""Names in each predefined list, such as `bins`."""


@dataclass(frozen=True)
class ExpandedMission:
    """A mission after expansion.

    Attributes:
        quotas: Quotas with the values of params.
        tree: Expanded tree, or None if the expansion failed.
        unused_subtrees: Expanded bodies of the unused subtrees that require no arguments.
        findings: Errors and warnings about subtrees, params and arguments.
    """

    quotas: Mapping[QuotaKey, Value]
    tree: Node | None
    unused_subtrees: tuple[Node, ...]
    findings: tuple[Finding, ...]


def expand(mission: Mission, skills: Skills, predefined_lists: PredefinedLists) -> ExpandedMission:
    """Return the mission with expanded subtrees, params, arguments and predefined lists.

    `predefined_lists` contains the names in each list; a list without an entry, such as `items`, remains.
    """
    expander = _Expander(mission, skills, predefined_lists)
    quotas = {key: expander.expand_value(limit) for key, limit in mission.quotas.items()}
    root = mission.tree and initialize_variables(mission.tree, mission.variables)
    tree = None if root is None else expander.expand_tree(root, expander.params)
    unused_subtrees = []
    subtree_nodes = [node for subtree in mission.subtrees.values() for node in subtree.body.walk()]
    names_used_in_subtrees = {node.name for node in subtree_nodes if isinstance(node, SubtreeNode)}
    for subtree in mission.subtrees.values():
        is_used = subtree.name in expander.used_subtree_names
        if is_used or subtree.library or isinstance(subtree.body, InvalidNode):
            continue
        if subtree.name not in names_used_in_subtrees:
            message = f'the subtree "{subtree.name}" is never used'
            expander.findings.append(make_warning(subtree.name.span, "unused-tree", message))
        arguments = subtree.arguments.items()
        defaults: dict[str, Value] = {name: value for name, value in arguments if value is not None}
        if len(defaults) == len(subtree.arguments):
            body = expander.expand_tree(subtree.body, {**expander.params, **defaults})
            unused_subtrees += [body] if body else []
    expander.findings += expander.find_unused_names()
    return ExpandedMission(quotas, tree, tuple(unused_subtrees), tuple(expander.findings))


class _TooLargeError(Exception):
    """The expanded tree is too large; the findings contain the error."""


class _Expander:
    """Expander of the trees of one mission.

    Attributes:
        used_subtree_names: Names of used subtrees; for a misspelt name, also the most similar name.
    """

    def __init__(self, mission: Mission, skills: Skills, predefined_lists: PredefinedLists) -> None:
        self.mission = mission
        self.skills = skills
        self._predefined_lists = predefined_lists
        self.params: ValuesByName = {name: param.value for name, param in mission.params.items()}
        self.findings: list[Finding] = []
        self.used_subtree_names: set[str] = set()
        # Referenced params and arguments, as (subtree, name); for a param, the subtree is "".
        self._referenced_names: set[tuple[str, str]] = set()
        self._node_count = 0
        # Span of the `use` in the mission file that contains the current node.
        self._outermost_span: Span | None = None
        self._use_counts: Counter[str] = Counter()

    def expand_value(self, value: Value) -> Value:
        """Return a value with the value of a param in place of its name."""
        return self._resolve_name(value, self.params, ()) if isinstance(value, Reference) else value

    def expand_tree(self, tree: Node, values: ValuesByName) -> Node | None:
        """Return the expanded tree, or None if the expanded tree is too large."""
        try:
            return self._expand_node(tree, values, (), 0)
        except _TooLargeError:
            return None

    def find_unused_names(self) -> Iterator[Finding]:
        """Yield a finding for every param without reference, and every unused argument of a used subtree."""
        for name in self.mission.params if self.mission.tree else ():
            # References in nodes that are not expanded, for example after an error, are only in the text.
            if ("", name) not in self._referenced_names and f"${name}" not in name.span.source.text:
                yield make_warning(name.span, "unused-param", f'the param "{name}" is never used')
        for subtree in self.mission.subtrees.values():
            if isinstance(subtree.body, InvalidNode) or not self._use_counts[subtree.name]:
                continue
            for name in subtree.arguments:
                if (subtree.name, name) not in self._referenced_names:
                    message = f'the subtree "{subtree.name}" never uses its argument "{name}"'
                    yield make_error(name.span, "unused-argument", message)

    def _expand_node(self, node: Node, values: ValuesByName, callers: tuple[str, ...], depth: int) -> Node:
        """Return the expanded node; `callers` are the subtrees that contain the node, the outermost first."""
        self._node_count += 1
        if depth > _MAX_DEPTH or self._node_count > _MAX_NODE_COUNT:
            depth_problem = f"is more than {_MAX_DEPTH} levels deep"
            problem = depth_problem if depth > _MAX_DEPTH else f"has more than {_MAX_NODE_COUNT} nodes"
            message = f"after the expansion of subtrees, the tree {problem}"
            self._add_error(self._outermost_span or node.span, "too-large", message)
            raise _TooLargeError

        def expand_part(part: Part) -> object:
            if isinstance(part, Node):
                return self._expand_node(part, values, callers, depth + 1)
            return self._resolve_name(part, values, callers) if isinstance(part, Reference) else part

        self.findings += self._find_shadowed_names(node, values)
        expanded = self._expand_predefined_lists(map_parts(node, expand_part))
        return self._expand_use(expanded, callers, depth) if isinstance(expanded, SubtreeNode) else expanded

    def _expand_predefined_lists(self, node: Node) -> Node:
        """Return a control node with the names in place of each predefined list such as `bins`."""
        if not isinstance(node, ControlNode):
            return node
        lists: dict[str, Value] = {}
        for key, value in node.list_values():
            if key.value_type == Elements and isinstance(value, Constant) and isinstance(value.value, str):
                names = self._predefined_lists.get(value.value)
                if names is not None:
                    lists[key.name] = replace(value, value=list(names))
        return node.replace(settings={**node.settings, **lists}) if lists else node

    def _find_shadowed_names(self, node: Node, values: ValuesByName) -> Iterator[Finding]:
        """Yield an error for every output variable of a node that has the name of a param or argument."""
        for wire in find_node_wires(node, self.skills, Direction.OUT):
            # `check_settings` reports an output of a skill that the mission sets to a param or argument.
            if wire.variable in values and (isinstance(node, ControlNode) or not wire.is_explicit):
                is_param = wire.variable in self.params
                kind = "a param of the mission" if is_param else "an argument of the subtree"
                message = f"{wire} writes ${wire.variable}, but {wire.variable} is {kind}"
                yield make_error(wire.span, "shadowed-param", message, wire.rename_hint)

    def _resolve_name(self, reference: Reference, values: ValuesByName, callers: tuple[str, ...]) -> Value:
        """Return the value of a param or argument, or the reference itself if it is a variable."""
        value = values.get(reference.name)
        if reference.name.startswith("."):
            return reference  # A candidate, which only its expression knows.
        # A misspelt reference counts as a reference to the param or argument with the most similar name.
        name = reference.name if value is not None else find_similar_word(reference.name, values)
        is_argument = bool(callers) and name in self.mission.subtrees[callers[-1]].arguments
        self._referenced_names.add((callers[-1] if is_argument else "", name or ""))
        if value is None or isinstance(value, InvalidValue):
            return value or reference
        if reference.field == "count" and isinstance(value, Constant) and isinstance(value.value, list):
            return replace(value, value=len(value.value), origin=f"{reference} ")
        if reference.field and not (isinstance(value, Reference) and not value.field):
            text = "a constant" if isinstance(value, Constant) else "an expression"
            if isinstance(value, Reference):
                text = f"the field {value}".replace(_CALLER_PREFIX, "")
            message = f"${reference.name} is {text}, which has no field {reference.field}"
            self._add_error(reference.span, "unknown-field", message)
            return InvalidValue(reference.span)
        if isinstance(value, Reference):
            return replace(value, field=reference.field or value.field)
        if isinstance(value, Expression):
            return value
        # A finding about the value is located at the value, so the message must contain the reference.
        origin = f"${reference.name} in {reference.span.describe_place(value.span.source)}"
        return replace(value, origin=origin, reference_span=reference.span)

    def _expand_use(self, use: SubtreeNode, callers: tuple[str, ...], depth: int) -> Node:
        """Return `use` with the expanded body of the subtree; after an error, return `use` unchanged."""
        self.used_subtree_names.add(use.name)
        subtree = self.mission.subtrees.get(use.name)
        if subtree is None:
            if self.mission.is_complete:
                self.used_subtree_names.add(find_similar_word(use.name, self.mission.subtrees) or "")
                hint = suggest_choice(use.name, self.mission.subtrees, "Subtrees of the mission")
                self._add_error(use.span, "unknown-tree", f'there is no subtree "{use.name}"', hint)
            return use
        if use.name in callers:
            cycle = " -> ".join((*callers[callers.index(use.name) :], use.name))
            self._add_error(use.span, "recursive-use", f"a subtree cannot use itself: {cycle}")
            return use
        for name in subtree.returns or ():
            if name in subtree.variables:
                message = f"{name} is a variable of the subtree, so that the subtree cannot return it"
                hint = f"Declare {name} where the subtree is used; `set` in the subtree then changes it."
                self._add_error(name.span, "shadowed-variable", message, hint)
        arguments = self._collect_arguments(use, subtree)
        returns = self._map_returned_variables(use, subtree)
        self._use_counts[use.name] += 1
        self._outermost_span = self._outermost_span if callers else use.span
        # A library must not depend on the params of a mission.
        params: ValuesByName = {} if subtree.library else self.params
        arguments = {name: _prefix_variables(value) for name, value in arguments.items()}
        body = initialize_variables(subtree.body, subtree.variables)
        body = self._expand_node(body, {**params, **arguments}, (*callers, use.name), depth + 1)
        local_names = set(map(str, subtree.variables))
        if subtree.returns is not None:
            # A variable that the mission or a caller declares is not local.
            declared = {*self.mission.variables}.union(
                *(self.mission.subtrees[one].variables for one in callers)
            )
            shared = {wire.variable for wire in list_assignments(body, self.skills)} & declared
            local_names |= find_written_variables(body, self.skills) - shared
        body = self._rename_variables(use, body, returns, local_names)
        return use.replace(body=body, written_variables=tuple(returns.values()))

    def _rename_variables(
        self, use: SubtreeNode, body: Node, returns: Mapping[str, str], local_names: Collection[str]
    ) -> Node:
        """Return the body; local variables get unique names, returned variables get the caller's names."""
        use_number = self._use_counts[use.name]
        prefix = f"{use.name}." if use_number == 1 else f"{use.name}-{use_number}."

        def rename(name: str) -> str:
            if name.startswith(_CALLER_PREFIX):
                return name.removeprefix(_CALLER_PREFIX)
            if name in returns:
                return returns[name]
            return prefix + name if name in local_names else name

        def rename_part(part: Part) -> Part:
            if isinstance(part, Reference):
                return replace(part, name=rename(part.name))
            if isinstance(part, VariableName):
                return VariableName(rename(part), part.field, part.span)
            part = map_parts(part, rename_part)
            if isinstance(part, SubtreeNode):
                return part.replace(written_variables=tuple(map(rename, part.written_variables)))
            if isinstance(part, SkillNode) and part.skill in self.skills:
                ports = self.skills[part.skill].ports
                variables = {port: rename(part.variables_by_port.get(port, port)) for port in ports}
                return part.replace(variables_by_port=variables)
            return part

        return cast("Node", rename_part(body))

    def _map_returned_variables(self, use: SubtreeNode, subtree: Subtree) -> dict[str, str]:
        """Return the variable of the caller for each name in `returns` of the subtree."""
        returned_names = subtree.returns or ()
        variables: dict[str, str] = {name: name for name in returned_names}
        for name, value in use.returns.items():
            if name not in returned_names:
                hint = suggest_choice(name, returned_names, "Returned variables")
                message = f'the subtree "{subtree.name}" does not return "{name}"'
                self._add_error(name.span, "unknown-return", message, hint)
            elif isinstance(value, Reference) and not value.field:
                variables[name] = value.name
            elif not isinstance(value, InvalidValue):
                message = f"returns.{name} must be a variable, for example $mine"
                self._add_error(value.span, "wrong-type", message)
        return variables

    def _collect_arguments(self, use: SubtreeNode, subtree: Subtree) -> dict[str, Value]:
        """Return the value of every argument of the subtree; a missing value is an `InvalidValue`."""
        for name in use.arguments:
            if name not in subtree.arguments:
                hint = suggest_choice(name, subtree.arguments, "Arguments of the subtree")
                message = f'the subtree "{subtree.name}" has no argument "{name}"'
                self._add_error(name.span, "unknown-argument", message, hint)
        values: dict[str, Value] = {}
        for name, default in subtree.arguments.items():
            value = use.arguments.get(name, default)
            values[name] = value or InvalidValue(use.span)
            if value is None:
                message = f'the subtree "{subtree.name}" needs the argument "{name}"'
                hint = f"Write with: {{{name}: ...}} at the level of use."
                self._add_error(use.span, "missing-argument", message, hint)
        return values

    def _add_error(self, span: Span, code: str, message: str, hint: str = "") -> None:
        self.findings.append(make_error(span, code, message, hint))


def _prefix_variables(value: Value) -> Value:
    """Return a value with the prefix of the caller's variables in all references."""
    if isinstance(value, Expression):
        return replace(value, operands=tuple(map(_prefix_variables, value.operands)))
    return replace(value, name=_CALLER_PREFIX + value.name) if isinstance(value, Reference) else value


def initialize_variables(body: Node, variables: Mapping[LocatedName, MissionParam]) -> Node:
    """Return a tree that gives variables their initial values before it runs."""
    if not variables:
        return body
    node_classes = load_control_nodes()
    nodes = [
        node_classes[SET_KEYWORD].make(
            {"to": variable.value},
            span=name.span,
            set=VariableName(name, span=name.span),
            declaration=variable,
        )
        for name, variable in variables.items()
    ]
    return node_classes[SEQUENCE_KEYWORD].make({}, span=body.span, do=(*nodes, body), is_list=True)


def assign_paths(node: Node, parent_path: str = "", key_path: str = "tree", name: str = "") -> Node:
    """Return the node with its path and the paths of its descendants.

    `key_path` is the part of the path for the key of the parent that contains the node, or "". `name` is the
    last part of the path; the default is `node.path_name`, and for a list no name.
    """
    path = _join(parent_path, key_path, name or ("" if node.is_list else node.path_name))
    match node:
        case ControlNode():
            return node.replace(path=path, **_assign_key_paths(node, path))
        case SubtreeNode(body=Node() as body):
            return node.replace(path=path, body=assign_paths(body, path, "do" if node.label else ""))
        case InvalidNode():
            return node.replace(path=path, parts=_assign_list_paths(node.parts, path))
    return node.replace(path=path)


def _assign_key_paths(owner: KeyOwner, path: str, section_path: str = "") -> dict[str, KeyValue]:
    """Return the attributes of a control node or section whose values contain nodes, with their paths.

    `path` is that of the control node. `section_path` is the path of a section in the control node, such as
    `backoff` or `cases/2`; "" if `owner` is the control node.
    """
    values: dict[str, KeyValue] = {}
    for key, value in owner.list_values():
        # In the path of a child below `do` of a section, the key `do` is omitted.
        key_path = section_path if section_path and key.name == "do" else _join(section_path, key.name)
        if isinstance(value, Node):
            is_key_in_path = key.in_path or value.is_list
            values[key.attribute] = assign_paths(value, path, key_path if is_key_in_path else "")
        elif isinstance(value, KeySection):
            values[key.attribute] = value.replace(**_assign_key_paths(value, path, key_path))
        elif isinstance(value, tuple) and key.value_type == Children:
            values[key.attribute] = _assign_list_paths(cast("tuple[Node, ...]", value), path)
        elif isinstance(value, tuple):
            values[key.attribute] = tuple(
                item.replace(**_assign_key_paths(item, path, f"{key_path}/{index}"))
                if isinstance(item, KeySection)
                else item
                for index, item in enumerate(value, 1)
            )
    return values


def _assign_list_paths(nodes: tuple[Node, ...], parent_path: str) -> tuple[Node, ...]:
    counts = Counter(node.path_name for node in nodes)

    def get_unique_name(index: int, node: Node) -> str:
        name = node.path_name
        has_own_name = bool(node.label) or isinstance(node, SkillNode | SubtreeNode)
        return name if has_own_name and counts[name] == 1 else f"{index}:{name}"

    names = [get_unique_name(index, node) for index, node in enumerate(nodes, 1)]
    return tuple(assign_paths(node, parent_path, "", name) for node, name in zip(nodes, names, strict=True))


def _join(*names: str) -> str:
    return "/".join(name for name in names if name)
