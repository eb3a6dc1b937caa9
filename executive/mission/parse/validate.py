"""Validation of YAML nodes with pydantic, with findings at their places in the file."""

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
"""Codes of findings by the types of pydantic's errors; all other types are `wrong-type`."""

KeyPath = tuple[str | int, ...]
"""Keys and list indices from the root of a file to a value."""


@dataclass(frozen=True)
class Validated(Generic[M]):
    """A model, or None with the errors that prevent it."""

    model: M | None
    findings: tuple[Finding, ...]


def validate(root: Node, model: type[M]) -> Validated[M]:
    """Return the content of a file as `model`, with strict types except for integers as floats."""
    findings = list(_find_infinite_numbers(root))
    if findings:
        return Validated(None, tuple(findings))
    try:
        # In strict mode, only JSON input converts lists to tuples and integers to floats.
        return Validated(model.model_validate_json(json.dumps(plain(root)), strict=True), ())
    except ValidationError as problems:
        found = [_describe_problem(root, model, problem) for problem in problems.errors(include_url=False)]
        return Validated(None, tuple(found))


def mark_of(root: Node, path: KeyPath, of_key: bool = False) -> Mark:
    """Return the place of the value or key at `path`, or of the last part of `path` that exists."""
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


def join_keys(path: KeyPath) -> str:
    """Return `("bins", "red", "size", 0)` as `bins.red.size[0]`."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return text.removeprefix(".")


def _describe_problem(root: Node, model: type[BaseModel], problem: ErrorDetails) -> Finding:
    path: KeyPath = problem["loc"]
    kind = problem["type"]
    inside, last = path[:-1], path[-1] if path else ""
    if kind == "extra_forbidden":
        parent = _find_section(model, inside)
        owner = join_keys(inside) or "the file"
        known = list(parent.model_fields) if parent else []
        hint = alternatives(str(last), known, f"{owner} takes")
        key = mark_of(root, path, of_key=True)
        return error(key, "unknown-key", f'{owner} has no key "{last}"', hint)
    if kind == "missing" and isinstance(last, int):
        given = len(problem["input"])
        message = f"{join_keys(inside)} has {given} of the {_tuple_length(model, inside)} values it needs"
        return error(mark_of(root, inside), "wrong-length", message)
    if kind == "missing":
        owner = join_keys(inside) or "the file"
        return error(mark_of(root, inside), "missing-key", f'{owner} needs the key "{last}"')
    if last == "[key]":
        return error(
            mark_of(root, inside, of_key=True), "bad-name", f"{join_keys(inside)} {violation(problem)}"
        )
    code = "out-of-range" if "than" in kind else _CODES.get(kind, "wrong-type")
    name = join_keys(path) or "the file"
    return error(mark_of(root, path), code, f"{name} {violation(problem)}")


def _find_type(model: object, path: KeyPath) -> object:
    """Return the declared type of the value at `path`, or None if it is unknown."""
    declared: object = model
    for step in path:
        if isinstance(declared, type) and issubclass(declared, BaseModel):
            field = declared.model_fields.get(str(step))
            declared = _without_none(field.annotation) if field else None
        elif get_origin(declared) is dict:
            declared = get_args(declared)[1]
        elif get_origin(declared) in (tuple, list):
            declared = get_args(declared)[0]
        else:
            return None
    return declared


def _without_none(annotation: object) -> object:
    """Return `T` for the type `T | None`, and any other type unchanged."""
    kinds = [kind for kind in get_args(annotation) if kind is not NoneType]
    return kinds[0] if NoneType in get_args(annotation) and len(kinds) == 1 else annotation


def _find_section(model: type[BaseModel], path: KeyPath) -> type[BaseModel] | None:
    declared = _find_type(model, path)
    return declared if isinstance(declared, type) and issubclass(declared, BaseModel) else None


def _tuple_length(model: type[BaseModel], path: KeyPath) -> int:
    declared = _find_type(model, path)
    return len(get_args(declared)) if get_origin(declared) is tuple else 0


def _find_infinite_numbers(node: Node) -> Iterator[Finding]:
    for scalar in scalars(node):
        if isinstance(scalar.value, float) and not math.isfinite(scalar.value):
            yield error(scalar.mark, "not-finite", f'"{scalar.text}" is not a finite number')
