"""Checks of the constants of control nodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from executive.mission.check.case import Case
from executive.mission.findings import Finding, error
from executive.mission.model import grammar, nodes
from executive.mission.model.grammar import Key
from executive.mission.model.nodes import Node
from executive.mission.model.typed import WrongType, convert
from executive.mission.model.values import Literal, Reference, Value
from executive.mission.words import describe

_KINDS: Mapping[str, Any] = {"integer": int, "number": float, "boolean": bool}


def constants(case: Case) -> Iterator[Finding]:
    """Find every constant of a control node that is none, out of bounds, or not known before the run."""
    for node in case.nodes():
        for name, key, value in _constants(node):
            if value is not None and (problem := _problem(case, name, key, value, node)):
                yield problem
        if isinstance(node, nodes.ForEachNode) and isinstance(node.source, Literal):
            yield from _list(node.source)


def _constants(node: Node) -> Iterator[tuple[str, Key, Value | None]]:
    """Yield every constant of a node: its name in the file, what is declared of it, its value."""
    word = node.word
    keys = grammar.CONTROL[word].keys if word in grammar.CONTROL else {}
    for name, key in keys.items():
        if key.kind in _KINDS or key.kind == "count":
            yield f"{word}.{name}", key, getattr(node, name)
    if isinstance(node, nodes.RetryNode) and node.backoff is not None:
        for name, key in grammar.BACKOFF.items():
            yield f"backoff.{name}", key, getattr(node.backoff, name)


def _problem(case: Case, name: str, key: Key, value: Value, node: Node) -> Finding | None:
    if isinstance(value, Reference):
        message = f"{name} is a constant, and ${value.name} is neither param nor argument here"
        return error(value.mark, "unknown-param", message, case.constant_hint(value))
    if key.kind == "count":
        return _count_problem(name, value, node)
    try:
        number = convert(value.value, _KINDS[key.kind])
    except WrongType as problem:
        meant = f"For the param write ${value.value}." if value.value in [*case.mission.params] else ""
        return error(value.mark, "wrong-type", f"{name} {problem}{value.origin_note}", meant)
    if key.kind == "boolean" or key.allows(number):
        return None
    unit = " s" if "[s]" in key.doc else ""
    message = f"{name} must be {key.bounds}{unit}, not {describe(value.value)}{value.origin_note}"
    return error(value.mark, "out-of-range", message)


def _count_problem(name: str, value: Literal, node: Node) -> Finding | None:
    total, count = len(node.children), value.value
    if count in ("all", "any", "lead") or (type(count) is int and 1 <= count <= total):
        return None
    wanted = f"{name} must be all, any, lead or a number from 1 to {total}"
    message = f"{wanted}, not {describe(count)}{value.origin_note}"
    return error(value.mark, "out-of-range" if type(count) is int else "wrong-type", message)


def _list(value: Literal) -> Iterator[Finding]:
    if not isinstance(value.value, list):
        message = f"for_each.in takes a list or a variable, not {describe(value.value)}{value.origin_note}"
        listed = isinstance(value.value, str) and not value.origin
        yield error(value.mark, "wrong-type", message, f"Write a list: [{value.value}]." if listed else "")
