"""Values from the command line: `--set name=value` for params, `--set cell.key.key=value` for the cell."""

from __future__ import annotations

from collections.abc import Mapping as Mapped
from dataclasses import replace

from executive.cell.config import CellConfig
from executive.mission.findings import Finding, alternatives, error
from executive.mission.source import Mark, Source
from executive.mission.text.yaml_text import Entry, Mapping, Node, Scalar, parse_yaml

CELL = "cell."


def override_source(key: str, value: str) -> Source:
    """Return the source of an override, for findings."""
    return Source("--set", f"{key}={value}")


def override_node(key: str, value: str, as_text: bool = False) -> tuple[Node | None, list[Finding]]:
    """Return the value of an override as a node, or None, and the findings."""
    source = override_source(key, value)
    whole = source.mark(1, len(key) + 2, max(1, len(value)))
    if as_text:
        return Scalar(whole, value, value), []
    if not value.strip():
        return Scalar(whole, None, value), []
    # Blanks replace the key, so that the columns of findings are correct.
    padded = Source("--set", " " * (len(key) + 1) + value)
    root, findings = parse_yaml(padded)
    shown = [replace(finding, excerpt=source.text) for finding in findings]
    return (_move(root, whole) if root else None), shown


def override_cell(root: Node, overrides: Mapped[str, str]) -> tuple[Node, list[Finding]]:
    """Return the nodes of a cell file with the values of all overrides `cell.<key>.<key>=value`."""
    findings: list[Finding] = []
    for key, value in overrides.items():
        if not key.startswith(CELL):
            continue
        node, override_findings = override_node(key, value)
        findings += override_findings
        path = key.removeprefix(CELL).split(".")
        if node is not None and _is_known(root, path, node, findings):
            root = _set_value(root, path, node, findings)
    return root, findings


def _is_known(root: Node, path: list[str], value: Node, findings: list[Finding]) -> bool:
    """Return True if the cell has the section at the start of `path`; otherwise add a finding."""
    written = root.keys if isinstance(root, Mapping) else ()
    if len(path) == 1 or path[0] in (*written, *CellConfig.model_fields):
        return True
    hint = alternatives(path[0], CellConfig.model_fields, "It has")
    findings.append(error(value.mark, "unknown-key", f'the cell has no key "{path[0]}"', hint))
    return False


def _set_value(root: Node, path: list[str], value: Node, findings: list[Finding]) -> Node:
    first, *rest = path
    if not isinstance(root, Mapping):
        message = f'there is no key "{first}" there: the value above it is no mapping'
        findings.append(error(value.mark, "unknown-key", message))
        return root
    entry = root.entry(first)
    if entry is None:
        # The file leaves the key at its default. Validation rejects unknown keys later.
        for key in reversed(rest):
            value = Mapping(value.mark, (Entry(Scalar(value.mark, key, key), value),))
        return replace(root, entries=(*root.entries, Entry(Scalar(value.mark, first, first), value)))
    if rest:
        changed = Entry(entry.key, _set_value(entry.value, rest, value, findings))
    else:
        changed = Entry(replace(entry.key, mark=value.mark), value)
    return replace(root, entries=tuple(changed if e is entry else e for e in root.entries))


def _move(node: Node, mark: Mark) -> Node:
    """Return the node with `mark` as the place of all its parts."""
    if isinstance(node, Scalar):
        return replace(node, mark=mark)
    if isinstance(node, Mapping):
        moved = tuple(Entry(replace(e.key, mark=mark), _move(e.value, mark)) for e in node.entries)
        return replace(node, mark=mark, entries=moved)
    return replace(node, mark=mark, items=tuple(_move(item, mark) for item in node.items))
