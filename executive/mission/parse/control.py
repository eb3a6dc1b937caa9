"""Control nodes, read by the keys that their classes declare."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from executive.mission.model import nodes as model
from executive.mission.model.nodes import Part
from executive.mission.model.values import Named
from executive.mission.parse.fields import NAME, Fields, value_of
from executive.mission.source import Mark
from executive.mission.text import yaml_text as yaml
from executive.mission.words import describe
from executive.tree.keys import Key, Kind
from executive.tree.keys import KeySection as DeclaredSection
from executive.tree.node import ControlNode

if TYPE_CHECKING:
    from executive.mission.parse.nodes import NodeParser


def unread(mark: Mark) -> model.Node:
    """Return a node for one that could not be read; a finding says why."""
    return model.UnknownNode(mark, "")


def shorthand_key(kind: type[ControlNode] | type[DeclaredSection]) -> Key | None:
    """Return the key whose value may stand directly under the keyword of a node or section, or None."""
    return next((key for key in kind.keys.values() if key.is_shorthand), None)


def inner_keys(kind: type[ControlNode] | type[DeclaredSection]) -> Mapping[str, Key]:
    """Return the keys of the mapping under the keyword; none if no mapping may stand there."""
    inner = {name: key for name, key in kind.keys.items() if not key.is_sibling}
    return {} if all(key.is_shorthand for key in inner.values()) else inner


@dataclass(frozen=True)
class Head:
    """A control node in the file: its mapping, its word with its place, its label and its value."""

    node: yaml.Mapping
    keyword: str
    mark: Mark
    label: str
    value: yaml.Node


def read_control(parser: NodeParser, head: Head, kind: type[ControlNode]) -> model.Node:
    """Return a control node with the values of its keys, or an unknown node."""
    reader = _Reader(parser)
    values = reader.read_inner(head.keyword, head.mark, head.value, kind)
    beside = {name: key for name, key in kind.keys.items() if key.is_sibling}
    for name, key in beside.items():
        if (value := head.node.get(name)) is not None:
            fields = Fields(head.keyword, head.mark, head.node, head.node.keys, parser.findings)
            reader.read(fields, key, value, value.mark, values)
    if reader.has_valid_constants and kind.any_of and not any(_is_given(head, name) for name in kind.any_of):
        where = " beside it" if set(kind.any_of) <= set(beside) else ""
        listed = " or ".join(f'"{name}"' for name in kind.any_of)
        parser.refuse(head.mark, "missing-key", f"{head.keyword} needs {listed}{where}")
    missing = [key.kind for name, key in kind.keys.items() if key.is_required and name not in values]
    if Kind.NODES in missing:
        return unread(head.mark)
    if Kind.VARIABLE in missing or Kind.ELEMENTS in missing:
        children = [node for part in values.values() for node in model.nodes_of(part)]
        return model.UnknownNode(head.mark, head.label, tuple(children))
    return model.InnerNode(head.mark, head.label, kind, values)


def _is_given(head: Head, name: str) -> bool:
    inner = head.value.get(name) if isinstance(head.value, yaml.Mapping) else None
    return inner is not None or head.node.get(name) is not None


class _Reader:
    """Reads the keys of one control node.

    Attributes:
        has_valid_constants: False if the value of the node is no mapping where it must be one.
    """

    def __init__(self, parser: NodeParser) -> None:
        self.parser = parser
        self.has_valid_constants = True

    def read_inner(
        self, owner: str, mark: Mark, value: yaml.Node, kind: type[ControlNode] | type[DeclaredSection]
    ) -> dict[str, Part]:
        """Return the values of the keys under the keyword of a node or section."""
        values: dict[str, Part] = {}
        bare, inner = shorthand_key(kind), inner_keys(kind)
        is_short = (
            isinstance(value, yaml.YamlSequence) if bare and bare.kind is Kind.NODES else bare is not None
        )
        if bare is not None and (not inner or (is_short and not isinstance(value, yaml.Mapping))):
            root = yaml.Mapping(mark, (yaml.Entry(yaml.Scalar(mark, owner, bare.name), value),))
            fields = Fields(owner, mark, root, [bare.name], self.parser.findings)
            self.read(fields, bare, value, mark, values)
            return values
        fields = Fields(owner, mark, value, inner, self.parser.findings)
        self.has_valid_constants = self.has_valid_constants and fields.sound
        for name, key in inner.items():
            found = fields.required(name) if key.is_required else fields.get(name)
            if found is not None:
                self.read(fields, key, found, fields.key_mark(name), values)
            elif key.kind is Kind.NODE and key.is_required:
                values[name] = unread(mark)
        return values

    def read(self, fields: Fields, key: Key, value: yaml.Node, mark: Mark, values: dict[str, Part]) -> None:
        """Read the value of a key into `values`; `mark` is the place of a node that is missing there."""
        part = self._part(fields, key, value, mark)
        if part is not None:
            values[key.name] = part

    def _part(self, fields: Fields, key: Key, value: yaml.Node, mark: Mark) -> Part | None:
        match key.kind:
            case Kind.NODE:
                is_empty = isinstance(value, yaml.Scalar) and value.value is None
                return (
                    None
                    if is_empty and key.is_shorthand and not key.is_required
                    else self.parser.node(value, mark)
                )
            case Kind.NODES:
                return self._nodes(fields, key, value)
            case Kind.REASONS:
                return fields.matches(key.name)
            case Kind.VARIABLE:
                return self._variable(fields, key.name)
            case Kind.SECTION:
                return self._section(key, value, mark)
            case Kind.SECTIONS:
                return tuple(self._sections(key, value))
        return value_of(value, self.parser.findings)

    def _nodes(self, fields: Fields, key: Key, value: yaml.Node) -> tuple[model.Node, ...] | None:
        found = self.parser.nodes(value, fields.owner)
        if key.max_count is not None and len(found) > key.max_count:
            message = f"a {fields.owner} has at most {key.max_count} branches, not {len(found)}"
            self.parser.refuse(fields.mark, "too-large", message)
            return None
        return found or None

    def _variable(self, fields: Fields, name: str) -> Named | None:
        variable = Named(fields.text(name), fields.value_mark(name))
        if NAME.fullmatch(variable.name):
            return variable
        hint = f"Write the bare name, for instance {name}: target; its value is $target."
        self.parser.refuse(variable.mark, "bad-name", f'"{variable.name}" cannot name a variable', hint)
        bare = variable.name.removeprefix("$")
        return Named(bare, variable.mark) if NAME.fullmatch(bare) else None

    def _section(self, key: Key, value: yaml.Node, mark: Mark) -> model.SectionNode | None:
        values = self.read_inner(key.name, mark, value, key.section)
        required = (one for one in key.section.keys.values() if one.is_required and one.kind is Kind.CONSTANT)
        return (
            None
            if any(one.name not in values for one in required)
            else model.SectionNode(key.section, mark, values)
        )

    def _sections(self, key: Key, value: yaml.Node) -> Iterable[model.SectionNode]:
        """Yield the sections of a list, or the only one."""
        needed = " and ".join(f'"{name}"' for name in key.section.keys)
        if not isinstance(value, yaml.YamlSequence | yaml.Mapping):
            message = f"{key.name} takes {needed}, or a list of them, not {describe(yaml.plain(value))}"
            self.parser.refuse(value.mark, "wrong-type", message)
            return
        if isinstance(value, yaml.YamlSequence) and not value.items:
            self.parser.refuse(value.mark, "empty-list", f"{key.name} needs at least one {needed}")
        for item in value.items if isinstance(value, yaml.YamlSequence) else (value,):
            if (section := self._section(key, item, item.mark)) is not None:
                yield section
