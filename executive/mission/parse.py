"""From the positioned nodes of a mission file to the typed mission."""

from __future__ import annotations

import re
from collections.abc import Mapping as Mapped

from executive.mission import model
from executive.mission.fields import NAME, Fields
from executive.mission.findings import Finding, alternatives, error
from executive.mission.overrides import CELL, override_node, override_source
from executive.mission.parse_nodes import NodeParser
from executive.mission.source import Mark
from executive.mission.text import Mapping, Node, Scalar, Sequence, plain
from executive.mission.words import describe

_TOP = ("mission", "description", "cell", "params", "routes", "tree", "trees")
_MISSION_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")


def parse_mission(root: Node, overrides: Mapped[str, str]) -> tuple[model.Mission, list[Finding]]:
    """Return what the file says, as far as it can be read, and what is wrong with its form."""
    findings: list[Finding] = []
    start = Mark(root.mark.source, 1, 1, 1)
    fields = Fields("the mission", start, root, _TOP, findings)
    for key in ("mission", "cell", "tree"):
        fields.required(key)
    parser = NodeParser(findings)
    tree = fields.get("tree")
    mission = model.Mission(
        name=_name(fields),
        description=fields.text("description"),
        cell=fields.text("cell"),
        cell_mark=_value_mark(fields, "cell"),
        params=_params(fields, overrides),
        routes=_routes(fields),
        tree=None if tree is None else parser.node(tree, fields.key_mark("tree")),
        trees=_trees(fields, parser),
    )
    return mission, findings


def _name(fields: Fields) -> str:
    name = fields.text("mission")
    if name and not _MISSION_NAME.fullmatch(name):
        message = f'a mission is named by letters, digits, "_" and "-", at most 64, not "{name}"'
        fields.findings.append(error(_value_mark(fields, "mission"), "bad-name", message))
    return name


def _value_mark(fields: Fields, key: str) -> Mark:
    node = fields.get(key)
    return node.mark if node else fields.mark


def _params(fields: Fields, overrides: Mapped[str, str]) -> dict[str, model.Literal]:
    params: dict[str, model.Literal] = {}

    def read(name: str, mark: Mark, node: Node) -> None:
        if not NAME.fullmatch(name):
            fields.findings.append(error(mark, "bad-name", f'"{name}" cannot be written as ${name}'))
        params[name] = model.Literal(plain(node), node.mark)

    fields.mapping("params", read)
    for name, value in overrides.items():
        if name.startswith(CELL):
            continue
        if name not in params:
            mark = override_source(name, value).mark(1, 1, max(1, len(name)))
            hint = alternatives(name, params, "The mission's params")
            fields.findings.append(error(mark, "unknown-param", f'the mission has no param "{name}"', hint))
        else:
            params[name] = _override(name, value, params[name], fields.findings)
    return params


def _override(name: str, value: str, default: model.Literal, findings: list[Finding]) -> model.Literal:
    """Return the value given beside the file, of the same type as the one in the file."""
    node, wrong = override_node(name, value, as_text=isinstance(default.value, str))
    findings += wrong
    if node is None:
        return default
    given = plain(node)
    wanted = default.value
    if isinstance(wanted, float) and type(given) is int:
        given = float(given)
    if wanted is not None and type(given) is not type(wanted):
        message = f"{name} must be of the kind of its default, {describe(wanted)}, not {describe(given)}"
        findings.append(error(node.mark, "wrong-type", message))
        return default
    return model.Literal(given, node.mark)


def _routes(fields: Fields) -> tuple[model.Route, ...]:
    routes: list[model.Route] = []

    def read(label: str, mark: Mark, node: Node) -> None:
        if isinstance(node, Scalar) and isinstance(node.value, str):
            routes.append(model.Route(label, mark, node.text, node.mark))
        else:
            message = f"a route names a bin, not {describe(plain(node))}"
            fields.findings.append(error(node.mark, "wrong-type", message))

    fields.mapping("routes", read)
    return tuple(routes)


def _trees(fields: Fields, parser: NodeParser) -> dict[str, model.Subtree]:
    trees: dict[str, model.Subtree] = {}

    def read(name: str, mark: Mark, node: Node) -> None:
        if not NAME.fullmatch(name):
            parser.refuse(mark, "bad-name", f'a subtree is named by letters, digits and "_", not "{name}"')
        if isinstance(node, Mapping) and node.get("do") is not None:
            trees[name] = _subtree(name, mark, node, parser)
        elif isinstance(node, Mapping) and {"doc", "args", "returns"} & set(node.keys):
            parser.refuse(mark, "missing-key", f'the subtree "{name}" needs the key "do"')
        else:
            trees[name] = model.Subtree(name, mark, "", {}, {}, parser.node(node, mark))

    fields.mapping("trees", read)
    return trees


def _subtree(name: str, mark: Mark, node: Mapping, parser: NodeParser) -> model.Subtree:
    fields = Fields(f'the subtree "{name}"', mark, node, ("doc", "args", "returns", "do"), parser.findings)
    args: dict[str, model.Argument] = {}

    def read(argument: str, where: Mark, value: Node) -> None:
        if not NAME.fullmatch(argument):
            parser.refuse(where, "bad-name", f'"{argument}" cannot be written as ${argument}')
        required = isinstance(value, Scalar) and value.value is None
        default = None if required else model.Literal(plain(value), value.mark)
        args[argument] = model.Argument(where, default)

    if isinstance(fields.get("args"), Sequence):
        for item in fields.items("args"):
            if isinstance(item, Scalar):
                read(item.text, item.mark, Scalar(item.mark, None, ""))
    else:
        fields.mapping("args", read)
    returns = {item.text: item.mark for item in fields.items("returns") if isinstance(item, Scalar)}
    body = parser.node(fields.get("do"), fields.key_mark("do"))
    return model.Subtree(name, mark, fields.text("doc"), args, returns, body)
