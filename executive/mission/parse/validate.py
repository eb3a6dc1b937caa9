"""From positioned nodes to a pydantic model, or findings in our own words at the right places."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from types import NoneType
from typing import Generic, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from executive.mission.findings import Finding, alternatives, error
from executive.mission.source import Mark
from executive.mission.text.yaml_text import Mapping, Node, Scalar, YamlSequence, plain, scalars
from executive.mission.words import violation

M = TypeVar("M", bound=BaseModel)

_CODES = {
    "value_error": "wrong-value",
    "literal_error": "wrong-value",
    "too_long": "wrong-length",
    "too_short": "wrong-length",
}
"""Codes of findings by pydantic's kinds of errors; the others are wrong types."""

KeyPath = tuple[str | int, ...]
"""Keys and list indices from the root of a file to one value in it."""


@dataclass(frozen=True)
class Validated(Generic[M]):
    """A model, or None with the findings that say why."""

    model: M | None
    findings: tuple[Finding, ...]


def validate(root: Node, model: type[M]) -> Validated[M]:
    """Return the file's content as `model`: strict types, except that a whole number is a number too."""
    findings = list(_infinite(root))
    if findings:
        return Validated(None, tuple(findings))
    try:
        # JSON mode is the strict one in which lists become tuples and whole numbers floats.
        return Validated(model.model_validate_json(json.dumps(plain(root)), strict=True), ())
    except ValidationError as problems:
        found = [_finding(root, model, problem) for problem in problems.errors(include_url=False)]
        return Validated(None, tuple(found))


def mark_of(root: Node, path: KeyPath, of_key: bool = False) -> Mark:
    """Return where the value at `path`, or its key, stands, or where the last part that exists does."""
    node, mark = root, root.mark
    for step in path:
        if isinstance(node, Mapping) and (entry := node.entry(str(step))):
            node = entry.value
            mark = node.mark if isinstance(node, Scalar) and not of_key else entry.key.mark
        elif isinstance(node, YamlSequence) and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
            mark = node.mark
        else:
            break
    return mark


def dotted(path: KeyPath) -> str:
    """Return `("bins", "red", "size", 0)` as `bins.red.size[0]`."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return text.removeprefix(".")


def _finding(root: Node, model: type[BaseModel], problem: ErrorDetails) -> Finding:
    path: KeyPath = problem["loc"]
    kind = problem["type"]
    inside, last = path[:-1], path[-1] if path else ""
    if kind == "extra_forbidden":
        parent = _section(model, inside)
        owner = dotted(inside) or "the file"
        known = list(parent.model_fields) if parent else []
        hint = alternatives(str(last), known, f"{owner} takes")
        key = mark_of(root, path, of_key=True)
        return error(key, "unknown-key", f'{owner} has no key "{last}"', hint)
    if kind == "missing" and isinstance(last, int):
        given = len(problem["input"])
        message = f"{dotted(inside)} has {given} of the {_length(model, inside)} values it needs"
        return error(mark_of(root, inside), "wrong-length", message)
    if kind == "missing":
        owner = dotted(inside) or "the file"
        return error(mark_of(root, inside), "missing-key", f'{owner} needs the key "{last}"')
    if last == "[key]":
        return error(mark_of(root, inside, of_key=True), "bad-name", f"{dotted(inside)} {violation(problem)}")
    code = "out-of-range" if "than" in kind else _CODES.get(kind, "wrong-type")
    name = dotted(path) or "the file"
    return error(mark_of(root, path), code, f"{name} {violation(problem)}")


def _annotation(model: object, path: KeyPath) -> object:
    """Return the declared type of the value at `path`, or None where it cannot be told."""
    here: object = model
    for step in path:
        if isinstance(here, type) and issubclass(here, BaseModel):
            field = here.model_fields.get(str(step))
            here = _without_none(field.annotation) if field else None
        elif get_origin(here) is dict:
            here = get_args(here)[1]
        elif get_origin(here) in (tuple, list):
            here = get_args(here)[0]
        else:
            return None
    return here


def _without_none(annotation: object) -> object:
    """Return `T` for the declared type `T | None`, and any other type as it is."""
    kinds = [kind for kind in get_args(annotation) if kind is not NoneType]
    return kinds[0] if NoneType in get_args(annotation) and len(kinds) == 1 else annotation


def _section(model: type[BaseModel], path: KeyPath) -> type[BaseModel] | None:
    here = _annotation(model, path)
    return here if isinstance(here, type) and issubclass(here, BaseModel) else None


def _length(model: type[BaseModel], path: KeyPath) -> int:
    here = _annotation(model, path)
    return len(get_args(here)) if get_origin(here) is tuple else 0


def _infinite(node: Node) -> Iterator[Finding]:
    for scalar in scalars(node):
        if isinstance(scalar.value, float) and not math.isfinite(scalar.value):
            yield error(scalar.mark, "not-finite", f'"{scalar.text}" is not a number one can reach')
