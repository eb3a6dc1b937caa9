"""From the positioned nodes of a mission file to the typed mission."""

from __future__ import annotations

import re
from collections.abc import Mapping as Mapped
from dataclasses import replace

from executive.mission.findings import Finding, error
from executive.mission.model import grammar
from executive.mission.model import mission as model
from executive.mission.model.values import Named
from executive.mission.parse.fields import Fields
from executive.mission.parse.nodes import NodeParser, Skills
from executive.mission.parse.params import parse_params
from executive.mission.parse.trees import parse_trees
from executive.mission.source import Mark
from executive.mission.text.yaml_text import Node, Scalar, Sequence, plain
from executive.mission.words import describe

_MISSION_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")


def parse_mission(
    root: Node, overrides: Mapped[str, str], skills: Skills
) -> tuple[model.Mission, list[Finding]]:
    """Return what the file says, as far as it can be read, and what is wrong with its form."""
    findings: list[Finding] = []
    start = replace(root.mark, length=1)
    fields = Fields("the mission", start, root, grammar.MISSION, findings)
    for key in ("mission", "cell", "tree"):
        fields.required(key)
    parser = NodeParser(findings, skills)
    tree = fields.get("tree")
    mission = model.Mission(
        name=_name(fields),
        description=fields.text("description"),
        cell=_cell(fields),
        libraries=_libraries(fields),
        params=parse_params(fields, overrides),
        routes=_routes(fields),
        tree=None if tree is None else parser.node(tree, fields.key_mark("tree")),
        trees=parse_trees(fields, parser),
    )
    return mission, findings


def _name(fields: Fields) -> str:
    name = fields.text("mission")
    if isinstance(fields.get("mission"), Scalar) and not _MISSION_NAME.fullmatch(name):
        message = f'a mission is named by letters, digits, "_" and "-", at most 64, not "{name}"'
        fields.findings.append(error(fields.value_mark("mission"), "bad-name", message))
    return name


def _cell(fields: Fields) -> Named:
    cell = Named(fields.text("cell"), fields.value_mark("cell"))
    if isinstance(fields.get("cell"), Scalar) and not cell.name:
        fields.findings.append(error(cell.mark, "bad-name", "cell names no file"))
    return cell


def _routes(fields: Fields) -> tuple[model.Route, ...]:
    routes: list[model.Route] = []

    def read(label: str, mark: Mark, node: Node) -> None:
        bins = []
        for item in node.items if isinstance(node, Sequence) else (node,):
            if isinstance(item, Scalar) and isinstance(item.value, str):
                bins.append(Named(item.text, item.mark))
            else:
                message = f"a route names a bin or a list of bins, not {describe(plain(item))}"
                fields.findings.append(error(item.mark, "wrong-type", message))
        if isinstance(node, Sequence) and not node.items:
            fields.findings.append(error(node.mark, "empty-list", "a route needs at least one bin"))
        routes.append(model.Route(label, mark, tuple(bins)))

    fields.mapping("routes", read)
    return tuple(routes)


def _libraries(fields: Fields) -> tuple[Named, ...]:
    named = []
    for item in fields.items("library"):
        if isinstance(item, Scalar) and isinstance(item.value, str):
            named.append(Named(item.text, item.mark))
        else:
            message = f"library takes the path of a file or a list of them, not {describe(plain(item))}"
            fields.findings.append(error(item.mark, "wrong-type", message))
    return tuple(named)
