"""Reading of values from the mappings of a mission file, with findings for malformed values."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from pydantic import JsonValue

from executive.mission.findings import Finding, list_choices, make_error
from executive.mission.model.values import FailureName, Literal, Reference, Setting, Value
from executive.mission.source import Mark
from executive.mission.text.yaml_text import (
    YamlMapping,
    YamlNode,
    YamlScalar,
    YamlSequence,
    describe_node,
    iterate_scalars,
    to_python_value,
)

NAME_PATTERN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
"""Names of params, arguments, variables and subtrees."""
_REFERENCE_START = re.compile(r"^\$|\$(?=[A-Za-z_])")
"""A `$` that starts a reference, or looks like the start of a reference."""
_FAILURE_PATTERN = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)\.([A-Za-z_][A-Za-z0-9_]*)")
"""`Skill.reason` or `label.reason`."""


class Fields:
    """Reader of one mapping; reports unknown keys at construction.

    Attributes:
        owner: Name of the owner of the mapping in messages.
        mark: Position of the owner, for findings about missing keys.
        findings: List to which findings are added.
    """

    def __init__(
        self, owner: str, mark: Mark, node: YamlNode, known: Iterable[str], findings: list[Finding]
    ) -> None:
        self.owner, self.mark, self.findings = owner, mark, findings
        self._node = node if isinstance(node, YamlMapping) else None
        known = list(known)
        if self._node is None:
            message = f"{owner} must be a mapping, not {describe_node(node)}"
            self._add_error(node.mark, "wrong-type", message, f"Its keys: {', '.join(known)}.")
            return
        for entry in self._node.entries:
            if entry.key.text not in known:
                hint = list_choices(entry.key.text, known, "Allowed keys")
                message = f'{owner} has no key "{entry.key.text}"'
                self._add_error(entry.key.mark, "unknown-key", message, hint)

    @property
    def is_mapping(self) -> bool:
        """True if the node is a mapping."""
        return self._node is not None

    def get(self, key: str) -> YamlNode | None:
        """Return the value of `key`, or None."""
        return self._node.get(key) if self._node else None

    def get_key_mark(self, key: str) -> Mark:
        """Return the position of `key`, or of the owner if the key is missing."""
        entry = self._node.get_entry(key) if self._node else None
        return entry.key.mark if entry else self.mark

    def get_value_mark(self, key: str) -> Mark:
        """Return the position of the value of `key`, or of the owner if the key is missing."""
        node = self.get(key)
        return node.mark if node else self.mark

    def require(self, key: str) -> YamlNode | None:
        """Return the value of `key`; if the key is missing, add an error and return None."""
        node = self.get(key)
        if node is None and self.is_mapping:
            self._add_error(self.mark, "missing-key", f'{self.owner} needs the key "{key}"')
        return node

    def read_text(self, key: str) -> str:
        """Return the text of `key`; "" if it is missing or, after adding an error, if it is no text."""
        node = self.get(key)
        if node is None:
            return ""
        if isinstance(node, YamlScalar) and node.value is not None:
            return node.text
        message = f"{self._name(key)} must be a text, not {describe_node(node)}"
        self._add_error(node.mark, "wrong-type", message)
        return ""

    def read_failure_names(self, key: str) -> tuple[FailureName, ...]:
        """Return the valid failure names in the list or single value of `key`; add errors for others."""
        node = self.get(key)
        if node is None:
            return ()
        names = []
        if isinstance(node, YamlSequence) and not node.items:
            hint = f'To match every failure, delete "{key}".'
            self._add_error(node.mark, "empty-list", f"{self._name(key)} names no failure", hint)
        for item in self.list_items(key):
            text = item.text if isinstance(item, YamlScalar) else ""
            if parts := _FAILURE_PATTERN.fullmatch(text):
                names.append(FailureName(parts[1], parts[2], item.mark))
            else:
                given = f'"{text}"' if text else describe_node(item)
                message = f"{self._name(key)} must name failures as Skill.reason or label.reason, not {given}"
                self._add_error(item.mark, "bad-match", message)
        return tuple(names)

    def list_items(self, key: str) -> tuple[YamlNode, ...]:
        """Return the items of the list under `key`; a single value counts as a list with one item."""
        node = self.get(key)
        if isinstance(node, YamlSequence):
            return node.items
        return () if node is None else (node,)

    def read_entries(self, key: str, read_entry: Callable[[str, Mark, YamlNode], None]) -> None:
        """Call `read_entry` with name, position of the name, and value of each entry of the mapping `key`."""
        node = self.get(key)
        if isinstance(node, YamlMapping):
            for entry in node.entries:
                read_entry(entry.key.text, entry.key.mark, entry.value)
        elif node is not None and not (isinstance(node, YamlScalar) and node.value is None):
            message = f"{self._name(key)} must be a mapping, not {describe_node(node)}"
            self._add_error(node.mark, "wrong-type", message)

    def _name(self, key: str) -> str:
        """Return the name of a key in messages: `retry.on`, or `params of the mission`."""
        return f"{key} of {self.owner}" if " " in self.owner else f"{self.owner}.{key}"

    def _add_error(self, mark: Mark, code: str, message: str, hint: str = "") -> None:
        self.findings.append(make_error(mark, code, message, hint))


def read_settings(
    node: YamlNode, owner: str, findings: list[Finding], example_key: str = "name"
) -> dict[str, Setting]:
    """Return the values of the mapping of a skill or key `owner`; a hint suggests `example_key`."""
    if isinstance(node, YamlScalar) and node.value is None:
        return {}
    if not isinstance(node, YamlMapping):
        message = f"the value of {owner} must be a mapping of names to values, not {describe_node(node)}"
        hint = f"Write {owner}: {{{example_key}: {node.text}}}." if isinstance(node, YamlScalar) else ""
        findings.append(make_error(node.mark, "wrong-type", message, hint))
        return {}
    values = [(entry.key, read_value(entry.value, findings)) for entry in node.entries]
    return {key.text: Setting(key.mark, value) for key, value in values if value is not None}


def read_value(node: YamlNode, findings: list[Finding]) -> Value | None:
    """Return a reference for `$name`, or a constant in which `$$` is `$`; None after errors."""
    if isinstance(node, YamlScalar) and isinstance(node.value, str) and node.value.startswith("$"):
        name = node.value[1:]
        if NAME_PATTERN.fullmatch(name):
            return Reference(name, node.mark)
    errors = list(_find_misplaced_dollars(node))
    findings += errors
    literal = make_literal(node)
    return None if errors else replace(literal, value=_unescape(literal.value))


def make_literal(node: YamlNode) -> Literal:
    """Return a node as a constant with its position and the positions of its elements."""
    element_marks = tuple(item.mark for item in node.items) if isinstance(node, YamlSequence) else ()
    return Literal(to_python_value(node), node.mark, element_marks=element_marks)


def _find_misplaced_dollars(node: YamlNode) -> Iterator[Finding]:
    """Yield an error for each text with a `$` that is neither `$$` nor the start of a whole value `$name`."""
    for scalar in iterate_scalars(node):
        if isinstance(scalar.value, str) and _REFERENCE_START.search(scalar.value.replace("$$", "")):
            message = f'"{scalar.text}" is no reference: a reference is a whole value, as in key: $name'
            hint = f'For the character $, write $$: "{scalar.text.replace("$", "$$")}".'
            yield make_error(scalar.mark, "bad-reference", message, hint)


def _unescape(value: JsonValue) -> JsonValue:
    """Return a plain value in which `$` replaces each `$$`."""
    if isinstance(value, str):
        return value.replace("$$", "$")
    if isinstance(value, list):
        return [_unescape(item) for item in value]
    return {key: _unescape(item) for key, item in value.items()} if isinstance(value, dict) else value
