"""Parsers of mission and library files from YAML nodes."""

from __future__ import annotations

import re
from collections.abc import Iterable
from collections.abc import Mapping as Mapped
from dataclasses import replace

from executive.mission.findings import Finding, error
from executive.mission.model import grammar
from executive.mission.model.mission import Argument, Library, Mission, Route, Subtree
from executive.mission.model.values import Named
from executive.mission.parse.fields import NAME, Fields, value_of
from executive.mission.parse.nodes import NodeParser, Skills
from executive.mission.parse.params import parse_params
from executive.mission.source import Mark
from executive.mission.text.yaml_text import Mapping, Node, Scalar, YamlSequence, plain
from executive.mission.words import describe
from executive.tree.registry import ControlNodes

_MISSION_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")


def parse_mission(
    root: Node, overrides: Mapped[str, str], skills: Skills, control: ControlNodes
) -> tuple[Mission, list[Finding]]:
    """Return the readable content of a mission file, and the findings."""
    findings: list[Finding] = []
    start = replace(root.mark, length=1)
    fields = Fields("the mission", start, root, grammar.MISSION, findings)
    for key in ("mission", "cell", "tree"):
        fields.require(key)
    parser = NodeParser(findings, skills, control)
    tree = fields.get("tree")
    mission = Mission(
        name=_read_name(fields),
        description=fields.text("description"),
        cell=_read_cell(fields),
        libraries=_read_names(
            fields.items("library"), "library takes the path of a file or a list of them", findings
        ),
        params=parse_params(fields, overrides),
        routes=_read_routes(fields),
        tree=None if tree is None else parser.node(tree, fields.key_mark("tree")),
        trees=_read_trees(fields, parser),
    )
    return mission, findings


def _read_name(fields: Fields) -> str:
    name = fields.text("mission")
    if isinstance(fields.get("mission"), Scalar) and not _MISSION_NAME.fullmatch(name):
        message = f'a mission is named by letters, digits, "_" and "-", at most 64, not "{name}"'
        fields.findings.append(error(fields.value_mark("mission"), "bad-name", message))
    return name


def _read_cell(fields: Fields) -> Named:
    cell = Named(fields.text("cell"), fields.value_mark("cell"))
    if isinstance(fields.get("cell"), Scalar) and not cell.name:
        fields.findings.append(error(cell.mark, "bad-name", "cell names no file"))
    return cell


def _read_routes(fields: Fields) -> tuple[Route, ...]:
    routes: list[Route] = []

    def read(label: str, mark: Mark, node: Node) -> None:
        items = node.items if isinstance(node, YamlSequence) else (node,)
        if not items:
            fields.findings.append(error(node.mark, "empty-list", "a route needs at least one bin"))
        bins = _read_names(items, "a route names a bin or a list of bins", fields.findings)
        routes.append(Route(label, mark, bins))

    fields.mapping("routes", read)
    return tuple(routes)


def _read_names(items: Iterable[Node], takes: str, findings: list[Finding]) -> tuple[Named, ...]:
    """Return the texts of a list; for other items, add a finding that starts with `takes`."""
    named = []
    for item in items:
        if isinstance(item, Scalar) and isinstance(item.value, str):
            named.append(Named(item.text, item.mark))
        else:
            findings.append(error(item.mark, "wrong-type", f"{takes}, not {describe(plain(item))}"))
    return tuple(named)


def parse_library(root: Node, skills: Skills, control: ControlNodes) -> tuple[Library, list[Finding]]:
    """Return the readable content of a library file, and the findings."""
    findings: list[Finding] = []
    start = replace(root.mark, length=1)
    fields = Fields("the library", start, root, grammar.LIBRARY, findings)
    for key in ("library", "trees"):
        fields.require(key)
    name = fields.text("library")
    return Library(
        name, _read_trees(fields, NodeParser(findings, skills, control), name or "library")
    ), findings


def _read_trees(fields: Fields, parser: NodeParser, library: str = "") -> dict[str, Subtree]:
    """Return the subtrees under the key `trees`; `library` is the name of their library."""
    trees: dict[str, Subtree] = {}

    def read(name: str, mark: Mark, node: Node) -> None:
        if not NAME.fullmatch(name):
            parser.refuse(mark, "bad-name", f'a subtree is named by letters, digits and "_", not "{name}"')
        if isinstance(node, Mapping) and set(grammar.SUBTREE) & set(node.keys):
            whole = node.get("do") is not None
            if not whole:
                parser.refuse(mark, "missing-key", f'the subtree "{name}" needs the key "do"')
            trees[name] = _read_subtree(
                name, mark, node, parser if whole else parser.make_silent_parser(), library
            )
        else:
            trees[name] = Subtree(name, mark, "", {}, None, parser.node(node, mark), library)

    fields.mapping("trees", read)
    return trees


def _read_subtree(name: str, mark: Mark, node: Mapping, parser: NodeParser, library: str) -> Subtree:
    fields = Fields(f'the subtree "{name}"', mark, node, grammar.SUBTREE, parser.findings)
    args: dict[str, Argument] = {}

    def read(argument: str, where: Mark, value: Node) -> None:
        if not NAME.fullmatch(argument):
            hint = "Write the bare name; inside, its value is $name."
            parser.refuse(where, "bad-name", f'"{argument}" cannot name an argument', hint)
            argument = argument.removeprefix("$")
        if argument in args:
            first = args[argument].mark.line
            message = f'the argument "{argument}" stands here twice; the first is in line {first}'
            parser.refuse(where, "duplicate-key", message)
        required = isinstance(value, Scalar) and value.value is None
        args[argument] = Argument(where, None if required else value_of(value, parser.findings))

    if isinstance(fields.get("args"), YamlSequence):
        for item in fields.items("args"):
            if isinstance(item, Scalar):
                read(item.text, item.mark, Scalar(item.mark, None, ""))
            else:
                parser.refuse(
                    item.mark, "wrong-type", "an argument in a list is a name; for a default write a mapping"
                )
    else:
        fields.mapping("args", read)
    body = parser.node(fields.get("do"), fields.key_mark("do"))
    return Subtree(name, mark, fields.text("doc"), args, _read_returns(fields, parser), body, library)


def _read_returns(fields: Fields, parser: NodeParser) -> dict[str, Mark] | None:
    """Return the names under `returns` with their places, or None where the key is missing."""
    if fields.get("returns") is None:
        return None
    names: dict[str, Mark] = {}
    for item in fields.items("returns"):
        written = item.text.removeprefix("$") if isinstance(item, Scalar) else ""
        if NAME.fullmatch(written):
            names[written] = item.mark
        else:
            parser.refuse(item.mark, "bad-name", "returns takes the names of variables, as [targets]")
    return names
