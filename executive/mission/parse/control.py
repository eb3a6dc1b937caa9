"""Parser of control nodes by the keys that their classes declare."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from executive.mission.model import nodes as model
from executive.mission.model.nodes import KeyValue
from executive.mission.model.values import LocatedName
from executive.mission.parse.fields import NAME_PATTERN, Fields, read_value
from executive.mission.source import Mark
from executive.mission.text import yaml_text as yaml
from executive.tree.keys import Key, KeyKind
from executive.tree.keys import KeySection as DeclaredSection
from executive.tree.node import ControlNode

if TYPE_CHECKING:
    from executive.mission.parse.node_parser import NodeParser


def make_unknown_node(mark: Mark) -> model.Node:
    """Return a placeholder for a node that cannot be read; the caller adds a finding with the reason."""
    return model.UnknownNode(mark, "")


def find_shorthand_key(owner: type[ControlNode] | type[DeclaredSection]) -> Key | None:
    """Return the key whose value may directly follow the keyword of a node or section, or None."""
    return next((key for key in owner.keys.values() if key.is_shorthand), None)


def find_inner_keys(owner: type[ControlNode] | type[DeclaredSection]) -> Mapping[str, Key]:
    """Return the keys of the mapping below a keyword; no keys if the value must not be a mapping."""
    inner_keys = {name: key for name, key in owner.keys.items() if not key.is_sibling}
    return {} if all(key.is_shorthand for key in inner_keys.values()) else inner_keys


@dataclass(frozen=True)
class ControlEntry:
    """A control node in the YAML tree.

    Attributes:
        node: Mapping that contains the keyword and its sibling keys.
        mark: Position of the keyword.
        label: Value of `as`, or "".
    """

    node: yaml.YamlMapping
    keyword: str
    mark: Mark
    label: str
    value: yaml.YamlNode


def read_control_node(parser: NodeParser, entry: ControlEntry, node_class: type[ControlNode]) -> model.Node:
    """Return the control node of an entry; an unknown node if its children or a variable cannot be read."""
    reader = _KeyReader(parser)
    keyword, mark = entry.keyword, entry.mark
    values = reader.read_inner_keys(keyword, mark, entry.value, node_class)
    siblings = {name: key for name, key in node_class.keys.items() if key.is_sibling}
    for name, key in siblings.items():
        if (value := entry.node.get(name)) is not None:
            fields = Fields(keyword, mark, entry.node, entry.node.keys, parser.findings)
            reader.read_key(fields, key, value, value.mark, values)
    any_of = node_class.any_of
    if reader.is_mapping_valid and any_of and not any(_is_given(entry, name) for name in any_of):
        level = f" at the level of {keyword}" if set(any_of) <= set(siblings) else ""
        listed = " or ".join(f'"{name}"' for name in any_of)
        parser.add_error(mark, "missing-key", f"{keyword} needs {listed}{level}")
    missing = [key.kind for name, key in node_class.keys.items() if key.is_required and name not in values]
    if KeyKind.NODES in missing:
        return make_unknown_node(mark)
    if KeyKind.VARIABLE in missing or KeyKind.ELEMENTS in missing:
        children = [node for value in values.values() for node in model.list_nodes(value)]
        return model.UnknownNode(mark, entry.label, tuple(children))
    return model.InnerNode(mark, entry.label, node_class, values)


def _is_given(entry: ControlEntry, key: str) -> bool:
    """Return True if a key is written below the keyword or at the level of the keyword."""
    mappings = (entry.value, entry.node)
    return any(isinstance(node, yaml.YamlMapping) and key in node.keys for node in mappings)


class _KeyReader:
    """Reader of the keys of one control node.

    Attributes:
        is_mapping_valid: False if the value of the node, or of a section, must be a mapping and is not one.
    """

    def __init__(self, parser: NodeParser) -> None:
        self.parser = parser
        self.is_mapping_valid = True

    def read_inner_keys(
        self, name: str, mark: Mark, value: yaml.YamlNode, owner: type[ControlNode] | type[DeclaredSection]
    ) -> dict[str, KeyValue]:
        """Return the values of the keys of `owner` in `value`, which is the value of the key `name`."""
        values: dict[str, KeyValue] = {}
        shorthand, inner_keys = find_shorthand_key(owner), find_inner_keys(owner)
        is_list_expected = shorthand is not None and shorthand.kind is KeyKind.NODES
        is_short = isinstance(value, yaml.YamlSequence) if is_list_expected else shorthand is not None
        is_mapping = isinstance(value, yaml.YamlMapping)
        if shorthand is not None and (not inner_keys or (is_short and not is_mapping)):
            entry = yaml.YamlEntry(yaml.YamlScalar(mark, name, shorthand.name), value)
            mapping = yaml.YamlMapping(mark, (entry,))
            fields = Fields(name, mark, mapping, [shorthand.name], self.parser.findings)
            self.read_key(fields, shorthand, value, mark, values)
            return values
        fields = Fields(name, mark, value, inner_keys, self.parser.findings)
        self.is_mapping_valid = self.is_mapping_valid and fields.is_mapping
        for key in inner_keys.values():
            given = fields.require(key.name) if key.is_required else fields.get(key.name)
            if given is not None:
                self.read_key(fields, key, given, fields.get_key_mark(key.name), values)
            elif key.kind is KeyKind.NODE and key.is_required:
                values[key.name] = make_unknown_node(mark)
        return values

    def read_key(
        self, fields: Fields, key: Key, node: yaml.YamlNode, mark: Mark, values: dict[str, KeyValue]
    ) -> None:
        """Add the value of a key to `values` if it is valid; `mark` is the position for a missing node."""
        value = self._read_value(fields, key, node, mark)
        if value is not None:
            values[key.name] = value

    def _read_value(self, fields: Fields, key: Key, node: yaml.YamlNode, mark: Mark) -> KeyValue | None:
        match key.kind:
            case KeyKind.NODE:
                is_empty = isinstance(node, yaml.YamlScalar) and node.value is None
                is_omitted = is_empty and key.is_shorthand and not key.is_required
                return None if is_omitted else self.parser.read_node(node, mark)
            case KeyKind.NODES:
                return self._read_nodes(fields, key, node)
            case KeyKind.REASONS:
                return fields.read_failure_names(key.name)
            case KeyKind.VARIABLE:
                return self._read_variable(fields, key.name)
            case KeyKind.SECTION:
                return self._read_section(key, node, mark)
            case KeyKind.SECTIONS:
                return tuple(self._read_sections(key, node))
        return read_value(node, self.parser.findings)

    def _read_nodes(self, fields: Fields, key: Key, value: yaml.YamlNode) -> tuple[model.Node, ...] | None:
        nodes = self.parser.read_nodes(value, fields.owner)
        if key.max_count is not None and len(nodes) > key.max_count:
            message = f"{fields.owner} has {len(nodes)} branches, but may have at most {key.max_count}"
            self.parser.add_error(fields.mark, "too-large", message)
            return None
        return nodes or None

    def _read_variable(self, fields: Fields, key: str) -> LocatedName | None:
        variable = LocatedName(fields.read_text(key), fields.get_value_mark(key))
        if NAME_PATTERN.fullmatch(variable.name):
            return variable
        hint = f"Write the name without $, for example {key}: target; $target is then the value."
        message = f'"{variable.name}" is no valid name of a variable'
        self.parser.add_error(variable.mark, "bad-name", message, hint)
        name = variable.name.removeprefix("$")
        return LocatedName(name, variable.mark) if NAME_PATTERN.fullmatch(name) else None

    def _read_section(self, key: Key, value: yaml.YamlNode, mark: Mark) -> model.SectionNode | None:
        """Return the section below a key, or None if it lacks a required constant."""
        values = self.read_inner_keys(key.name, mark, value, key.section)
        required_keys = [inner for inner in key.section.keys.values() if inner.is_required]
        has_constants = all(inner.name in values for inner in required_keys if inner.kind is KeyKind.CONSTANT)
        return model.SectionNode(key.section, mark, values) if has_constants else None

    def _read_sections(self, key: Key, value: yaml.YamlNode) -> Iterable[model.SectionNode]:
        """Yield the sections of a list, or a single section."""
        expected = "mapping with " + " and ".join(f'"{name}"' for name in key.section.keys)
        if not isinstance(value, yaml.YamlSequence | yaml.YamlMapping):
            message = f"{key.name} must be a {expected}, or a list of those, not {yaml.describe_node(value)}"
            self.parser.add_error(value.mark, "wrong-type", message)
            return
        if isinstance(value, yaml.YamlSequence) and not value.items:
            self.parser.add_error(value.mark, "empty-list", f"{key.name} needs at least one {expected}")
        for item in value.items if isinstance(value, yaml.YamlSequence) else (value,):
            if (section := self._read_section(key, item, item.mark)) is not None:
                yield section
