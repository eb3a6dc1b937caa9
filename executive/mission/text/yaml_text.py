"""Parser of YAML text to a tree of nodes with their positions in the text.

The parser supports mappings with text keys, sequences and scalars of YAML 1.2. It rejects tags and merge keys
and limits the size of the tree, so that a file can neither execute code nor exhaust the memory.
The node of an alias has the position of its anchor.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import yaml
from pydantic import JsonValue

from executive.mission.descriptions import describe_value
from executive.mission.findings import Finding, make_error
from executive.mission.source import Mark, Source
from executive.mission.text.scalars import ScalarValue, convert_scalar

_MAX_DEPTH = 50
"""Maximum depth of the nesting of lists and mappings."""
_SURROGATE = re.compile("[\ud800-\udfff]")
_MAX_NODE_COUNT = 20_000
"""Maximum number of keys and values; those of an anchor count again for each alias."""
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
_TOO_DEEP = f"lists and mappings are nested more than {_MAX_DEPTH} levels deep"


@dataclass(frozen=True)
class YamlScalar:
    """A value that is no list or mapping; `text` is its text in the file without quotes."""

    mark: Mark
    value: ScalarValue
    text: str


@dataclass(frozen=True)
class YamlSequence:
    """A list of nodes."""

    mark: Mark
    items: tuple[YamlNode, ...]


@dataclass(frozen=True)
class YamlEntry:
    """`key: value` in a mapping."""

    key: YamlScalar
    value: YamlNode


@dataclass(frozen=True)
class YamlMapping:
    """Entries with unique keys, in the order of the text."""

    mark: Mark
    entries: tuple[YamlEntry, ...]

    def get_entry(self, key: str) -> YamlEntry | None:
        """Return the entry of `key`, or None."""
        return next((entry for entry in self.entries if entry.key.text == key), None)

    def get(self, key: str) -> YamlNode | None:
        """Return the value of `key`, or None."""
        entry = self.get_entry(key)
        return entry.value if entry else None

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys in the order of the text."""
        return tuple(entry.key.text for entry in self.entries)


YamlNode = YamlScalar | YamlSequence | YamlMapping


def to_python_value(node: YamlNode) -> JsonValue:
    """Return the node as plain Python values."""
    if isinstance(node, YamlScalar):
        return node.value
    if isinstance(node, YamlSequence):
        return [to_python_value(item) for item in node.items]
    return {entry.key.text: to_python_value(entry.value) for entry in node.entries}


def describe_node(node: YamlNode) -> str:
    """Return a description of the value of a node, for the end of a sentence."""
    return describe_value(to_python_value(node))


def iterate_scalars(node: YamlNode) -> Iterator[YamlScalar]:
    """Yield every scalar of a node in the order of the text, without keys."""
    if isinstance(node, YamlScalar):
        yield node
        return
    for part in node.items if isinstance(node, YamlSequence) else (entry.value for entry in node.entries):
        yield from iterate_scalars(part)


def parse_yaml(source: Source) -> tuple[YamlNode | None, list[Finding]]:
    """Return the root node, or None if an error prevents a complete tree, and the findings."""
    composer = _Composer(source)
    try:
        root = composer.read_document()
    except yaml.MarkedYAMLError as problem:
        return None, [*composer.findings, _make_syntax_error(source, problem)]
    except yaml.reader.ReaderError as problem:
        return None, [*composer.findings, _make_character_error(source, problem)]
    except _IncompleteTree:
        return None, composer.findings
    return root, composer.findings


class _IncompleteTree(Exception):
    """An error prevents a complete tree; the findings contain the error."""


class _Composer:
    """Composes the tree of nodes from PyYAML's events, and collects findings."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.findings: list[Finding] = []
        # Unlike the parser of libyaml, the Python parser has the same messages in every installation.
        self._events: Iterator[yaml.Event] = yaml.parse(source.text, Loader=yaml.SafeLoader)
        # Node, and number of keys and values in it, of each anchor.
        self._anchors: dict[str, tuple[YamlNode, int]] = {}
        self._node_count = 0

    def read_document(self) -> YamlNode:
        next(self._events)  # StreamStartEvent
        if isinstance(next(self._events), yaml.StreamEndEvent):
            raise self._make_fatal_error(self.source.make_mark(), "empty", "the file is empty")
        root = self._read_node(next(self._events), 0)
        next(self._events)  # DocumentEndEvent
        following = next(self._events)
        if not isinstance(following, yaml.StreamEndEvent):
            message = 'a second document starts here, after "---"'
            raise self._make_fatal_error(self._make_mark(following, 3), "two-documents", message)
        return root

    def _read_node(self, event: yaml.Event, depth: int) -> YamlNode:
        if isinstance(event, yaml.AliasEvent):
            return self._resolve_alias(event, depth)
        # PyYAML checks the YAML grammar, so that only these events can start a node.
        assert isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent)
        count_before = self._node_count
        self._count_nodes(1, event)
        if event.tag is not None:
            self._add_error(self._make_mark(event), "tag", f'the tag "{event.tag}" is not allowed')
        node = self._read_value(event, depth)
        if event.anchor is not None:
            self._anchors[event.anchor] = node, self._node_count - count_before
        return node

    def _resolve_alias(self, event: yaml.AliasEvent, depth: int) -> YamlNode:
        if event.anchor not in self._anchors:
            message = f'there is no anchor "&{event.anchor}" above'
            raise self._make_fatal_error(self._make_mark(event), "alias", message)
        node, node_count = self._anchors[event.anchor]
        if depth + _compute_height(node) > _MAX_DEPTH:
            raise self._make_fatal_error(self._make_mark(event), "too-deep", _TOO_DEEP)
        self._count_nodes(node_count, event)
        return node

    def _count_nodes(self, count: int, event: yaml.Event) -> None:
        """Add to the number of keys and values.

        Raises:
            _IncompleteTree: The file has more than `_MAX_NODE_COUNT` keys and values.
        """
        self._node_count += count
        if self._node_count > _MAX_NODE_COUNT:
            message = f"the file has more than {_MAX_NODE_COUNT} keys and values, including those of aliases"
            raise self._make_fatal_error(self._make_mark(event), "too-large", message)

    def _read_value(self, event: yaml.Event, depth: int) -> YamlNode:
        if isinstance(event, yaml.ScalarEvent):
            return self._read_scalar(event)
        if depth >= _MAX_DEPTH:
            raise self._make_fatal_error(self._make_mark(event, 1), "too-deep", _TOO_DEEP)
        if isinstance(event, yaml.SequenceStartEvent):
            items = []
            while not isinstance(item := next(self._events), yaml.SequenceEndEvent):
                items.append(self._read_node(item, depth + 1))
            return YamlSequence(self._make_mark(event, 1), tuple(items))
        return self._read_mapping(event, depth)

    def _read_scalar(self, event: yaml.ScalarEvent) -> YamlScalar:
        text, mark = event.value, self._make_mark(event)
        if _SURROGATE.search(text):
            # An escape sequence can produce a surrogate, which cannot be encoded in UTF-8.
            self._add_error(mark, "yaml", "a surrogate (U+D800 to U+DFFF) is no character")
            text = _SURROGATE.sub("?", text)
        return YamlScalar(mark, convert_scalar(text) if event.implicit[0] else text, text)

    def _read_mapping(self, event: yaml.Event, depth: int) -> YamlMapping:
        entries: dict[str, YamlEntry] = {}
        while not isinstance(start := next(self._events), yaml.MappingEndEvent):
            key = self._read_node(start, depth + 1)
            value = self._read_node(next(self._events), depth + 1)
            if not isinstance(key, YamlScalar):
                self._add_error(key.mark, "bad-key", "a key must be a single word")
            elif key.text == "<<":
                message = 'the merge key "<<" is not allowed; write the merged keys here'
                self._add_error(key.mark, "merge-key", message)
            elif key.text in entries:
                first_line = entries[key.text].key.mark.line
                message = f'the key "{key.text}" occurs twice here; the first is in line {first_line}'
                self._add_error(key.mark, "duplicate-key", message)
            else:
                entries[key.text] = YamlEntry(key, value)
        return YamlMapping(self._make_mark(event, 1), tuple(entries.values()))

    def _make_mark(self, event: yaml.Event, length: int = 0) -> Mark:
        """Return the position of an event; by default, the rest of its line in the event is underlined."""
        start, end = event.start_mark, event.end_mark
        assert start is not None and end is not None, "PyYAML locates every event"
        if not length:
            is_single_line = start.line == end.line
            length = max(1, end.column - start.column) if is_single_line else 1000
        return Mark(self.source, start.line + 1, start.column + 1, length)

    def _make_fatal_error(self, mark: Mark, code: str, message: str) -> _IncompleteTree:
        """Add an error that prevents a complete tree, and return the exception to raise."""
        self._add_error(mark, code, message)
        return _IncompleteTree()

    def _add_error(self, mark: Mark, code: str, message: str) -> None:
        self.findings.append(make_error(mark, code, message))


def _compute_height(node: YamlNode) -> int:
    """Return the depth of the nesting in a node; 0 for a scalar."""
    if isinstance(node, YamlScalar):
        return 0
    inner = node.items if isinstance(node, YamlSequence) else [entry.value for entry in node.entries]
    return 1 + max(map(_compute_height, inner), default=0)


def _make_syntax_error(source: Source, problem: yaml.MarkedYAMLError) -> Finding:
    position = problem.problem_mark or problem.context_mark
    mark = source.make_mark(position.line + 1, position.column + 1, 1) if position else source.make_mark()
    if position and not source.get_line(mark.line):
        # The error is at the end of the text, so the finding shows the last line that is not empty.
        last = source.text.rstrip().count("\n") + 1
        mark = source.make_mark(last, max(1, len(source.get_line(last))), 1)
    context = f" {problem.context}" if problem.context else ""
    start = problem.context_mark
    note = f" that began in line {start.line + 1}" if context and start and start is not position else ""
    message = f"not valid YAML:{context}{note}: {problem.problem}".replace("::", ":")
    hints = (hint for begin, hint in _ADVICE_BY_MESSAGE.items() if str(problem.problem).startswith(begin))
    return make_error(mark, "yaml", message, next(hints, ""))


def _make_character_error(source: Source, problem: yaml.reader.ReaderError) -> Finding:
    lines = source.text[: problem.position + 1].splitlines()
    line, col = len(lines), len(lines[-1])
    character = source.text[problem.position : problem.position + 1]
    mark = source.make_mark(line, col, 1)
    return make_error(mark, "yaml", f"the character {character!r} is not allowed in YAML")
