"""Parser of YAML text to a tree of nodes with their places in the text.

The parser supports mappings with text keys, sequences and scalars of YAML 1.2. Tags and merge keys are
refused and the size of the tree is limited, so a file can neither execute code nor exhaust the memory.
The node of an alias has the place of its anchor.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import yaml
from pydantic import JsonValue

from executive.mission.findings import Finding, error
from executive.mission.source import Mark, Source
from executive.mission.text.scalars import ScalarValue, core_value

_MAX_DEPTH = 50
_SURROGATE = re.compile("[\ud800-\udfff]")
_MAX_NODES = 20_000
_ADVICE = {
    "mapping values are not allowed here": (
        "Is a colon missing at the end of the line above, or are braces, as in Detect: {view: full}? "
        'A text that holds ": " needs quotes.'
    ),
    "found character '\\t' that cannot start any token": "Indent with blanks instead of tabs.",
    "expected <block end>": "Compare the indentation with the lines above.",
    "expected ',' or": "A bracket or brace that was opened is not closed.",
}
"""Advice on syntax errors, by the start of PyYAML's message."""


@dataclass(frozen=True)
class Scalar:
    """A single value; `text` is its text in the file without quotes."""

    mark: Mark
    value: ScalarValue
    text: str


@dataclass(frozen=True)
class YamlSequence:
    """A list."""

    mark: Mark
    items: tuple[Node, ...]


@dataclass(frozen=True)
class Entry:
    """One `key: value`."""

    key: Scalar
    value: Node


@dataclass(frozen=True)
class Mapping:
    """Entries with different keys, in the order of the text."""

    mark: Mark
    entries: tuple[Entry, ...]

    def entry(self, key: str) -> Entry | None:
        """Return the entry of `key`, or None."""
        return next((entry for entry in self.entries if entry.key.text == key), None)

    def get(self, key: str) -> Node | None:
        """Return the value of `key`, or None."""
        entry = self.entry(key)
        return entry.value if entry else None

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys in the order of the text."""
        return tuple(entry.key.text for entry in self.entries)


Node = Scalar | YamlSequence | Mapping


def plain(node: Node) -> JsonValue:
    """Return the node as plain Python values."""
    if isinstance(node, Scalar):
        return node.value
    if isinstance(node, YamlSequence):
        return [plain(item) for item in node.items]
    return {entry.key.text: plain(entry.value) for entry in node.entries}


def scalars(node: Node) -> Iterator[Scalar]:
    """Yield every scalar of a node in the order of the text, without keys."""
    if isinstance(node, Scalar):
        yield node
        return
    for part in node.items if isinstance(node, YamlSequence) else (entry.value for entry in node.entries):
        yield from scalars(part)


def parse_yaml(source: Source) -> tuple[Node | None, list[Finding]]:
    """Return the root node, or None if the tree is incomplete, and the findings."""
    composer = _Composer(source)
    try:
        root = composer.read_document()
    except yaml.MarkedYAMLError as problem:
        return None, [*composer.findings, _describe_syntax_error(source, problem)]
    except yaml.reader.ReaderError as problem:
        return None, [*composer.findings, _describe_invalid_character(source, problem)]
    except _IncompleteTree:
        return None, composer.findings
    return root, composer.findings


class _IncompleteTree(Exception):
    """The tree cannot be completed; the findings contain the reason."""


class _Composer:
    """Builds nodes from PyYAML's events and collects findings."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.findings: list[Finding] = []
        # The messages of the parser in Python do not depend on the installed version of libyaml.
        self._events: Iterator[yaml.Event] = yaml.parse(source.text, Loader=yaml.SafeLoader)
        self._anchors: dict[str, tuple[Node, int]] = {}
        self._count = 0

    def read_document(self) -> Node:
        next(self._events)  # StreamStartEvent
        if isinstance(next(self._events), yaml.StreamEndEvent):
            raise self._abort(self.source.mark(), "empty", "the file is empty")
        root = self._read_node(next(self._events), 0)
        next(self._events)  # DocumentEndEvent
        after = next(self._events)
        if not isinstance(after, yaml.StreamEndEvent):
            raise self._abort(
                self._mark_of(after, 3), "two-documents", 'a second document starts here, after "---"'
            )
        return root

    def _read_node(self, event: yaml.Event, depth: int) -> Node:
        if isinstance(event, yaml.AliasEvent):
            return self._resolve_alias(event, depth)
        # The parser checks the grammar, so only these events start a node.
        assert isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent)
        before = self._count
        self._count_nodes(1, event)
        if event.tag is not None:
            self._refuse(self._mark_of(event), "tag", f'the tag "{event.tag}" is not allowed')
        node = self._read_value(event, depth)
        if event.anchor is not None:
            self._anchors[event.anchor] = node, self._count - before
        return node

    def _resolve_alias(self, event: yaml.AliasEvent, depth: int) -> Node:
        if event.anchor not in self._anchors:
            raise self._abort(self._mark_of(event), "alias", f'nothing above is marked "&{event.anchor}"')
        node, size = self._anchors[event.anchor]
        if depth + _height(node) > _MAX_DEPTH:
            raise self._abort(self._mark_of(event), "too-deep", f"nested more than {_MAX_DEPTH} levels deep")
        self._count_nodes(size, event)
        return node

    def _count_nodes(self, count: int, event: yaml.Event) -> None:
        """Count keys and values.

        Raises:
            _IncompleteTree: The file has too many keys and values.
        """
        self._count += count
        if self._count > _MAX_NODES:
            message = f"the file has more than {_MAX_NODES} keys and values, those behind aliases included"
            raise self._abort(self._mark_of(event), "too-large", message)

    def _read_value(self, event: yaml.Event, depth: int) -> Node:
        if isinstance(event, yaml.ScalarEvent):
            return self._read_scalar(event)
        if depth >= _MAX_DEPTH:
            raise self._abort(
                self._mark_of(event, 1), "too-deep", f"nested more than {_MAX_DEPTH} levels deep"
            )
        if isinstance(event, yaml.SequenceStartEvent):
            items = []
            while not isinstance(item := next(self._events), yaml.SequenceEndEvent):
                items.append(self._read_node(item, depth + 1))
            return YamlSequence(self._mark_of(event, 1), tuple(items))
        return self._read_mapping(event, depth)

    def _read_scalar(self, event: yaml.ScalarEvent) -> Scalar:
        text, mark = event.value, self._mark_of(event)
        if _SURROGATE.search(text):
            # An escape sequence can contain a surrogate, which cannot be encoded in UTF-8.
            self._refuse(mark, "yaml", "half of a surrogate pair is no character")
            text = _SURROGATE.sub("?", text)
        return Scalar(mark, core_value(text) if event.implicit[0] else text, text)

    def _read_mapping(self, event: yaml.Event, depth: int) -> Mapping:
        entries: dict[str, Entry] = {}
        while not isinstance(start := next(self._events), yaml.MappingEndEvent):
            key = self._read_node(start, depth + 1)
            value = self._read_node(next(self._events), depth + 1)
            if not isinstance(key, Scalar):
                self._refuse(key.mark, "bad-key", "a key must be a single word")
            elif key.text == "<<":
                self._refuse(key.mark, "merge-key", 'the merge key "<<" is not allowed; write the keys out')
            elif key.text in entries:
                first = entries[key.text].key.mark.line
                message = f'the key "{key.text}" stands here twice; the first is in line {first}'
                self._refuse(key.mark, "duplicate-key", message)
            else:
                entries[key.text] = Entry(key, value)
        return Mapping(self._mark_of(event, 1), tuple(entries.values()))

    def _mark_of(self, event: yaml.Event, length: int = 0) -> Mark:
        start, end = event.start_mark, event.end_mark
        assert start is not None and end is not None, "the parser marks every event"
        if not length:
            same_line = start.line == end.line
            length = max(1, end.column - start.column) if same_line else 1000
        return Mark(self.source, start.line + 1, start.column + 1, length)

    def _abort(self, mark: Mark, code: str, message: str) -> _IncompleteTree:
        """Add a finding that prevents a complete tree, and return the exception to raise."""
        self._refuse(mark, code, message)
        return _IncompleteTree()

    def _refuse(self, mark: Mark, code: str, message: str) -> None:
        self.findings.append(error(mark, code, message))


def _height(node: Node) -> int:
    if isinstance(node, Scalar):
        return 0
    inner = node.items if isinstance(node, YamlSequence) else [entry.value for entry in node.entries]
    return 1 + max(map(_height, inner), default=0)


def _describe_syntax_error(source: Source, problem: yaml.MarkedYAMLError) -> Finding:
    place = problem.problem_mark or problem.context_mark
    mark = source.mark(place.line + 1, place.column + 1, 1) if place else source.mark()
    if place and not source.line(mark.line):
        # The text ends too early, so the finding shows the last line with text.
        written = source.text.rstrip()
        last = written.count("\n") + 1
        mark = source.mark(last, max(1, len(source.line(last))), 1)
    context = f" {problem.context}" if problem.context else ""
    began = problem.context_mark
    since = f" that began in line {began.line + 1}" if context and began and began is not place else ""
    message = f"not valid YAML:{context}{since}: {problem.problem}".replace("::", ":")
    text_of_problem = str(problem.problem)
    advice = next((advice for begin, advice in _ADVICE.items() if text_of_problem.startswith(begin)), "")
    return error(mark, "yaml", message, advice)


def _describe_invalid_character(source: Source, problem: yaml.reader.ReaderError) -> Finding:
    lines = source.text[: problem.position + 1].splitlines()
    line, col = len(lines), len(lines[-1])
    character = source.text[problem.position : problem.position + 1]
    return error(source.mark(line, col, 1), "yaml", f"the character {character!r} is not allowed in YAML")
