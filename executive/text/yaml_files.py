"""YAML text of missions and cells, parsed to nodes with positions.

A file can neither execute code nor exhaust the memory: tags are errors, and the size of the tree is limited.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import yaml
from pydantic import JsonValue

from executive.errors import InputError
from executive.text.findings import Finding, Source, Span, describe_value, make_error

_MAX_DEPTH = 50
"""Maximum depth of the nesting of lists and mappings."""
_SURROGATE = re.compile("[\ud800-\udfff]")
"""Surrogate code point, which an escape sequence can produce, but UTF-8 cannot encode."""
_MAX_NODE_COUNT = 20_000
"""Maximum number of keys and values; an alias counts like a copy of the anchored node."""
_ADVICE_BY_MESSAGE = {
    "mapping values are not allowed here": (
        "Is a colon missing at the end of the line above, or are braces, as in Detect: {view: full}? "
        'A text that contains ": " needs quotes.'
    ),
    "found character '\\t' that cannot start any token": "Indent with blanks instead of tabs.",
    "expected <block end>": "Compare the indentation with the lines above.",
    "expected ',' or": "Close the bracket or brace.",
}
"""Advice on syntax errors, by the start of PyYAML's message."""
_DEPTH_MESSAGE = f"lists and mappings are nested more than {_MAX_DEPTH} levels deep"
_FAST_LOADER: type[yaml.SafeLoader] = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Parser of libyaml, which takes a quarter of the time; the Python parser if PyYAML lacks libyaml."""
_LIBYAML_DIFFERENCE = re.compile(r"[^\n\x20-\x7e\xa1-\u1fff]|[?]|---|:\s*[,}\]]")
"""Text that libyaml may read differently: special characters, `?`, `---`, and empty keys in brackets."""
_LINE_LENGTH = 1000
"""Length of a span [characters] that reaches the end of the line."""


@dataclass(frozen=True)
class _Node:
    """Base class of the nodes."""

    span: Span

    @property
    def python_value(self) -> JsonValue:
        """The node as plain Python values."""
        raise NotImplementedError

    @property
    def description(self) -> str:
        """Description of the value, for the end of a sentence."""
        return describe_value(self.python_value)


@dataclass(frozen=True)
class YamlScalar(_Node):
    """A value that is no list or mapping; `text` is its text in the file without quotes."""

    value: ScalarValue
    text: str

    @property
    def python_value(self) -> JsonValue:
        """The value."""
        return self.value


@dataclass(frozen=True)
class YamlSequence(_Node):
    """A list of nodes."""

    items: tuple[YamlNode, ...]

    @property
    def python_value(self) -> JsonValue:
        """The list of the values of the items."""
        return [item.python_value for item in self.items]


@dataclass(frozen=True)
class YamlEntry:
    """`key: value` in a mapping."""

    key: YamlScalar
    value: YamlNode


@dataclass(frozen=True)
class YamlMapping(_Node):
    """Entries by their keys, in the order of the text."""

    entries: Mapping[str, YamlEntry]

    @property
    def python_value(self) -> JsonValue:
        """The values by key."""
        return {key: entry.value.python_value for key, entry in self.entries.items()}

    def get(self, key: str) -> YamlNode | None:
        """Return the value of `key`, or None."""
        entry = self.entries.get(key)
        return entry.value if entry else None

    def with_value(self, key: str, value: YamlNode) -> YamlMapping:
        """Return the mapping with another value of an existing key."""
        return replace(self, entries={**self.entries, key: replace(self.entries[key], value=value)})


YamlNode = YamlScalar | YamlSequence | YamlMapping


def list_scalars(node: YamlNode) -> list[YamlScalar]:
    """Return every scalar of a node in the order of the text, without keys."""
    if isinstance(node, YamlScalar):
        return [node]
    return [scalar for child in list_children(node) for scalar in list_scalars(child)]


def flatten(node: YamlNode) -> YamlNode:
    """Return a list of lists as the list of their scalars, in order; return other nodes unchanged."""
    return replace(node, items=tuple(list_scalars(node))) if isinstance(node, YamlSequence) else node


def list_children(node: YamlNode) -> tuple[YamlNode, ...]:
    """Return the items of a sequence, or the values of a mapping; () for a scalar."""
    if isinstance(node, YamlMapping):
        return tuple(entry.value for entry in node.entries.values())
    return node.items if isinstance(node, YamlSequence) else ()


def parse_yaml(source: Source, text: str | None = None) -> tuple[YamlNode | None, list[Finding]]:
    """Return the root node, or None if an error prevents a complete tree, and the findings.

    `text` is the YAML text at the same positions as in the source; by default the text of the source.
    """
    text = source.text if text is None else text
    composer = _Composer(source, text, _choose_loader(text))
    try:
        try:
            root = composer.read_document()
        except (yaml.YAMLError, UnicodeEncodeError):
            # Unlike libyaml, the Python parser has the same error messages in every installation.
            composer = _Composer(source, text, yaml.SafeLoader)
            root = composer.read_document()
    except yaml.MarkedYAMLError as error:
        return None, [*composer.findings, _make_syntax_error(source, error)]
    except yaml.reader.ReaderError as error:
        lines = source.text[: error.position + 1].splitlines()
        span = source.make_span(len(lines), len(lines[-1]), 1)
        message = f"the character {source.text[error.position : error.position + 1]!r} is not allowed in YAML"
        return None, [*composer.findings, make_error(span, "yaml", message)]
    except _IncompleteTree:
        return None, composer.findings
    return root, composer.findings


def load_yaml(source: Source, loader: type[yaml.BaseLoader] | None = None) -> Any:
    """Return YAML text within the bounds of missions as plain values, as a loader of PyYAML converts them.

    `loader` is None for the values of `SafeLoader`.

    Raises:
        InputError: The text is not valid YAML, or exceeds a bound.
        YAMLError: The loader does not know a tag.
    """
    _, findings = parse_yaml(source)
    for finding in findings:
        if finding.code != "tag":
            raise InputError(f"{source.path}:{finding.line}: {finding.message}")
    return yaml.load(source.text, loader or _choose_loader(source.text))


def _choose_loader(text: str) -> type[yaml.SafeLoader]:
    """Return the fastest loader that reads a text like the Python parser."""
    return yaml.SafeLoader if _LIBYAML_DIFFERENCE.search(text) else _FAST_LOADER


class _IncompleteTree(Exception):
    """The tree is incomplete because of an error in the findings."""


class _Composer:
    """Composer of the tree of nodes from PyYAML's events, which collects findings."""

    def __init__(self, source: Source, text: str, loader: type[yaml.SafeLoader]) -> None:
        self.source = source
        self.findings: list[Finding] = []
        self._events: Iterator[yaml.Event] = yaml.parse(text, Loader=loader)
        # Node of each anchor, and number of keys and values in the node.
        self._anchors: dict[str, tuple[YamlNode, int]] = {}
        self._node_count = 0

    def read_document(self) -> YamlNode:
        """Return the root node of the only document."""
        next(self._events)  # StreamStartEvent
        if isinstance(next(self._events), yaml.StreamEndEvent):
            raise self._add_fatal_error(self.source.make_span(), "empty", "the file is empty")
        root = self._read_node(next(self._events), 0)
        next(self._events)  # DocumentEndEvent
        event = next(self._events)
        if not isinstance(event, yaml.StreamEndEvent):
            message = 'a second document starts here, after "---"'
            raise self._add_fatal_error(self._make_span(event, len("---")), "two-documents", message)
        return root

    def _read_node(self, event: yaml.Event, depth: int) -> YamlNode:
        """Return the node that starts with `event`; `depth` is the number of containers around the node."""
        if isinstance(event, yaml.AliasEvent):
            return self._resolve_alias(event, depth)
        # PyYAML checks the YAML grammar, so that only these events can start a node.
        assert isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent)
        count_before = self._node_count
        self._count_nodes(1, event)
        if event.tag is not None:
            self._add_error(self._make_span(event), "tag", f'the tag "{event.tag}" is not allowed')
        node = self._read_value(event, depth)
        if event.anchor is not None:
            self._anchors[event.anchor] = node, self._node_count - count_before
        return node

    def _resolve_alias(self, event: yaml.AliasEvent, depth: int) -> YamlNode:
        if event.anchor not in self._anchors:
            message = f'there is no anchor "&{event.anchor}" above'
            raise self._add_fatal_error(self._make_span(event), "alias", message)
        node, node_count = self._anchors[event.anchor]
        if depth + _compute_height(node) > _MAX_DEPTH:
            raise self._add_fatal_error(self._make_span(event), "too-deep", _DEPTH_MESSAGE)
        self._count_nodes(node_count, event)
        return node

    def _count_nodes(self, count: int, event: yaml.Event) -> None:
        """Add to the number of keys and values; raise `_IncompleteTree` above `_MAX_NODE_COUNT`."""
        self._node_count += count
        if self._node_count > _MAX_NODE_COUNT:
            message = f"the file has more than {_MAX_NODE_COUNT} keys and values, including those of aliases"
            raise self._add_fatal_error(self._make_span(event), "too-large", message)

    def _read_value(self, event: yaml.Event, depth: int) -> YamlNode:
        if isinstance(event, yaml.ScalarEvent):
            text = event.value
            span = self._make_span(event)
            if _SURROGATE.search(text):
                self._add_error(span, "yaml", "a surrogate (U+D800 to U+DFFF) is no character")
                text = _SURROGATE.sub("?", text)
            return YamlScalar(span, convert_scalar(text) if event.implicit[0] else text, text)
        if depth >= _MAX_DEPTH:
            raise self._add_fatal_error(self._make_span(event, 1), "too-deep", _DEPTH_MESSAGE)
        if isinstance(event, yaml.SequenceStartEvent):
            items = []
            while not isinstance(item_event := next(self._events), yaml.SequenceEndEvent):
                items.append(self._read_node(item_event, depth + 1))
            return YamlSequence(self._make_span(event, 1), tuple(items))
        return self._read_mapping(event, depth)

    def _read_mapping(self, event: yaml.Event, depth: int) -> YamlMapping:
        entries: dict[str, YamlEntry] = {}
        while not isinstance(key_event := next(self._events), yaml.MappingEndEvent):
            key = self._read_node(key_event, depth + 1)
            value = self._read_node(next(self._events), depth + 1)
            if not isinstance(key, YamlScalar):
                self._add_error(key.span, "bad-key", "a key must be a single word")
            elif key.text == "<<":
                message = 'the merge key "<<" is not allowed; write the merged keys here'
                self._add_error(key.span, "merge-key", message)
            elif key.text in entries:
                first_line = entries[key.text].key.span.line
                message = f'the key "{key.text}" occurs twice here; the first is in line {first_line}'
                self._add_error(key.span, "duplicate-key", message)
            else:
                entries[key.text] = YamlEntry(key, value)
        return YamlMapping(self._make_span(event, 1), entries)

    def _make_span(self, event: yaml.Event, length: int = 0) -> Span:
        """Return the span of an event; if `length` is 0, the span covers the first line of the event."""
        start = event.start_mark
        end = event.end_mark
        assert start is not None and end is not None, "PyYAML locates every event"
        if not length:
            length = max(1, end.column - start.column) if start.line == end.line else _LINE_LENGTH
        return Span(self.source, start.line + 1, start.column + 1, length)

    def _add_fatal_error(self, span: Span, code: str, message: str) -> _IncompleteTree:
        self._add_error(span, code, message)
        return _IncompleteTree()

    def _add_error(self, span: Span, code: str, message: str) -> None:
        self.findings.append(make_error(span, code, message))


def _compute_height(node: YamlNode) -> int:
    height_below = max(map(_compute_height, list_children(node)), default=0)
    return 0 if isinstance(node, YamlScalar) else 1 + height_below


def _make_syntax_error(source: Source, error: yaml.MarkedYAMLError) -> Finding:
    position = error.problem_mark or error.context_mark
    span = source.make_span(position.line + 1, position.column + 1, 1) if position else source.make_span()
    if position and not source.get_line(span.line):
        # The error is at the end of the text, so the finding shows the last line that is not empty.
        last_line = source.text.rstrip().count("\n") + 1
        span = source.make_span(last_line, max(1, len(source.get_line(last_line))), 1)
    context = f" {error.context}" if error.context else ""
    context_mark = error.context_mark if context and error.context_mark is not position else None
    note = f" that began in line {context_mark.line + 1}" if context_mark else ""
    message = f"not valid YAML:{context}{note}: {error.problem}".replace("::", ":")
    hints = (hint for text, hint in _ADVICE_BY_MESSAGE.items() if str(error.problem).startswith(text))
    return make_error(span, "yaml", message, next(hints, ""))


# Spellings of the values in the core schema.
_VALUE_BY_WORD: Mapping[str, bool | float | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), math.nan),
}
_INTEGER = re.compile(r"[-+]?[0-9]+")
_PREFIXED_INTEGER = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"[-+]?\.(inf|Inf|INF)")
_MAX_NUMBER_LENGTH = 300
"""Maximum number of characters of a number; a longer scalar is a string."""

ScalarValue = None | bool | int | float | str


def convert_scalar(text: str) -> ScalarValue:
    """Return the value of a plain scalar: None, a boolean, a number, or the text itself."""
    if text in _VALUE_BY_WORD:
        return _VALUE_BY_WORD[text]
    if text[0] not in "+-.0123456789" or len(text) > _MAX_NUMBER_LENGTH:
        return text
    if _INTEGER.fullmatch(text):
        number = int(text)
    elif _PREFIXED_INTEGER.fullmatch(text):
        number = int(text, base=0)
    elif _FLOAT.fullmatch(text):
        return float(text)
    else:
        return float(text.replace(".", "")) if _INFINITE.fullmatch(text) else text
    # A larger integer becomes a float, for JSON readers; the conversion of a text returns infinity if needed.
    return number if -(2**63) <= number < 2**63 else float(str(number))
