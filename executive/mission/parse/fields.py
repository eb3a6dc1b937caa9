"""Reader for the keys of one mapping of a mission file, which collects findings."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from pydantic import JsonValue

from executive.mission.findings import Finding, alternatives, error
from executive.mission.model.values import FailureName, Literal, Reference, Setting, Value
from executive.mission.source import Mark
from executive.mission.text.yaml_text import Mapping, Node, Scalar, YamlSequence, plain, scalars
from executive.mission.words import describe

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_DOLLAR = re.compile(r"^\$|\$(?=[A-Za-z_])")
_MATCH = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)\.([A-Za-z_][A-Za-z0-9_]*)")


class Fields:
    """The keys of one mapping.

    Attributes:
        owner: Name of the owner of the mapping in messages.
        mark: Place of the owner, for findings about missing keys.
        findings: Receives the findings.
    """

    def __init__(
        self, owner: str, mark: Mark, node: Node, known: Iterable[str], findings: list[Finding]
    ) -> None:
        self.owner, self.mark, self.findings = owner, mark, findings
        self._node = node if isinstance(node, Mapping) else None
        known = list(known)
        if self._node is None:
            message = f"{owner} takes a mapping, not {describe(plain(node))}"
            self._refuse(node.mark, "wrong-type", message, f"It takes: {', '.join(known)}.")
            return
        for entry in self._node.entries:
            if entry.key.text not in known:
                hint = alternatives(entry.key.text, known, "It takes")
                message = f'{owner} has no key "{entry.key.text}"'
                self._refuse(entry.key.mark, "unknown-key", message, hint)

    @property
    def is_mapping(self) -> bool:
        """True if the node is a mapping."""
        return self._node is not None

    def get(self, key: str) -> Node | None:
        """Return the value of `key`, or None."""
        return self._node.get(key) if self._node else None

    def key_mark(self, key: str) -> Mark:
        """Return the place of `key`, or of the owner if the key is missing."""
        entry = self._node.entry(key) if self._node else None
        return entry.key.mark if entry else self.mark

    def value_mark(self, key: str) -> Mark:
        """Return the place of the value of `key`, or of the owner if the key is missing."""
        node = self.get(key)
        return node.mark if node else self.mark

    def require(self, key: str) -> Node | None:
        """Return the value of `key`, or None after adding a finding."""
        node = self.get(key)
        if node is None and self.is_mapping:
            self._refuse(self.mark, "missing-key", f'{self.owner} needs the key "{key}"')
        return node

    def text(self, key: str, default: str = "") -> str:
        """Return the text of `key`, or `default`."""
        node = self.get(key)
        if node is None:
            return default
        if isinstance(node, Scalar) and node.value is not None:
            return node.text
        return self._refuse_type(node, f"{self.owner}.{key} must be a text", default)

    def value(self, key: str) -> Value | None:
        """Return the value or `$reference` of `key`, or None if it is missing or invalid."""
        node = self.get(key)
        return None if node is None else value_of(node, self.findings)

    def failure_names(self, key: str) -> tuple[FailureName, ...]:
        """Return the names of failures under `key`, a single `Skill.reason` or a list."""
        node = self.get(key)
        if node is None:
            return ()
        found = []
        if isinstance(node, YamlSequence) and not node.items:
            hint = f'For every failure leave out "{key}".'
            self._refuse(node.mark, "empty-list", f"{self.owner}.{key} names no failure", hint)
        for item in self.items(key):
            written = item.text if isinstance(item, Scalar) else ""
            if form := _MATCH.fullmatch(written):
                found.append(FailureName(form[1], form[2], item.mark))
            else:
                shown = f'"{written}"' if written else describe(plain(item))
                message = f"{self.owner}.{key} names failures as Skill.reason or label.reason, not {shown}"
                self._refuse(item.mark, "bad-match", message)
        return tuple(found)

    def items(self, key: str) -> tuple[Node, ...]:
        """Return the items of the list under `key`; a single value counts as a list of one."""
        node = self.get(key)
        if isinstance(node, YamlSequence):
            return node.items
        return () if node is None else (node,)

    def mapping(self, key: str, read: Callable[[str, Mark, Node], None]) -> None:
        """Call `read(name, place of the name, value)` for every entry of the mapping under `key`."""
        node = self.get(key)
        if isinstance(node, Mapping):
            for entry in node.entries:
                read(entry.key.text, entry.key.mark, entry.value)
        elif node is not None and not (isinstance(node, Scalar) and node.value is None):
            self._refuse_type(node, f"{self.owner}.{key} must be a mapping", "")

    def _refuse_type(self, node: Node, sentence: str, default: str) -> str:
        self._refuse(node.mark, "wrong-type", f"{sentence}, not {describe(plain(node))}")
        return default

    def _refuse(self, mark: Mark, code: str, message: str, hint: str = "") -> None:
        self.findings.append(error(mark, code, message, hint))


def settings_of(node: Node, owner: str, findings: list[Finding], example: str = "name") -> dict[str, Setting]:
    """Return the values of a mapping; an empty value is an empty mapping.

    `example` is a key that the hint suggests for a value without a key.
    """
    if isinstance(node, Scalar) and node.value is None:
        return {}
    if not isinstance(node, Mapping):
        message = f"{owner} takes a mapping of names to values, not {describe(plain(node))}"
        hint = f"Write it as {owner}: {{{example}: {node.text}}}." if isinstance(node, Scalar) else ""
        findings.append(error(node.mark, "wrong-type", message, hint))
        return {}
    values = [(entry.key, value_of(entry.value, findings)) for entry in node.entries]
    return {key.text: Setting(key.mark, value) for key, value in values if value is not None}


def value_of(node: Node, findings: list[Finding]) -> Value | None:
    """Return a value, in which `$name` is a reference and `$$` is `$`; None if a `$` is misplaced."""
    if isinstance(node, Scalar) and isinstance(node.value, str) and node.value.startswith("$"):
        name = node.value[1:]
        if NAME.fullmatch(name):
            return Reference(name, node.mark)
    misplaced = list(_find_misplaced_dollars(node))
    findings += misplaced
    literal = literal_of(node)
    return None if misplaced else replace(literal, value=_unescape(literal.value))


def literal_of(node: Node) -> Literal:
    """Return a node as a value with its place and the places of its elements."""
    elements = tuple(item.mark for item in node.items) if isinstance(node, YamlSequence) else ()
    return Literal(plain(node), node.mark, elements=elements)


def _find_misplaced_dollars(node: Node) -> Iterator[Finding]:
    """Yield a finding for each `$` in the wrong form, or inside a text, list or mapping."""
    for scalar in scalars(node):
        if isinstance(scalar.value, str) and _DOLLAR.search(scalar.value.replace("$$", "")):
            message = f'"{scalar.text}" is no reference: only a whole value can be one, as in key: $name'
            hint = f'For the text itself write "{scalar.text.replace("$", "$$")}".'
            yield error(scalar.mark, "bad-reference", message, hint)


def _unescape(value: JsonValue) -> JsonValue:
    """Return a plain value in which `$` replaces each `$$`."""
    if isinstance(value, str):
        return value.replace("$$", "$")
    if isinstance(value, list):
        return [_unescape(item) for item in value]
    return {key: _unescape(item) for key, item in value.items()} if isinstance(value, dict) else value
