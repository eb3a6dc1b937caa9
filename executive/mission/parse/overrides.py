"""Values from the command line: `--set name=value` for params, `--set cell.key.key=value` for the cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from executive.cell.config import CellConfig
from executive.mission.findings import Finding, list_choices, make_error
from executive.mission.source import Mark, Source
from executive.mission.text.yaml_text import YamlEntry, YamlMapping, YamlNode, YamlScalar, parse_yaml

CELL_PREFIX = "cell."
"""Start of the keys of overrides for the cell."""


def make_override_source(key: str, value: str) -> Source:
    """Return the source text of an override, for the positions of findings."""
    return Source("--set", f"{key}={value}")


def parse_override(key: str, value: str, is_text: bool = False) -> tuple[YamlNode | None, list[Finding]]:
    """Return the YAML node of an override, or None if it is invalid, and the findings; `is_text`: no YAML."""
    source = make_override_source(key, value)
    mark = source.make_mark(1, len(key) + 2, max(1, len(value)))
    if is_text:
        return YamlScalar(mark, value, value), []
    if not value.strip():
        return YamlScalar(mark, None, value), []
    # Blanks replace `key=`, so that the columns of findings are correct.
    padded = Source("--set", " " * (len(key) + 1) + value)
    root, yaml_findings = parse_yaml(padded)
    findings = [replace(finding, excerpt=source.text) for finding in yaml_findings]
    return (_move(root, mark) if root else None), findings


def override_cell(root: YamlNode, overrides: Mapping[str, str]) -> tuple[YamlNode, list[Finding]]:
    """Return the YAML tree of a cell file after all overrides `cell.<key>.<key>=value`, and the findings."""
    findings: list[Finding] = []
    for key, value in overrides.items():
        if not key.startswith(CELL_PREFIX):
            continue
        node, override_findings = parse_override(key, value)
        findings += override_findings
        path = key.removeprefix(CELL_PREFIX).split(".")
        if node is not None and _has_section(root, path, node, findings):
            root = _set_value(root, path, node, findings)
    return root, findings


def _has_section(root: YamlNode, path: list[str], value: YamlNode, findings: list[Finding]) -> bool:
    """Return True if `path` has one key or starts with a section of cell files; otherwise add an error."""
    keys = root.keys if isinstance(root, YamlMapping) else ()
    if len(path) == 1 or path[0] in (*keys, *CellConfig.model_fields):
        return True
    hint = list_choices(path[0], CellConfig.model_fields, "Keys of the cell")
    findings.append(make_error(value.mark, "unknown-key", f'the cell has no key "{path[0]}"', hint))
    return False


def _set_value(root: YamlNode, path: list[str], value: YamlNode, findings: list[Finding]) -> YamlNode:
    """Return the tree with `value` at `path`; unchanged, with an error, if `path` leads into a value."""
    first, *rest = path
    if not isinstance(root, YamlMapping):
        message = f'there is no key "{first}", because the value of the section above is no mapping'
        findings.append(make_error(value.mark, "unknown-key", message))
        return root
    entry = root.get_entry(first)
    if entry is None:
        # The file omits the key, so that its default applies; validation reports an unknown key.
        for key in reversed(rest):
            value = YamlMapping(value.mark, (YamlEntry(YamlScalar(value.mark, key, key), value),))
        return replace(root, entries=(*root.entries, YamlEntry(YamlScalar(value.mark, first, first), value)))
    if rest:
        changed = YamlEntry(entry.key, _set_value(entry.value, rest, value, findings))
    else:
        changed = YamlEntry(replace(entry.key, mark=value.mark), value)
    return replace(root, entries=tuple(changed if e is entry else e for e in root.entries))


def _move(node: YamlNode, mark: Mark) -> YamlNode:
    """Return the node with `mark` as the position of all its parts."""
    if isinstance(node, YamlScalar):
        return replace(node, mark=mark)
    if isinstance(node, YamlMapping):
        moved = tuple(YamlEntry(replace(e.key, mark=mark), _move(e.value, mark)) for e in node.entries)
        return replace(node, mark=mark, entries=moved)
    return replace(node, mark=mark, items=tuple(_move(item, mark) for item in node.items))
