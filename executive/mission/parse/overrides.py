"""Values from the command line: `--set name=value` for params, `--set cell.key.key=value` for the cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from executive.mission.findings import Finding, make_error
from executive.mission.source import Source
from executive.mission.text.yaml_text import YamlEntry, YamlMapping, YamlNode, YamlScalar, parse_yaml

CELL_PREFIX = "cell."
"""Prefix of the keys of overrides for the cell."""


def make_override_source(key: str, value: str) -> Source:
    """Return the source text of an override, for the positions of findings."""
    return Source("--set", f"{key}={value}")


def parse_override(key: str, value: str, is_text: bool = False) -> tuple[YamlNode | None, list[Finding]]:
    """Return YAML node (None after an error) and findings; if `is_text` is True, the value is not parsed."""
    source = make_override_source(key, value)
    if is_text or not value.strip():
        span = source.make_span(1, len(key) + 2, max(1, len(value)))
        return YamlScalar(span, value if is_text else None, value), []
    # Blanks replace `key=`, so that the positions in the source are correct.
    return parse_yaml(source, " " * (len(key) + 1) + value)


def override_cell(root: YamlNode, overrides: Mapping[str, str]) -> tuple[YamlNode, list[Finding]]:
    """Return the YAML tree of a cell file after all overrides `cell.<key>.<key>`, and the findings."""
    findings: list[Finding] = []
    for key, value in overrides.items():
        if not key.startswith(CELL_PREFIX):
            continue
        node, override_findings = parse_override(key, value)
        findings += override_findings
        path = key.removeprefix(CELL_PREFIX).split(".")
        if node is not None:
            root = _replace_value(root, path, node, findings)
    return root, findings


def _replace_value(root: YamlNode, path: list[str], value: YamlNode, findings: list[Finding]) -> YamlNode:
    """Return the tree with `value` at `path`; add an error if `path` leads below a scalar or a list."""
    key, *inner_path = path
    if not isinstance(root, YamlMapping):
        message = f'there is no key "{key}", because the value of the section above is no mapping'
        findings.append(make_error(value.span, "unknown-key", message))
        return root
    entry = root.get_entry(key)
    if entry is None:
        # The file omits the key and uses the default; validation reports an unknown key.
        entry = YamlEntry(YamlScalar(value.span, key, key), YamlMapping(value.span, ()))
        root = replace(root, entries=(*root.entries, entry))
    if inner_path:
        new_entry = YamlEntry(entry.key, _replace_value(entry.value, inner_path, value, findings))
    else:
        new_entry = YamlEntry(replace(entry.key, span=value.span), value)
    entries = [new_entry if candidate is entry else candidate for candidate in root.entries]
    return replace(root, entries=tuple(entries))
