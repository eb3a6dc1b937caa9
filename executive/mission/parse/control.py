"""Control nodes, one function each: from the positioned nodes of a file to the nodes of a tree."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from executive.mission.model import grammar
from executive.mission.model import nodes as model
from executive.mission.model.values import Literal, Named, Value
from executive.mission.parse.fields import NAME, Fields, settings_of
from executive.mission.source import Mark
from executive.mission.text.yaml_text import Mapping, Node, Scalar, Sequence, plain
from executive.mission.words import describe

if TYPE_CHECKING:
    from executive.mission.parse.nodes import NodeParser

MAX_BRANCHES = 200
"""Largest number of branches of a parallel: every two of them are compared."""


class Head:
    """One control node in the file: the mapping it stands in, its word, its label, its value."""

    def __init__(self, node: Mapping, word: str, mark: Mark, label: str, value: Node) -> None:
        self.node, self.word, self.mark, self.label, self.value = node, word, mark, label, value


def unread(mark: Mark) -> model.Node:
    """Return a node for one that could not be read; a finding says why."""
    return model.UnknownNode(mark, "")


def _fields(parser: NodeParser, head: Head) -> Fields:
    return Fields(head.word, head.mark, head.value, grammar.CONTROL[head.word].keys, parser.findings)


def _sequence(parser: NodeParser, head: Head) -> model.Node:
    steps = parser.nodes(head.value, "sequence")
    return model.SequenceNode(head.mark, head.label, steps, listed=False) if steps else unread(head.mark)


def _fallback(parser: NodeParser, head: Head) -> model.Node:
    choices = parser.nodes(head.value, "fallback")
    return model.FallbackNode(head.mark, head.label, choices) if choices else unread(head.mark)


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
        return unread(head.mark)
    if len(branches) > MAX_BRANCHES:
        message = f"a parallel has at most {MAX_BRANCHES} branches, not {len(branches)}"
        parser.refuse(head.mark, "too-large", message)
        return unread(head.mark)
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
    if fields.get("each") is not None and not NAME.fullmatch(each.name):
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
    if isinstance(caught, Sequence) and not caught.items:
        parser.refuse(caught.mark, "empty-list", "catch needs at least one on and do")
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
        return unread(head.mark)
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
