"""Parser of control nodes: the class of a control node declares its keys."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from executive.mission.model import grammar
from executive.mission.model.nodes import InnerNode, InvalidNode, KeyValue, Node, NodeSection, list_nodes
from executive.mission.model.values import InvalidValue, LocatedName
from executive.mission.parse.mapping_reader import NAME_PATTERN, MappingReader, is_empty, read_value
from executive.mission.source import Span
from executive.mission.text.yaml_text import YamlEntry, YamlMapping, YamlNode, YamlScalar, YamlSequence
from executive.tree.keys import Key, KeyKind, KeyOwner
from executive.tree.node import ControlNode

if TYPE_CHECKING:
    from executive.mission.parse.node_parser import NodeParser


def read_control_node(
    parser: NodeParser, mapping: YamlMapping, entry: YamlEntry, label: str, node_class: type[ControlNode]
) -> Node:
    """Return the control node of a mapping, or an invalid node if the children or a variable are invalid.

    `entry` is the entry of the mapping with the keyword; the other entries have sibling keys.
    """
    keyword, span, sibling_keys = entry.key.text, entry.key.span, grammar.find_sibling_keys(node_class)
    siblings = tuple(sibling for sibling in mapping.entries if sibling.key.text in sibling_keys)
    values = {
        **_read_inner_keys(parser, keyword, span, entry.value, node_class),
        **_read_keys(parser, keyword, span, replace(mapping, entries=siblings), sibling_keys),
    }
    any_of = node_class.any_of
    inner_keys = entry.value.keys if isinstance(entry.value, YamlMapping) else ()
    # `MappingReader` reports a value that is not a mapping although it must be one.
    is_form_valid = isinstance(entry.value, YamlMapping) or grammar.find_shorthand_key(node_class) is not None
    if any_of and is_form_valid and not {*mapping.keys, *inner_keys} & {*any_of}:
        level = f" at the level of {keyword}" if set(any_of) <= set(sibling_keys) else ""
        alternatives = " or ".join(f'"{name}"' for name in any_of)
        parser.add_error(span, "missing-key", f"{keyword} needs {alternatives}{level}")
    missing = {key.kind for name, key in node_class.keys.items() if key.is_required and name not in values}
    if missing & {KeyKind.NODES, KeyKind.VARIABLE}:
        children = [node for value in values.values() for node in list_nodes(value)]
        return InvalidNode(span, label, tuple(children))
    return InnerNode(span, label, node_class, values)


def _read_inner_keys(
    parser: NodeParser, name: str, span: Span, yaml_node: YamlNode, owner: type[KeyOwner]
) -> dict[str, KeyValue]:
    """Return the values of the keys of `owner`; `yaml_node` is below the keyword `name`."""
    shorthand_key, inner_keys = grammar.find_shorthand_key(owner), grammar.find_inner_keys(owner)
    is_list_required = shorthand_key is not None and shorthand_key.kind is KeyKind.NODES
    # If the owner has inner keys, a mapping contains these keys, and is no node in shorthand form. A scalar
    # in place of a list is treated like a mapping, so that `MappingReader` reports it and lists the keys.
    is_scalar_for_list = is_list_required and isinstance(yaml_node, YamlScalar)
    reads_inner_keys = isinstance(yaml_node, YamlMapping) or is_scalar_for_list
    if shorthand_key is not None and not (reads_inner_keys and inner_keys):
        key_node = YamlScalar(span, name, shorthand_key.name)
        yaml_node = YamlMapping(span, (YamlEntry(key_node, yaml_node),))
        inner_keys = {shorthand_key.name: shorthand_key}
    return _read_keys(parser, name, span, yaml_node, inner_keys)


def _read_keys(
    parser: NodeParser, name: str, span: Span, yaml_node: YamlNode, keys: Mapping[str, Key]
) -> dict[str, KeyValue]:
    """Return the valid values of `keys` in a mapping.

    `InvalidNode` or `InvalidValue` stands for a required node or constant that the mapping lacks.
    """
    reader = MappingReader(name, span, yaml_node, keys, parser.findings)
    values: dict[str, KeyValue] = {}
    for key in keys.values():
        if (value_node := reader.get(key.name)) is not None:
            value = _read_value(parser, reader, key, value_node)
            values |= {} if value is None else {key.name: value}
        elif key.is_required and key.kind is KeyKind.NODE:
            values[key.name] = InvalidNode(span, "")
        elif key.is_required and key.kind in (KeyKind.CONSTANT, KeyKind.ELEMENTS):
            values[key.name] = InvalidValue(span)
    return values


def _read_value(parser: NodeParser, reader: MappingReader, key: Key, yaml_node: YamlNode) -> KeyValue | None:
    """Return the value of a key, or None after an error and for an omitted optional child."""
    span = reader.get_key_span(key.name)
    match key.kind:
        case KeyKind.NODE:
            is_omitted = is_empty(yaml_node) and key.shorthand and not key.is_required
            return None if is_omitted else parser.read_node(yaml_node, span)
        case KeyKind.NODES:
            nodes = parser.read_nodes(yaml_node, reader.owner)
            if key.max_count is None or len(nodes) <= key.max_count:
                return nodes or None
            message = f"{reader.owner} has {len(nodes)} branches, but may have at most {key.max_count}"
            parser.add_error(reader.span, "too-large", message)
            return None
        case KeyKind.REASONS:
            return reader.read_reasons(key.name)
        case KeyKind.REASONS_OR_SECTIONS:
            names = reader.read_reasons(key.name, tuple(key.section.keys))
            mappings = [item for item in reader.list_items(key.name) if isinstance(item, YamlMapping)]
            return *names, *(_read_section(parser, key, item, item.span) for item in mappings)
        case KeyKind.VARIABLE:
            return _read_variable(parser, reader, key.name)
        case KeyKind.SECTION:
            return _read_section(parser, key, yaml_node, span)
        case KeyKind.SECTIONS:
            return tuple(_read_sections(parser, key, yaml_node))
    return read_value(yaml_node, parser.findings)


def _read_variable(parser: NodeParser, reader: MappingReader, key: str) -> LocatedName | None:
    """Return the output variable of a key; for `$name`, add an error and return the variable `name`."""
    variable = LocatedName(reader.read_text(key), reader.get_value_span(key))
    if NAME_PATTERN.fullmatch(variable.name):
        return variable
    hint = f"Write the name without $, for example {key}: target; $target is then the value."
    message = f'"{variable.name}" is no valid name of a variable'
    parser.add_error(variable.span, "bad-name", message, hint)
    name = variable.name.removeprefix("$")
    return LocatedName(name, variable.span) if NAME_PATTERN.fullmatch(name) else None


def _read_section(parser: NodeParser, key: Key, yaml_node: YamlNode, span: Span) -> NodeSection:
    """Return the section below a key."""
    values = _read_inner_keys(parser, key.name, span, yaml_node, key.section)
    if key.section.any_of and isinstance(yaml_node, YamlMapping) and not yaml_node.entries:
        alternatives = " or ".join(f'"{name}"' for name in key.section.any_of)
        parser.add_error(span, "missing-key", f"{key.name} needs {alternatives}")
    return NodeSection(key.section, span, values)


def _read_sections(parser: NodeParser, key: Key, yaml_node: YamlNode) -> Iterable[NodeSection]:
    """Yield the sections of a list, or a single section."""
    kind = "mapping with " + " and ".join(f'"{name}"' for name in key.section.keys)
    if not isinstance(yaml_node, YamlSequence | YamlMapping):
        message = f"{key.name} must be a {kind}, or a list of such mappings, not {yaml_node.description}"
        parser.add_error(yaml_node.span, "wrong-type", message)
        return
    if isinstance(yaml_node, YamlSequence) and not yaml_node.items:
        parser.add_error(yaml_node.span, "empty-list", f"{key.name} needs at least one {kind}")
    for item in yaml_node.items if isinstance(yaml_node, YamlSequence) else (yaml_node,):
        yield _read_section(parser, key, item, item.span)
