"""From positioned nodes to the nodes of a mission's tree; one function per control node."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace

from executive.mission.findings import Finding, alternatives, error, suggest
from executive.mission.model import grammar
from executive.mission.model import nodes as model
from executive.mission.model.values import Literal, Named, Value
from executive.mission.parse.fields import NAME, Fields, settings_of
from executive.mission.source import Mark
from executive.mission.text.yaml_text import Entry, Mapping, Node, Scalar, Sequence, plain
from executive.mission.words import describe

_LABEL = re.compile(grammar.LABEL)
_SKILL = re.compile(r"[A-Z][A-Za-z0-9]*")


class NodeParser:
    """Reads the nodes of one mission file; what is wrong goes to `findings`.

    A node that cannot be read becomes an unknown one, so that reading goes on.
    """

    def __init__(self, findings: list[Finding]) -> None:
        self.findings = findings

    def node(self, node: Node | None, mark: Mark) -> model.Node:
        """Return the node that stands in the file, or an unknown one where there is none."""
        if node is None or (isinstance(node, Scalar) and node.value is None):
            if node is not None:
                self.refuse(mark, "missing-node", "a node is missing here")
            return _nothing(mark)
        if isinstance(node, Sequence):
            return self._list(node)
        if isinstance(node, Scalar):
            return self._word(node)
        return self._mapping(node)

    def nodes(self, node: Node, owner: str) -> tuple[model.Node, ...]:
        """Return the nodes of a list."""
        if not isinstance(node, Sequence):
            self.refuse(
                node.mark, "wrong-type", f"{owner} takes a list of nodes, not {describe(plain(node))}"
            )
            return ()
        if not node.items:
            self.refuse(node.mark, "empty-list", f"{owner} needs at least one node")
        return tuple(self.node(item, item.mark) for item in node.items)

    def refuse(self, mark: Mark, code: str, message: str, hint: str = "") -> None:
        """Record an error."""
        self.findings.append(error(mark, code, message, hint))

    def _list(self, node: Sequence) -> model.Node:
        steps = self.nodes(node, "a list of steps")
        return model.SequenceNode(node.mark, "", steps) if steps else _nothing(node.mark)

    def _word(self, node: Scalar) -> model.Node:
        word = node.text
        if word == "succeed":
            return model.SucceedNode(node.mark, "", None)
        if isinstance(node.value, str) and _SKILL.fullmatch(word):
            return model.SkillNode(node.mark, "", word, {})
        if word in CONTROL:
            self.refuse(node.mark, "missing-node", f'"{word}" needs a body: write {word}: ...')
        else:
            self._unknown(node.mark, word)
        return _nothing(node.mark)

    def _mapping(self, node: Mapping) -> model.Node:
        label = self._label(node)
        words = [entry for entry in node.entries if entry.key.text != "as"]
        heads = [e for e in words if e.key.text in CONTROL or _SKILL.fullmatch(e.key.text)]
        if not heads:
            for entry in words:
                self._unknown(entry.key.mark, entry.key.text)
            if not words:
                self.refuse(node.mark, "missing-node", "a node is missing here: the mapping names none")
            return _nothing(node.mark)
        head, *others = heads
        for entry in others:
            message = f'"{head.key.text}" and "{entry.key.text}" stand in one node; a node has one name'
            self.refuse(entry.key.mark, "two-nodes", message, "Write a list to run one after the other.")
        if others:
            # What the others lack is not worth telling as long as they stand in the wrong place.
            parts = [NodeParser([])._head(node, other, "") for other in others]
            return model.UnknownNode(head.key.mark, label, (self._head(node, head, ""), *parts))
        name = head.key.text
        partners = grammar.CONTROL[name].partners if name in grammar.CONTROL else ()
        allowed = (name, "as", *partners)
        for entry in words:
            if entry not in heads and entry.key.text not in allowed:
                hint = alternatives(entry.key.text, allowed[1:], f"Beside {name} may stand")
                message = f'"{entry.key.text}" may not stand beside "{name}"'
                self.refuse(entry.key.mark, "unknown-key", message, hint)
        read = self._head(node, head, label)
        return replace(read, label_mark=written.mark) if (written := node.get("as")) else read

    def _head(self, node: Mapping, head: Entry, label: str) -> model.Node:
        """Return the node of one word in a mapping, with the partners that stand beside it."""
        name = head.key.text
        if name in CONTROL:
            return CONTROL[name](self, Head(node, name, head.key.mark, label, head.value))
        settings = settings_of(head.value, name, self.findings)
        return model.SkillNode(head.key.mark, label, name, settings)

    def _label(self, node: Mapping) -> str:
        written = node.get("as")
        if written is None:
            return ""
        if isinstance(written, Scalar) and isinstance(written.value, str) and _LABEL.fullmatch(written.text):
            return written.text
        shown = f'"{written.text}"' if isinstance(written, Scalar) else describe(plain(written))
        message = f"a label is a lower-case word, not {shown}"
        self.refuse(written.mark, "bad-label", message)
        return ""

    def _unknown(self, mark: Mark, word: str) -> None:
        hint = alternatives(word, CONTROL, "Control nodes are")
        if word in grammar.ELSEWHERE:
            self.refuse(mark, "unknown-node", f'there is no control node "{word}"', grammar.ELSEWHERE[word])
            return
        if suggest(word, CONTROL) is None and NAME.fullmatch(word):
            skill = "".join(part[:1].upper() + part[1:] for part in word.split("_"))
            hint = f'If a skill is meant, write it as "{skill}". {hint}'
        self.refuse(mark, "unknown-node", f'there is no control node "{word}"', hint)


class Head:
    """One control node in the file: the mapping it stands in, its word, its label, its value."""

    def __init__(self, node: Mapping, word: str, mark: Mark, label: str, value: Node) -> None:
        self.node, self.word, self.mark, self.label, self.value = node, word, mark, label, value


def _nothing(mark: Mark) -> model.Node:
    return model.UnknownNode(mark, "")


def _fields(parser: NodeParser, head: Head) -> Fields:
    return Fields(head.word, head.mark, head.value, grammar.CONTROL[head.word].keys, parser.findings)


def _sequence(parser: NodeParser, head: Head) -> model.Node:
    steps = parser.nodes(head.value, "sequence")
    return model.SequenceNode(head.mark, head.label, steps, listed=False) if steps else _nothing(head.mark)


def _fallback(parser: NodeParser, head: Head) -> model.Node:
    choices = parser.nodes(head.value, "fallback")
    return model.FallbackNode(head.mark, head.label, choices) if choices else _nothing(head.mark)


def _parallel(parser: NodeParser, head: Head) -> model.Node:
    wait_for: Value = Literal("all", head.mark)
    halt: Value = Literal(False, head.mark)
    body: Node | None = head.value
    if not isinstance(head.value, Sequence):
        fields = _fields(parser, head)
        wait_for, halt = fields.value("wait_for") or wait_for, fields.value("halt") or halt
        body = fields.required("do")
    branches = () if body is None else parser.nodes(body, "parallel")
    if not branches:
        return _nothing(head.mark)
    return model.ParallelNode(head.mark, head.label, branches, wait_for, halt)


def _retry(parser: NodeParser, head: Head) -> model.Node:
    fields = _fields(parser, head)
    fields.required("attempts")
    attempts = fields.value("attempts") or Literal(1, head.mark)
    recover = fields.get("recover")
    return model.RetryNode(
        head.mark,
        head.label,
        attempts,
        fields.matches("on"),
        None if recover is None else parser.node(recover, fields.key_mark("recover")),
        _backoff(parser, fields),
        parser.node(fields.required("do"), fields.key_mark("do")),
    )


def _backoff(parser: NodeParser, fields: Fields) -> model.Backoff | None:
    node = fields.get("backoff")
    same: Value = Literal(1.0, fields.key_mark("backoff"))
    if not isinstance(node, Mapping):
        first = fields.value("backoff")
        return None if first is None else model.Backoff(first, same, None)
    inner = Fields("backoff", fields.key_mark("backoff"), node, grammar.BACKOFF, parser.findings)
    inner.required("first")
    first = inner.value("first")
    if first is None:
        return None
    return model.Backoff(first, inner.value("factor") or same, inner.value("most"))


def _repeat(parser: NodeParser, head: Head) -> model.Node:
    fields = _fields(parser, head)
    times, until = fields.value("times"), fields.matches("until")
    if fields.sound and fields.get("times") is None and fields.get("until") is None:
        message = 'repeat needs one of "until" and "times", to know when it is done'
        parser.refuse(head.mark, "missing-key", message)
    body = parser.node(fields.required("do"), fields.key_mark("do"))
    return model.RepeatNode(head.mark, head.label, times, until, body)


def _while(parser: NodeParser, head: Head) -> model.Node:
    fields = _fields(parser, head)
    condition = parser.node(fields.required("condition"), fields.key_mark("condition"))
    body = parser.node(fields.required("do"), fields.key_mark("do"))
    return model.WhileNode(head.mark, head.label, condition, body)


def _for_each(parser: NodeParser, head: Head) -> model.Node:
    fields = _fields(parser, head)
    for key in ("each", "in"):
        fields.required(key)
    each = Named(fields.text("each"), fields.value_mark("each"))
    if each.name and not NAME.fullmatch(each.name):
        hint = "Write the bare name, for instance each: target; its value is $target."
        parser.refuse(each.mark, "bad-name", f'"{each.name}" cannot name a variable', hint)
        each = Named(each.name.removeprefix("$"), each.mark)
    source = fields.value("in")
    body = parser.node(fields.required("do"), fields.key_mark("do"))
    if source is None or not NAME.fullmatch(each.name):
        return model.UnknownNode(head.mark, head.label, (body,))
    return model.ForEachNode(head.mark, head.label, each, source, body)


def _try(parser: NodeParser, head: Head) -> model.Node:
    caught, finish = head.node.get("catch"), head.node.get("finally")
    if caught is None and finish is None:
        parser.refuse(head.mark, "missing-key", 'try needs a "catch" or a "finally" beside it')
    return model.TryNode(
        head.mark,
        head.label,
        parser.node(head.value, head.mark),
        () if caught is None else tuple(_catches(parser, caught)),
        None if finish is None else parser.node(finish, finish.mark),
    )


def _catches(parser: NodeParser, caught: Node) -> Iterator[model.Catch]:
    """Yield what is caught: as with `on`, one needs no list."""
    if not isinstance(caught, Sequence | Mapping):
        message = f'catch takes "on" and "do", or a list of them, not {describe(plain(caught))}'
        parser.refuse(caught.mark, "wrong-type", message)
        return
    for item in caught.items if isinstance(caught, Sequence) else (caught,):
        fields = Fields("catch", item.mark, item, grammar.CATCH, parser.findings)
        fields.required("on")
        body = parser.node(fields.required("do"), fields.key_mark("do"))
        yield model.Catch(fields.matches("on"), body)


def _timeout(parser: NodeParser, head: Head) -> model.Node:
    fields = _fields(parser, head)
    fields.required("seconds")
    seconds = fields.value("seconds") or Literal(1.0, head.mark)
    body = parser.node(fields.required("do"), fields.key_mark("do"))
    return model.TimeoutNode(head.mark, head.label, seconds, body)


def _invert(parser: NodeParser, head: Head) -> model.Node:
    return model.InvertNode(head.mark, head.label, parser.node(head.value, head.mark))


def _succeed(parser: NodeParser, head: Head) -> model.Node:
    empty = isinstance(head.value, Scalar) and head.value.value is None
    body = None if empty else parser.node(head.value, head.mark)
    return model.SucceedNode(head.mark, head.label, body)


def _use(parser: NodeParser, head: Head) -> model.Node:
    given = {key: head.node.get(key) for key in ("with", "returns")}
    arguments, returns = (
        {} if node is None else settings_of(node, key, parser.findings) for key, node in given.items()
    )
    if not (isinstance(head.value, Scalar) and isinstance(head.value.value, str)):
        message = f"use takes the name of a subtree, not {describe(plain(head.value))}"
        parser.refuse(head.value.mark, "wrong-type", message)
        return _nothing(head.mark)
    return model.UseNode(head.value.mark, head.label, head.value.text, arguments, returns)


CONTROL: dict[str, Callable[[NodeParser, Head], model.Node]] = {
    "sequence": _sequence,
    "fallback": _fallback,
    "parallel": _parallel,
    "retry": _retry,
    "repeat": _repeat,
    "while": _while,
    "for_each": _for_each,
    "try": _try,
    "timeout": _timeout,
    "invert": _invert,
    "succeed": _succeed,
    "use": _use,
}
"""Every control node by its word in the file."""
