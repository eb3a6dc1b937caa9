"""Validation of YAML trees with pydantic, with errors at their positions in the file."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from types import NoneType
from typing import TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from executive.mission.descriptions import describe_validation_error
from executive.mission.findings import Finding, make_error, suggest_choice
from executive.mission.source import Span
from executive.mission.text.yaml_text import YamlMapping, YamlNode, YamlScalar, YamlSequence, iterate_scalars

ModelT = TypeVar("ModelT", bound=BaseModel)
"""Type of the content of a file."""

_CODES_BY_ERROR_TYPE = {
    "value_error": "wrong-value",
    "literal_error": "wrong-value",
    "too_long": "wrong-length",
    "too_short": "wrong-length",
}
"""Codes of findings by the type of pydantic's error; for other types, the code is `wrong-type`."""

KeyPath = tuple[str | int, ...]
"""Keys and list indices from the root of a file to a value."""


def validate(root: YamlNode, model: type[ModelT]) -> tuple[ModelT | None, list[Finding]]:
    """Return the content of a file as an instance of `model`, or None and the errors.

    The only type conversion is from integer to float.
    """
    findings = list(_find_infinite_numbers(root))
    if findings:
        return None, findings
    try:
        # In strict mode, pydantic converts lists to tuples and integers to floats only from JSON.
        content = model.model_validate_json(json.dumps(root.python_value), strict=True)
    except ValidationError as error:
        return None, [_make_finding(root, model, details) for details in error.errors(include_url=False)]
    return content, []


def find_span(root: YamlNode, path: KeyPath, at_key: bool = False) -> Span:
    """Return the position of the value at `path`, or at the longest existing part of `path`.

    If `at_key` is True, or the value is a list or mapping, return the position of the key.
    """
    node, span = root, root.span
    for key in path:
        if isinstance(node, YamlMapping) and (entry := node.get_entry(str(key))):
            node = entry.value
            span = node.span if isinstance(node, YamlScalar) and not at_key else entry.key.span
        elif isinstance(node, YamlSequence) and isinstance(key, int) and key < len(node.items):
            node = node.items[key]
            span = node.span
        else:
            break
    return span


def join_keys(path: KeyPath) -> str:
    """Return a path as a text: `bins.red.size[0]` for `("bins", "red", "size", 0)`."""
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path).removeprefix(".")


def _make_finding(root: YamlNode, model: type[BaseModel], error: ErrorDetails) -> Finding:
    """Return the finding for an error of pydantic, at the position of the wrong key or value."""
    path: KeyPath = error["loc"]
    error_type = error["type"]
    parent, key = path[:-1], path[-1] if path else ""
    owner = join_keys(parent) or "the file"
    if error_type == "extra_forbidden":
        allowed_keys = getattr(_find_type(model, parent), "model_fields", ())
        hint = suggest_choice(str(key), allowed_keys, f"Keys of {owner}")
        span = find_span(root, path, at_key=True)
        return make_error(span, "unknown-key", f'{owner} has no key "{key}"', hint)
    if error_type == "missing" and isinstance(key, int):
        # The declared type is a tuple, whose type arguments are the types of its values.
        length = len(get_args(_find_type(model, parent)))
        message = f"{owner} needs {length} values, not {len(error['input'])}"
        return make_error(find_span(root, parent), "wrong-length", message)
    if error_type == "missing":
        return make_error(find_span(root, parent), "missing-key", f'{owner} needs the key "{key}"')
    if key == "[key]":
        span = find_span(root, parent, at_key=True)
        return make_error(span, "bad-name", f"{owner} {describe_validation_error(error)}")
    # The error of a violated bound has a type such as `less_than` or `greater_than_equal`.
    code = "out-of-range" if "than" in error_type else _CODES_BY_ERROR_TYPE.get(error_type, "wrong-type")
    name = join_keys(path) or "the file"
    return make_error(find_span(root, path), code, f"{name} {describe_validation_error(error)}")


def _find_type(model: object, path: KeyPath) -> object:
    """Return the declared type of the value at `path`, or None if the type is unknown."""
    declared_type: object = model
    for key in path:
        if isinstance(declared_type, type) and issubclass(declared_type, BaseModel):
            field = declared_type.model_fields.get(str(key))
            declared_type = _remove_none(field.annotation) if field else None
        elif get_origin(declared_type) is dict:
            declared_type = get_args(declared_type)[1]
        elif get_origin(declared_type) in (tuple, list):
            declared_type = get_args(declared_type)[0]
        else:
            return None
    return declared_type


def _remove_none(annotation: object) -> object:
    """Return `T` for the type `T | None`, and any other type unchanged."""
    members = [member for member in get_args(annotation) if member is not NoneType]
    return members[0] if NoneType in get_args(annotation) and len(members) == 1 else annotation


def _find_infinite_numbers(node: YamlNode) -> Iterator[Finding]:
    for scalar in iterate_scalars(node):
        if isinstance(scalar.value, float) and not math.isfinite(scalar.value):
            yield make_error(scalar.span, "not-finite", f'"{scalar.text}" is not a finite number')
