"""Parser of control nodes by the keys that their classes declare."""

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


def make_unknown_node(mark: Mark) -> model.Node:
    """Return a placeholder for a node that cannot be read; a finding states the reason."""
    return model.UnknownNode(mark, "")


def find_shorthand_key(kind: type[ControlNode] | type[DeclaredSection]) -> Key | None:
    """Return the key whose value may stand directly under the keyword of a node or section, or None."""
    return next((key for key in kind.keys.values() if key.is_shorthand), None)


def find_inner_keys(kind: type[ControlNode] | type[DeclaredSection]) -> Mapping[str, Key]:
    """Return the keys of the mapping under the keyword; none if no mapping may stand there."""
    inner = {name: key for name, key in kind.keys.items() if not key.is_sibling}
    return {} if all(key.is_shorthand for key in inner.values()) else inner


@dataclass(frozen=True)
class Head:
    """A control node in the file: its mapping, its keyword with place, its label and its value."""

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
        return make_unknown_node(head.mark)
    if Kind.VARIABLE in missing or Kind.ELEMENTS in missing:
        children = [node for part in values.values() for node in model.nodes_of(part)]
        return model.UnknownNode(head.mark, head.label, tuple(children))
    return model.InnerNode(head.mark, head.label, kind, values)


def _is_given(head: Head, name: str) -> bool:
    """Return True if a key stands under the keyword or beside the keyword."""
    return any(isinstance(node, yaml.Mapping) and name in node.keys for node in (head.value, head.node))


class _Reader:
    """Reads the keys of one control node.

    Attributes:
        has_valid_constants: False if the value of the node must be a mapping and is not a mapping.
    """

    def __init__(self, parser: NodeParser) -> None:
        self.parser = parser
        self.has_valid_constants = True

    def read_inner(
        self, owner: str, mark: Mark, value: yaml.Node, kind: type[ControlNode] | type[DeclaredSection]
    ) -> dict[str, Part]:
        """Return the values of the keys under the keyword of a node or section."""
        values: dict[str, Part] = {}
        bare, inner = find_shorthand_key(kind), find_inner_keys(kind)
        is_short = (
            isinstance(value, yaml.YamlSequence) if bare and bare.kind is Kind.NODES else bare is not None
        )
        if bare is not None and (not inner or (is_short and not isinstance(value, yaml.Mapping))):
            root = yaml.Mapping(mark, (yaml.Entry(yaml.Scalar(mark, owner, bare.name), value),))
            fields = Fields(owner, mark, root, [bare.name], self.parser.findings)
            self.read(fields, bare, value, mark, values)
            return values
        fields = Fields(owner, mark, value, inner, self.parser.findings)
        self.has_valid_constants = self.has_valid_constants and fields.is_mapping
        for name, key in inner.items():
            found = fields.require(name) if key.is_required else fields.get(name)
            if found is not None:
                self.read(fields, key, found, fields.key_mark(name), values)
            elif key.kind is Kind.NODE and key.is_required:
                values[name] = make_unknown_node(mark)
        return values

    def read(self, fields: Fields, key: Key, value: yaml.Node, mark: Mark, values: dict[str, Part]) -> None:
        """Read the value of a key into `values`; `mark` is the place of a missing node."""
        part = self._read_part(fields, key, value, mark)
        if part is not None:
            values[key.name] = part

    def _read_part(self, fields: Fields, key: Key, value: yaml.Node, mark: Mark) -> Part | None:
        match key.kind:
            case Kind.NODE:
                is_empty = isinstance(value, yaml.Scalar) and value.value is None
                return (
                    None
                    if is_empty and key.is_shorthand and not key.is_required
                    else self.parser.node(value, mark)
                )
            case Kind.NODES:
                return self._read_nodes(fields, key, value)
            case Kind.REASONS:
                return fields.failure_names(key.name)
            case Kind.VARIABLE:
                return self._read_variable(fields, key.name)
            case Kind.SECTION:
                return self._read_section(key, value, mark)
            case Kind.SECTIONS:
                return tuple(self._read_sections(key, value))
        return value_of(value, self.parser.findings)

    def _read_nodes(self, fields: Fields, key: Key, value: yaml.Node) -> tuple[model.Node, ...] | None:
        found = self.parser.nodes(value, fields.owner)
        if key.max_count is not None and len(found) > key.max_count:
            message = f"a {fields.owner} has at most {key.max_count} branches, not {len(found)}"
            self.parser.refuse(fields.mark, "too-large", message)
            return None
        return found or None

    def _read_variable(self, fields: Fields, name: str) -> Named | None:
        variable = Named(fields.text(name), fields.value_mark(name))
        if NAME.fullmatch(variable.name):
            return variable
        hint = f"Write the bare name, for instance {name}: target; its value is $target."
        self.parser.refuse(variable.mark, "bad-name", f'"{variable.name}" cannot name a variable', hint)
        bare = variable.name.removeprefix("$")
        return Named(bare, variable.mark) if NAME.fullmatch(bare) else None

    def _read_section(self, key: Key, value: yaml.Node, mark: Mark) -> model.SectionNode | None:
        values = self.read_inner(key.name, mark, value, key.section)
        constants = [k.name for k in key.section.keys.values() if k.is_required and k.kind is Kind.CONSTANT]
        return model.SectionNode(key.section, mark, values) if values.keys() >= set(constants) else None

    def _read_sections(self, key: Key, value: yaml.Node) -> Iterable[model.SectionNode]:
        """Yield the sections of a list, or a single section."""
        needed = " and ".join(f'"{name}"' for name in key.section.keys)
        if not isinstance(value, yaml.YamlSequence | yaml.Mapping):
            message = f"{key.name} takes {needed}, or a list of them, not {describe(yaml.plain(value))}"
            self.parser.refuse(value.mark, "wrong-type", message)
            return
        if isinstance(value, yaml.YamlSequence) and not value.items:
            self.parser.refuse(value.mark, "empty-list", f"{key.name} needs at least one {needed}")
        for item in value.items if isinstance(value, yaml.YamlSequence) else (value,):
            if (section := self._read_section(key, item, item.mark)) is not None:
                yield section
