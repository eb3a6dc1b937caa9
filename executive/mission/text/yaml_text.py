"""YAML text as a tree of nodes that know where they stand.

Only what a mission needs is read: mappings with text keys, sequences and scalars of YAML 1.2.
Tags and merge keys are refused, and aliases may not blow the tree up, so no file can run code or
grow in memory. What an alias stands for keeps the place where it is written out.
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
"""What to do about problems that PyYAML names in words of its own trade, by how they begin."""


@dataclass(frozen=True)
class Scalar:
    """A single value; `text` is how it is written, without quotes."""

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
    """A list of `key: value` with different keys, in the order of the text."""

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
    """Yield every single value of the node and below it, in the order of the text; keys are none."""
    if isinstance(node, Scalar):
        yield node
        return
    for part in node.items if isinstance(node, YamlSequence) else (entry.value for entry in node.entries):
        yield from scalars(part)


def parse_yaml(source: Source) -> tuple[Node | None, list[Finding]]:
    """Return the root node, or None where there is no sound tree, and what is wrong with the text."""
    composer = _Composer(source)
    try:
        root = composer.document()
    except yaml.MarkedYAMLError as problem:
        return None, [*composer.findings, _syntax(source, problem)]
    except yaml.reader.ReaderError as problem:
        return None, [*composer.findings, _unreadable(source, problem)]
    except _Unsound:
        return None, composer.findings
    return root, composer.findings


class _Unsound(Exception):
    """The tree cannot be completed; the findings say why."""


class _Composer:
    """Builds nodes from PyYAML's events and collects what is wrong."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.findings: list[Finding] = []
        # The parser in Python: its messages do not change with the libyaml that happens to be there.
        self._events: Iterator[yaml.Event] = yaml.parse(source.text, Loader=yaml.SafeLoader)
        self._anchors: dict[str, tuple[Node, int]] = {}
        self._count = 0

    def document(self) -> Node:
        next(self._events)  # the stream's start
        if isinstance(next(self._events), yaml.StreamEndEvent):
            raise self._unsound(self.source.mark(), "empty", "the file is empty")
        root = self._node(next(self._events), 0)
        next(self._events)  # the document's end
        after = next(self._events)
        if not isinstance(after, yaml.StreamEndEvent):
            raise self._unsound(
                self._mark(after, 3), "two-documents", 'a second document starts here, after "---"'
            )
        return root

    def _node(self, event: yaml.Event, depth: int) -> Node:
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event, depth)
        # Only these events begin a node: the parser checks the grammar.
        assert isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent)
        before = self._count
        self._add(1, event)
        if event.tag is not None:
            self._refuse(self._mark(event), "tag", f'the tag "{event.tag}" is not allowed')
        node = self._value(event, depth)
        if event.anchor is not None:
            self._anchors[event.anchor] = node, self._count - before
        return node

    def _alias(self, event: yaml.AliasEvent, depth: int) -> Node:
        if event.anchor not in self._anchors:
            raise self._unsound(self._mark(event), "alias", f'nothing above is marked "&{event.anchor}"')
        node, size = self._anchors[event.anchor]
        if depth + _height(node) > _MAX_DEPTH:
            raise self._unsound(self._mark(event), "too-deep", f"nested more than {_MAX_DEPTH} levels deep")
        self._add(size, event)
        return node

    def _add(self, count: int, event: yaml.Event) -> None:
        """Count keys and values.

        Raises:
            _Unsound: There are too many.
        """
        self._count += count
        if self._count > _MAX_NODES:
            message = f"the file has more than {_MAX_NODES} keys and values, those behind aliases included"
            raise self._unsound(self._mark(event), "too-large", message)

    def _value(self, event: yaml.Event, depth: int) -> Node:
        if isinstance(event, yaml.ScalarEvent):
            return self._scalar(event)
        if depth >= _MAX_DEPTH:
            raise self._unsound(
                self._mark(event, 1), "too-deep", f"nested more than {_MAX_DEPTH} levels deep"
            )
        if isinstance(event, yaml.SequenceStartEvent):
            items = []
            while not isinstance(item := next(self._events), yaml.SequenceEndEvent):
                items.append(self._node(item, depth + 1))
            return YamlSequence(self._mark(event, 1), tuple(items))
        return self._mapping(event, depth)

    def _scalar(self, event: yaml.ScalarEvent) -> Scalar:
        text, mark = event.value, self._mark(event)
        if _SURROGATE.search(text):
            # An escape can name one; no file or terminal can take it.
            self._refuse(mark, "yaml", "half of a surrogate pair is no character")
            text = _SURROGATE.sub("?", text)
        return Scalar(mark, core_value(text) if event.implicit[0] else text, text)

    def _mapping(self, event: yaml.Event, depth: int) -> Mapping:
        entries: dict[str, Entry] = {}
        while not isinstance(start := next(self._events), yaml.MappingEndEvent):
            key = self._node(start, depth + 1)
            value = self._node(next(self._events), depth + 1)
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
        return Mapping(self._mark(event, 1), tuple(entries.values()))

    def _mark(self, event: yaml.Event, length: int = 0) -> Mark:
        start, end = event.start_mark, event.end_mark
        assert start is not None and end is not None, "the parser marks every event"
        if not length:
            same_line = start.line == end.line
            length = max(1, end.column - start.column) if same_line else 1000
        return Mark(self.source, start.line + 1, start.column + 1, length)

    def _unsound(self, mark: Mark, code: str, message: str) -> _Unsound:
        """Add a finding after which the tree cannot be completed, and return the exception to raise."""
        self._refuse(mark, code, message)
        return _Unsound()

    def _refuse(self, mark: Mark, code: str, message: str) -> None:
        self.findings.append(error(mark, code, message))


def _height(node: Node) -> int:
    if isinstance(node, Scalar):
        return 0
    inner = node.items if isinstance(node, YamlSequence) else [entry.value for entry in node.entries]
    return 1 + max(map(_height, inner), default=0)


def _syntax(source: Source, problem: yaml.MarkedYAMLError) -> Finding:
    place = problem.problem_mark or problem.context_mark
    mark = source.mark(place.line + 1, place.column + 1, 1) if place else source.mark()
    if place and not source.line(mark.line):
        # The text ended too early: show its last line instead of nothing.
        written = source.text.rstrip()
        last = written.count("\n") + 1
        mark = source.mark(last, max(1, len(source.line(last))), 1)
    context = f" {problem.context}" if problem.context else ""
    began = problem.context_mark
    since = f" that began in line {began.line + 1}" if context and began and began is not place else ""
    message = f"not valid YAML:{context}{since}: {problem.problem}".replace("::", ":")
    said = str(problem.problem)
    advice = next((advice for begin, advice in _ADVICE.items() if said.startswith(begin)), "")
    return error(mark, "yaml", message, advice)


def _unreadable(source: Source, problem: yaml.reader.ReaderError) -> Finding:
    lines = source.text[: problem.position + 1].splitlines()
    line, col = len(lines), len(lines[-1])
    character = source.text[problem.position : problem.position + 1]
    return error(source.mark(line, col, 1), "yaml", f"the character {character!r} is not allowed in YAML")
