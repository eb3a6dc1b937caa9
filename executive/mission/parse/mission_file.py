"""Parsers of mission and library files from YAML nodes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from executive.mission.model import grammar
from executive.mission.model.mission import Argument, Mission, Quota, Route, Subtree
from executive.mission.model.values import LocatedName
from executive.mission.parse.mapping_reader import NAME_PATTERN, MappingReader, is_empty, read_value
from executive.mission.parse.node_parser import NodeParser
from executive.mission.parse.params import parse_params
from executive.mission.source import Span
from executive.mission.text.yaml_text import YamlMapping, YamlNode, YamlScalar, YamlSequence

_MISSION_NAME_PATTERN = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")
"""Matches the names of missions; the names of run directories contain the name of the mission."""


def parse_mission(root: YamlNode, overrides: Mapping[str, str], parser: NodeParser) -> Mission:
    """Return the valid content of a mission file; add errors to the findings of `parser`."""
    span = replace(root.span, length=1)
    reader = MappingReader("the mission", span, root, grammar.MISSION_KEYS, parser.findings)
    tree = reader.get("tree")
    return Mission(
        name=_read_name(reader),
        description=reader.read_text("description"),
        cell=_read_cell(reader),
        libraries=_read_names(
            reader, reader.list_items("library"), "library must be the path of a file or a list of paths"
        ),
        params=parse_params(reader, overrides),
        routes=_read_routes(reader),
        quotas=tuple(_read_quotas(reader)),
        tree=None if tree is None else parser.read_node(tree, reader.get_key_span("tree")),
        subtrees=_read_subtrees(reader, parser),
    )


def _read_name(reader: MappingReader) -> str:
    name = reader.read_text("mission")
    if isinstance(reader.get("mission"), YamlScalar) and not _MISSION_NAME_PATTERN.fullmatch(name):
        message = f'"{name}" is no valid name of a mission'
        hint = 'Use at most 64 letters, digits, "_" and "-", and begin with a letter.'
        reader.add_error(reader.get_value_span("mission"), "bad-name", message, hint)
    return name


def _read_cell(reader: MappingReader) -> LocatedName:
    cell = LocatedName(reader.read_text("cell"), reader.get_value_span("cell"))
    if isinstance(reader.get("cell"), YamlScalar) and not cell.name:
        reader.add_error(cell.span, "bad-name", "cell must be the path of a cell file")
    return cell


def _read_routes(reader: MappingReader) -> tuple[Route, ...]:
    routes = []
    for label, span, node in reader.iterate_entries("routes"):
        items = node.items if isinstance(node, YamlSequence) else (node,)
        if not items:
            reader.add_error(node.span, "empty-list", "a route needs at least one bin")
        bins = _read_names(reader, items, "a route must be a bin or a list of bins")
        routes.append(Route(label, span, bins))
    return tuple(routes)


def _read_quotas(reader: MappingReader) -> Iterator[Quota]:
    """Yield the quotas below `quotas`: a limit for each bin, or a mapping of classes to limits."""
    for bin_name, span, node in reader.iterate_entries("quotas"):
        bin = LocatedName(bin_name, span)
        limits: list[tuple[LocatedName | None, YamlNode]] = [(None, node)]
        if isinstance(node, YamlMapping):
            limits = [(LocatedName(entry.key.text, entry.key.span), entry.value) for entry in node.entries]
            if not limits:
                reader.add_error(node.span, "empty-list", f"the quota of {bin_name} names no class")
        for label, value in limits:
            yield Quota(bin, label, read_value(value, reader.findings))


def _read_names(reader: MappingReader, items: Iterable[YamlNode], rule: str) -> tuple[LocatedName, ...]:
    """Return the texts in a list; for each item of another type, add an error that begins with `rule`."""
    names = []
    for item in items:
        if isinstance(item, YamlScalar) and isinstance(item.value, str):
            names.append(LocatedName(item.text, item.span))
        else:
            reader.add_error(item.span, "wrong-type", f"{rule}, not {item.description}")
    return tuple(names)


def parse_library(root: YamlNode, parser: NodeParser) -> dict[str, Subtree]:
    """Return the valid subtrees of a library file by name; add errors to the findings of `parser`."""
    span = replace(root.span, length=1)
    reader = MappingReader("the library", span, root, grammar.LIBRARY_KEYS, parser.findings)
    return _read_subtrees(reader, parser, reader.read_text("library") or "library")


def _read_subtrees(reader: MappingReader, parser: NodeParser, library: str = "") -> dict[str, Subtree]:
    """Return the subtrees below `trees`; `library` is the name of their library, "" for the mission file."""
    subtrees: dict[str, Subtree] = {}
    for name, span, node in reader.iterate_entries("trees"):
        reader.check_name(name, span, "a subtree")
        if isinstance(node, YamlMapping) and set(grammar.SUBTREE_KEYS) & set(node.keys):
            has_body = node.get("do") is not None
            if not has_body:
                parser.add_error(span, "missing-key", f'the subtree "{name}" needs the key "do"')
            subtree_parser = parser if has_body else parser.make_silent_parser()
            subtrees[name] = _parse_subtree(name, span, node, subtree_parser, library)
        else:
            subtrees[name] = Subtree(name, span, "", {}, None, parser.read_node(node, span), library)
    return subtrees


def _parse_subtree(name: str, span: Span, node: YamlMapping, parser: NodeParser, library: str) -> Subtree:
    """Return the subtree of a mapping with subtree keys; `span` is the position of the name."""
    reader = MappingReader(f'the subtree "{name}"', span, node, grammar.SUBTREE_KEYS, parser.findings)
    return Subtree(
        name,
        span,
        doc=reader.read_text("doc"),
        arguments=_read_arguments(reader),
        returns=_read_returns(reader),
        body=parser.read_node(reader.get("do"), reader.get_key_span("do")),
        library=library,
    )


def _read_arguments(reader: MappingReader) -> dict[str, Argument]:
    """Return the arguments below `args`, which is a list of names, or a mapping of names to defaults."""
    arguments: dict[str, Argument] = {}
    hint = "Write the name without $; in the subtree, $name is the value."
    for argument_name, span, value in _iterate_arguments(reader):
        reader.check_name(argument_name, span, "an argument", hint)
        name = argument_name.removeprefix("$")
        if name in arguments:
            first_line = arguments[name].span.line
            message = f'the argument "{name}" occurs twice; the first is in line {first_line}'
            reader.add_error(span, "duplicate-key", message)
        arguments[name] = Argument(span, None if is_empty(value) else read_value(value, reader.findings))
    return arguments


def _iterate_arguments(reader: MappingReader) -> Iterator[tuple[str, Span, YamlNode]]:
    """Yield name, position of the name, and default of each argument; without a default, an empty scalar."""
    if not isinstance(reader.get("args"), YamlSequence):
        yield from reader.iterate_entries("args")
        return
    for item in reader.list_items("args"):
        if isinstance(item, YamlScalar):
            yield item.text, item.span, YamlScalar(item.span, None, "")
        else:
            message = "a list of arguments contains names only; for defaults, write a mapping"
            reader.add_error(item.span, "wrong-type", message)


def _read_returns(reader: MappingReader) -> dict[str, Span] | None:
    """Return the names below `returns` with their positions, or None if the key is missing."""
    if reader.get("returns") is None:
        return None
    spans: dict[str, Span] = {}
    for item in reader.list_items("returns"):
        name = item.text.removeprefix("$") if isinstance(item, YamlScalar) else ""
        if NAME_PATTERN.fullmatch(name):
            spans[name] = item.span
        else:
            message = "returns must be a list of names of variables, for example [targets]"
            reader.add_error(item.span, "bad-name", message)
    return spans
