"""Validation of YAML trees with pydantic, after the overrides by `--set`, with errors at positions."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import NoneType
from typing import TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from executive.text.findings import (
    Finding,
    Source,
    Span,
    describe_validation_error,
    make_error,
    suggest_choice,
)
from executive.text.yaml_files import (
    YamlEntry,
    YamlMapping,
    YamlNode,
    YamlScalar,
    YamlSequence,
    list_scalars,
    parse_yaml,
)

CELL_PREFIX = "cell."
"""Prefix of the keys of overrides for the cell."""
BASE_KEY = "base"
"""Key of a cell file with the path of the base file, which supplies the missing top-level keys."""


def make_override_source(key: str, value: str) -> Source:
    """Return the source text of an override, for the positions of findings."""
    return Source("--set", f"{key}={value}")


def parse_override(key: str, value: str, is_text: bool = False) -> tuple[YamlNode | None, list[Finding]]:
    """Return YAML node (None after an error) and findings; if `is_text` is True, the value is not parsed."""
    source = make_override_source(key, value)
    if is_text or not value.strip():
        span = source.make_span(1, len(key) + 2, max(1, len(value)))
        return YamlScalar(span, value if is_text else None, value), []
    # Blanks replace `key=`, so that the positions in the source are correct.
    return parse_yaml(source, " " * (len(key) + 1) + value)


def override_cell(root: YamlNode, overrides: Mapping[str, str]) -> tuple[YamlNode, list[Finding]]:
    """Return the YAML tree of a cell file after all overrides `cell.<key>.<key>`, and the findings."""
    findings: list[Finding] = []
    for key, value in overrides.items():
        if not key.startswith(CELL_PREFIX):
            continue
        node, override_findings = parse_override(key, value)
        findings += override_findings
        path = key.removeprefix(CELL_PREFIX).split(".")
        if path == [BASE_KEY]:
            span = make_override_source(key, value).make_span(1, 1, len(key))
            message = "--set cannot change the base of a cell; edit the cell file"
            findings.append(make_error(span, "unknown-key", message))
        if node is not None:
            root = _replace_value(root, path, node, findings)
    return root, findings


def _replace_value(root: YamlNode, path: list[str], value: YamlNode, findings: list[Finding]) -> YamlNode:
    """Return the tree with `value` at `path`; add an error if `path` leads below a scalar or a list."""
    key, *inner_path = path
    if not isinstance(root, YamlMapping):
        message = f'there is no key "{key}", because the value of the section above is no mapping'
        findings.append(make_error(value.span, "unknown-key", message))
        return root
    # If the file omits the key, it uses the default; validation reports an unknown key.
    missing_entry = YamlEntry(YamlScalar(value.span, key, key), YamlMapping(value.span, {}))
    entry = root.entries.get(key, missing_entry)
    if inner_path:
        new_entry = YamlEntry(entry.key, _replace_value(entry.value, inner_path, value, findings))
    else:
        new_entry = YamlEntry(replace(entry.key, span=value.span), value)
    return replace(root, entries={**root.entries, key: new_entry})


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
    node = root
    span = root.span
    for key in path:
        if isinstance(node, YamlMapping) and (entry := node.entries.get(str(key))):
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
    parent = path[:-1]
    key = path[-1] if path else ""
    owner = join_keys(parent) or "the file"
    if error_type == "extra_forbidden":
        allowed_keys = getattr(_find_type(model, parent, root), "model_fields", ())
        hint = suggest_choice(str(key), allowed_keys, f"Keys of {owner}")
        span = find_span(root, path, at_key=True)
        return make_error(span, "unknown-key", f'{owner} has no key "{key}"', hint)
    if error_type == "missing" and isinstance(key, int):
        # The declared type is a tuple, whose type arguments are the types of its values.
        length = len(get_args(_find_type(model, parent, root)))
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


def _find_type(model: object, path: KeyPath, root: YamlNode) -> object:
    """Return the type of the value at `path` below `root`, or None if the type is unknown.

    The function `select_class` of a declared type returns the class of the section that is its argument.
    """
    declared_type: object = model
    value = root.python_value
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
        value = value.get(str(key)) if isinstance(value, dict) else None
        select_class = getattr(declared_type, "select_class", None)
        if select_class is not None and isinstance(value, dict):
            declared_type = select_class(value)
    return declared_type


def _remove_none(annotation: object) -> object:
    """Return `T` for the type `T | None`, and any other type unchanged."""
    members = [member for member in get_args(annotation) if member is not NoneType]
    return members[0] if NoneType in get_args(annotation) and len(members) == 1 else annotation


def _find_infinite_numbers(node: YamlNode) -> Iterator[Finding]:
    for scalar in list_scalars(node):
        if isinstance(scalar.value, float) and not math.isfinite(scalar.value):
            yield make_error(scalar.span, "not-finite", f'"{scalar.text}" is not a finite number')
