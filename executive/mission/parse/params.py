"""Parser of the params of a mission, which are constants with type, bounds and overrides by `--set`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast, get_origin

from pydantic import JsonValue

from executive.mission.descriptions import describe_value
from executive.mission.findings import suggest_choice
from executive.mission.model import grammar
from executive.mission.model.conversion import WrongType, convert_value
from executive.mission.model.mission import MissionParam
from executive.mission.model.values import Literal
from executive.mission.parse.mapping_reader import MappingReader, make_literal
from executive.mission.parse.overrides import CELL_PREFIX, make_override_source, parse_override
from executive.mission.text.yaml_text import YamlMapping, to_python_value

PARAM_TYPES = {"text": str, "integer": int, "number": float, "boolean": bool, "list": list[Any]}
"""Python types of params, by their names in a mission."""


def parse_params(reader: MappingReader, overrides: Mapping[str, str]) -> dict[str, MissionParam]:
    """Return the params of a mission file by name, with the values of the overrides."""
    params: dict[str, MissionParam] = {}
    for name, span, node in reader.iterate_entries("params"):
        reader.check_name(name, span, "a param")
        if isinstance(node, YamlMapping):
            keys = grammar.PARAM_KEYS
            param_reader = MappingReader(f'the param "{name}"', span, node, keys, reader.findings)
            params[name] = _read_declaration(name, param_reader, name in overrides)
        else:
            params[name] = MissionParam(span, make_literal(node), _infer_type(to_python_value(node)))
    for name, text in overrides.items():
        if name in params:
            override, findings = parse_override(name, text, is_text=params[name].type == "text")
            reader.findings += findings
            if override and (param := _set_value(name, params[name], make_literal(override), reader)):
                params[name] = param
        elif not name.startswith(CELL_PREFIX):
            span = make_override_source(name, text).make_span(1, 1, max(1, len(name)))
            hint = suggest_choice(name, params, "Params of the mission")
            reader.add_error(span, "unknown-param", f'the mission has no param "{name}"', hint)
    return params


def _read_declaration(name: str, reader: MappingReader, is_overridden: bool) -> MissionParam:
    """Return the param that a mapping with keys such as `default` and `min` declares."""
    default = reader.get("default")
    default_value = None if default is None else to_python_value(default)
    choices = reader.get("choices")
    param = MissionParam(
        reader.span,
        Literal(None, reader.span) if default is None else make_literal(default),
        _read_type(reader) or _infer_type(default_value),
        _read_bound(reader, "min"),
        _read_bound(reader, "max"),
        None if choices is None else tuple(to_python_value(item) for item in reader.list_items("choices")),
        reader.read_text("doc"),
    )
    # After an error, the param has a valid value, so that references to the param cause no other errors.
    fallback = replace(param, value=Literal(_choose_valid_value(param), reader.span))
    problem = f"no value is allowed for {name}"
    if param.choices == ():
        reader.add_error(reader.get_value_span("choices"), "empty-list", f"{problem}: choices is empty")
        return fallback
    if param.minimum is not None and param.maximum is not None and param.minimum > param.maximum:
        problem = f"{problem}: min {param.minimum:g} is greater than max {param.maximum:g}"
        reader.add_error(reader.get_value_span("min"), "out-of-range", problem)
        return fallback
    if default is not None:
        return _set_value(name, param, param.value, reader) or fallback
    if not is_overridden:
        message = f'the param "{name}" has neither a default nor a value'
        reader.add_error(reader.span, "missing-param", message, f"Set it with --set {name}=...")
    return fallback


def _choose_valid_value(param: MissionParam) -> JsonValue:
    """Return a value that the declaration of a param allows, or None if the type is unknown."""
    if param.choices:
        return param.choices[0]
    minimum = param.minimum if param.minimum is not None else 1
    values: dict[str, JsonValue] = {
        "text": "",
        "integer": int(minimum),
        "number": float(minimum),
        "boolean": False,
        "list": [None],
    }
    return values.get(param.type)


def _read_type(reader: MappingReader) -> str:
    """Return the name below the key `type`, or ""; add an error for an unknown type."""
    name = reader.read_text("type")
    if not name or name in PARAM_TYPES:
        return name
    hint = suggest_choice(name, PARAM_TYPES, "Types")
    reader.add_error(reader.get_value_span("type"), "wrong-value", f'there is no type "{name}"', hint)
    return ""


def _infer_type(value: object) -> str:
    """Return the name of the param type of a value, or "" if no param type fits."""
    types = PARAM_TYPES.items()
    return next((name for name, declared in types if type(value) is (get_origin(declared) or declared)), "")


def _read_bound(reader: MappingReader, key: str) -> float | None:
    """Return the number below `key`, or None; add an error for a value of another type."""
    node = reader.get(key)
    if node is None:
        return None
    value = to_python_value(node)
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return value
    message = f"{key} of {reader.owner} must be a number, not {describe_value(value)}"
    reader.add_error(node.span, "wrong-type", message)
    return None


def _set_value(name: str, param: MissionParam, value: Literal, reader: MappingReader) -> MissionParam | None:
    """Return the param with a value; if the value is not allowed, add an error and return None."""
    converted = value.value
    if param.type:
        try:
            converted = cast("JsonValue", convert_value(value.value, PARAM_TYPES[param.type]))
        except WrongType as error:
            reader.add_error(value.span, "wrong-type", f"{name} {error}")
            return None
    if rule := _find_violated_rule(param, converted):
        reader.add_error(value.span, "out-of-range", f"{name} {rule}, not {describe_value(converted)}")
        return None
    return replace(param, value=replace(value, value=converted))


def _find_violated_rule(param: MissionParam, value: object) -> str:
    """Return the bound or the choices that a value violates, as the end of a sentence, or ""."""
    if isinstance(value, int | float):
        if param.minimum is not None and value < param.minimum:
            return f"must be at least {param.minimum:g}"
        if param.maximum is not None and value > param.maximum:
            return f"must be at most {param.maximum:g}"
    if param.choices is not None and value not in param.choices:
        return f"must be one of {', '.join(map(str, param.choices))}"
    return ""
