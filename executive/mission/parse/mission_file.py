"""Parsers of mission and library files from YAML nodes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace

from executive.mission.findings import Finding, make_error
from executive.mission.model import grammar
from executive.mission.model.mission import Argument, Library, Mission, Route, Subtree
from executive.mission.model.values import LocatedName
from executive.mission.parse.fields import NAME_PATTERN, Fields, read_value
from executive.mission.parse.node_parser import NodeParser, Skills
from executive.mission.parse.params import parse_params
from executive.mission.source import Mark
from executive.mission.text.yaml_text import YamlMapping, YamlNode, YamlScalar, YamlSequence, describe_node
from executive.tree.node_registry import ControlNodes

_MISSION_NAME_PATTERN = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")


def parse_mission(
    root: YamlNode, overrides: Mapping[str, str], skills: Skills, node_classes: ControlNodes
) -> tuple[Mission, list[Finding]]:
    """Return the content of a mission file, without unreadable parts, and the findings."""
    findings: list[Finding] = []
    start = replace(root.mark, length=1)
    fields = Fields("the mission", start, root, grammar.MISSION_KEYS, findings)
    for key in ("mission", "cell", "tree"):
        fields.require(key)
    parser = NodeParser(findings, skills, node_classes)
    tree = fields.get("tree")
    mission = Mission(
        name=_read_name(fields),
        description=fields.read_text("description"),
        cell=_read_cell(fields),
        libraries=_read_names(
            fields.list_items("library"), "library must be the path of a file or a list of paths", findings
        ),
        params=parse_params(fields, overrides),
        routes=_read_routes(fields),
        tree=None if tree is None else parser.read_node(tree, fields.get_key_mark("tree")),
        trees=_read_trees(fields, parser),
    )
    return mission, findings


def _read_name(fields: Fields) -> str:
    name = fields.read_text("mission")
    if isinstance(fields.get("mission"), YamlScalar) and not _MISSION_NAME_PATTERN.fullmatch(name):
        message = f'"{name}" is no valid name of a mission'
        hint = 'Use at most 64 letters, digits, "_" and "-", and begin with a letter.'
        fields.findings.append(make_error(fields.get_value_mark("mission"), "bad-name", message, hint))
    return name


def _read_cell(fields: Fields) -> LocatedName:
    cell = LocatedName(fields.read_text("cell"), fields.get_value_mark("cell"))
    if isinstance(fields.get("cell"), YamlScalar) and not cell.name:
        fields.findings.append(make_error(cell.mark, "bad-name", "cell must be the path of a cell file"))
    return cell


def _read_routes(fields: Fields) -> tuple[Route, ...]:
    routes: list[Route] = []

    def read_route(label: str, mark: Mark, node: YamlNode) -> None:
        items = node.items if isinstance(node, YamlSequence) else (node,)
        if not items:
            fields.findings.append(make_error(node.mark, "empty-list", "a route needs at least one bin"))
        bins = _read_names(items, "a route must be a bin or a list of bins", fields.findings)
        routes.append(Route(label, mark, bins))

    fields.read_entries("routes", read_route)
    return tuple(routes)


def _read_names(items: Iterable[YamlNode], rule: str, findings: list[Finding]) -> tuple[LocatedName, ...]:
    """Return the texts in a list; for each other item, add an error whose message begins with `rule`."""
    names = []
    for item in items:
        if isinstance(item, YamlScalar) and isinstance(item.value, str):
            names.append(LocatedName(item.text, item.mark))
        else:
            findings.append(make_error(item.mark, "wrong-type", f"{rule}, not {describe_node(item)}"))
    return tuple(names)


def parse_library(
    root: YamlNode, skills: Skills, node_classes: ControlNodes
) -> tuple[Library, list[Finding]]:
    """Return the content of a library file, without unreadable parts, and the findings."""
    findings: list[Finding] = []
    start = replace(root.mark, length=1)
    fields = Fields("the library", start, root, grammar.LIBRARY_KEYS, findings)
    for key in ("library", "trees"):
        fields.require(key)
    name = fields.read_text("library")
    parser = NodeParser(findings, skills, node_classes)
    return Library(name, _read_trees(fields, parser, name or "library")), findings


def _read_trees(fields: Fields, parser: NodeParser, library: str = "") -> dict[str, Subtree]:
    """Return the subtrees below `trees`; `library` is the name of their library, "" for the mission file."""
    trees: dict[str, Subtree] = {}

    def read_tree(name: str, mark: Mark, node: YamlNode) -> None:
        if not NAME_PATTERN.fullmatch(name):
            message = f'"{name}" is no valid name of a subtree'
            hint = 'Use letters, digits and "_", and begin with no digit.'
            parser.add_error(mark, "bad-name", message, hint)
        if isinstance(node, YamlMapping) and set(grammar.SUBTREE_KEYS) & set(node.keys):
            has_body = node.get("do") is not None
            if not has_body:
                parser.add_error(mark, "missing-key", f'the subtree "{name}" needs the key "do"')
            subtree_parser = parser if has_body else parser.make_silent_parser()
            trees[name] = _read_subtree(name, mark, node, subtree_parser, library)
        else:
            trees[name] = Subtree(name, mark, "", {}, None, parser.read_node(node, mark), library)

    fields.read_entries("trees", read_tree)
    return trees


def _read_subtree(name: str, mark: Mark, node: YamlMapping, parser: NodeParser, library: str) -> Subtree:
    fields = Fields(f'the subtree "{name}"', mark, node, grammar.SUBTREE_KEYS, parser.findings)
    args: dict[str, Argument] = {}

    def read_argument(argument: str, argument_mark: Mark, value: YamlNode) -> None:
        if not NAME_PATTERN.fullmatch(argument):
            hint = "Write the name without $; in the subtree, $name is the value."
            message = f'"{argument}" is no valid name of an argument'
            parser.add_error(argument_mark, "bad-name", message, hint)
            argument = argument.removeprefix("$")
        if argument in args:
            first_line = args[argument].mark.line
            message = f'the argument "{argument}" occurs twice; the first is in line {first_line}'
            parser.add_error(argument_mark, "duplicate-key", message)
        is_required = isinstance(value, YamlScalar) and value.value is None
        default = None if is_required else read_value(value, parser.findings)
        args[argument] = Argument(argument_mark, default)

    if isinstance(fields.get("args"), YamlSequence):
        for item in fields.list_items("args"):
            if isinstance(item, YamlScalar):
                read_argument(item.text, item.mark, YamlScalar(item.mark, None, ""))
            else:
                message = "a list of arguments contains names only; for defaults, write a mapping"
                parser.add_error(item.mark, "wrong-type", message)
    else:
        fields.read_entries("args", read_argument)
    body = parser.read_node(fields.get("do"), fields.get_key_mark("do"))
    return Subtree(name, mark, fields.read_text("doc"), args, _read_returns(fields, parser), body, library)


def _read_returns(fields: Fields, parser: NodeParser) -> dict[str, Mark] | None:
    """Return the names below `returns` with their positions, or None if the key is missing."""
    if fields.get("returns") is None:
        return None
    names: dict[str, Mark] = {}
    for item in fields.list_items("returns"):
        name = item.text.removeprefix("$") if isinstance(item, YamlScalar) else ""
        if NAME_PATTERN.fullmatch(name):
            names[name] = item.mark
        else:
            message = "returns must be a list of names of variables, for example [targets]"
            parser.add_error(item.mark, "bad-name", message)
    return names
