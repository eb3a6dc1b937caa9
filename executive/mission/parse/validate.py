"""Validation of YAML trees with pydantic, with errors at their positions in the file."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from types import NoneType
from typing import Generic, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from executive.mission.descriptions import describe_violation
from executive.mission.findings import Finding, list_choices, make_error
from executive.mission.source import Mark
from executive.mission.text.yaml_text import (
    YamlMapping,
    YamlNode,
    YamlScalar,
    YamlSequence,
    iterate_scalars,
    to_python_value,
)

M = TypeVar("M", bound=BaseModel)

_CODES_BY_ERROR_TYPE = {
    "value_error": "wrong-value",
    "literal_error": "wrong-value",
    "too_long": "wrong-length",
    "too_short": "wrong-length",
}
"""Codes of findings by the types of pydantic's errors; other types have the code `wrong-type`."""

KeyPath = tuple[str | int, ...]
"""Keys and list indices from the root of a file to a value."""


@dataclass(frozen=True)
class ValidationResult(Generic[M]):
    """Validated content of a file; None if there are errors."""

    model: M | None
    findings: tuple[Finding, ...]


def validate(root: YamlNode, model: type[M]) -> ValidationResult[M]:
    """Return the content of a file as an instance of `model`; of other types, only integers become floats."""
    findings = list(_find_infinite_numbers(root))
    if findings:
        return ValidationResult(None, tuple(findings))
    try:
        # In strict mode, pydantic converts lists to tuples and integers to floats only from JSON.
        content = model.model_validate_json(json.dumps(to_python_value(root)), strict=True)
    except ValidationError as error:
        problems = error.errors(include_url=False)
        return ValidationResult(None, tuple(_locate_problem(root, model, problem) for problem in problems))
    return ValidationResult(content, ())


def find_mark(root: YamlNode, path: KeyPath, of_key: bool = False) -> Mark:
    """Return the position of the value or key at `path`, or of the longest part of `path` that exists."""
    node, mark = root, root.mark
    for step in path:
        if isinstance(node, YamlMapping) and (entry := node.get_entry(str(step))):
            node = entry.value
            mark = node.mark if isinstance(node, YamlScalar) and not of_key else entry.key.mark
        elif isinstance(node, YamlSequence) and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
            mark = node.mark
        else:
            break
    return mark


def join_keys(path: KeyPath) -> str:
    """Return a path as a text: `bins.red.size[0]` for `("bins", "red", "size", 0)`."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return text.removeprefix(".")


def _locate_problem(root: YamlNode, model: type[BaseModel], problem: ErrorDetails) -> Finding:
    """Return an error of pydantic as a finding with the position of the wrong key or value."""
    path: KeyPath = problem["loc"]
    error_type = problem["type"]
    parent, last = path[:-1], path[-1] if path else ""
    owner = join_keys(parent) or "the file"
    if error_type == "extra_forbidden":
        section = _find_section(model, parent)
        known = list(section.model_fields) if section else []
        hint = list_choices(str(last), known, f"Keys of {owner}")
        mark = find_mark(root, path, of_key=True)
        return make_error(mark, "unknown-key", f'{owner} has no key "{last}"', hint)
    if error_type == "missing" and isinstance(last, int):
        message = f"{owner} needs {_find_tuple_length(model, parent)} values, not {len(problem['input'])}"
        return make_error(find_mark(root, parent), "wrong-length", message)
    if error_type == "missing":
        return make_error(find_mark(root, parent), "missing-key", f'{owner} needs the key "{last}"')
    if last == "[key]":
        mark = find_mark(root, parent, of_key=True)
        return make_error(mark, "bad-name", f"{owner} {describe_violation(problem)}")
    code = "out-of-range" if "than" in error_type else _CODES_BY_ERROR_TYPE.get(error_type, "wrong-type")
    name = join_keys(path) or "the file"
    return make_error(find_mark(root, path), code, f"{name} {describe_violation(problem)}")


def _find_type(model: object, path: KeyPath) -> object:
    """Return the declared type of the value at `path`, or None if it is unknown."""
    declared: object = model
    for step in path:
        if isinstance(declared, type) and issubclass(declared, BaseModel):
            field = declared.model_fields.get(str(step))
            declared = _remove_none(field.annotation) if field else None
        elif get_origin(declared) is dict:
            declared = get_args(declared)[1]
        elif get_origin(declared) in (tuple, list):
            declared = get_args(declared)[0]
        else:
            return None
    return declared


def _remove_none(annotation: object) -> object:
    """Return `T` for the type `T | None`, and any other type unchanged."""
    members = [member for member in get_args(annotation) if member is not NoneType]
    return members[0] if NoneType in get_args(annotation) and len(members) == 1 else annotation


def _find_section(model: type[BaseModel], path: KeyPath) -> type[BaseModel] | None:
    """Return the model of the section at `path`, or None if the value there is no section."""
    declared = _find_type(model, path)
    return declared if isinstance(declared, type) and issubclass(declared, BaseModel) else None


def _find_tuple_length(model: type[BaseModel], path: KeyPath) -> int:
    """Return the number of values of the tuple at `path`; 0 if the value there is no tuple."""
    declared = _find_type(model, path)
    return len(get_args(declared)) if get_origin(declared) is tuple else 0


def _find_infinite_numbers(node: YamlNode) -> Iterator[Finding]:
    for scalar in iterate_scalars(node):
        if isinstance(scalar.value, float) and not math.isfinite(scalar.value):
            yield make_error(scalar.mark, "not-finite", f'"{scalar.text}" is not a finite number')
