"""Parser of the params of a mission, which are constants with type, bounds and overrides by `--set`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast, get_origin

from pydantic import JsonValue

from executive.mission.findings import suggest_choice
from executive.mission.model import grammar
from executive.mission.model.conversion import ValueProblem, convert_setting, convert_value
from executive.mission.model.mission import MissionParam
from executive.mission.model.values import InvalidValue, Literal
from executive.mission.parse.mapping_reader import MappingReader, make_literal
from executive.mission.parse.overrides import CELL_PREFIX, make_override_source, parse_override
from executive.mission.text.yaml_text import YamlMapping
from executive.skill import param

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
            value = make_literal(node)
            params[name] = MissionParam(span, value, replace(param(), type=_infer_type(value.value)))
    for name, text in overrides.items():
        if name in params:
            override, findings = parse_override(name, text, is_text=params[name].declaration.type is str)
            reader.findings += findings
            if override:
                params[name] = _replace_value(name, params[name], make_literal(override), reader)
        elif not name.startswith(CELL_PREFIX):
            span = make_override_source(name, text).make_span(1, 1, max(1, len(name)))
            hint = suggest_choice(name, params, "Params of the mission")
            reader.add_error(span, "unknown-param", f'the mission has no param "{name}"', hint)
    return params


def _read_declaration(name: str, reader: MappingReader, is_overridden: bool) -> MissionParam:
    """Return the param that a mapping with keys such as `default` and `min` declares."""
    default, items = reader.get("default"), reader.list_items("choices")
    reader.read_text("doc")
    declaration = param(
        ge=_read_bound(reader, "min"),
        le=_read_bound(reader, "max"),
        choices=tuple(item.python_value for item in items) if reader.get("choices") else None,
    )
    default_type = _infer_type(None if default is None else default.python_value)
    declaration = replace(declaration, type=_read_type(reader) or default_type)
    without_value = MissionParam(reader.span, InvalidValue(reader.span), declaration)
    problem = f"{name} cannot have any value"
    if declaration.choices == ():
        reader.add_error(reader.get_value_span("choices"), "empty-list", f"{problem}: choices is empty")
    elif declaration.ge is not None and declaration.le is not None and declaration.ge > declaration.le:
        problem = f"{problem}: min {declaration.ge:g} is greater than max {declaration.le:g}"
        reader.add_error(reader.get_value_span("min"), "out-of-range", problem)
    elif default is not None:
        return _replace_value(name, without_value, make_literal(default), reader)
    elif not is_overridden:
        message = f'the param "{name}" has neither a default nor a value'
        reader.add_error(reader.span, "missing-param", message, f"Set it with --set {name}=...")
    return without_value


def _read_type(reader: MappingReader) -> object:
    """Return the type that the key `type` names, or None; add an error for an unknown name."""
    name = reader.read_text("type")
    if name and name not in PARAM_TYPES:
        hint = suggest_choice(name, PARAM_TYPES, "Types")
        reader.add_error(reader.get_value_span("type"), "wrong-value", f'there is no type "{name}"', hint)
    return PARAM_TYPES.get(name)


def _infer_type(value: object) -> object:
    """Return the param type of a value, or `Any` if no param type fits."""
    types = PARAM_TYPES.values()
    return next((declared for declared in types if type(value) is (get_origin(declared) or declared)), Any)


def _read_bound(reader: MappingReader, key: str) -> float | None:
    """Return the number below `key`, or None; add an error for a value of another type."""
    if (node := reader.get(key)) is None:
        return None
    try:
        return cast("float", convert_value(node.python_value, float))
    except ValueProblem as problem:
        reader.add_error(node.span, "wrong-type", f"{key} of {reader.owner} {problem}")
    return None


def _replace_value(name: str, param: MissionParam, value: Literal, reader: MappingReader) -> MissionParam:
    """Return the param with a value; if the value is not allowed, add an error and return the old param."""
    try:
        converted = cast("JsonValue", convert_setting(value.value, param.declaration))
    except ValueProblem as problem:
        reader.add_error(value.span, problem.code, f"{name} {problem}")
        return param
    return replace(param, value=replace(value, value=converted))
