"""Parser of the params of a mission: constants with type and bounds, whose values `--set` overrides."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

from pydantic import JsonValue

from executive.mission.descriptions import describe_value
from executive.mission.findings import Finding, list_choices, make_error
from executive.mission.model import grammar
from executive.mission.model.conversion import WrongType, convert_value
from executive.mission.model.mission import MissionParam
from executive.mission.model.values import Literal
from executive.mission.parse.fields import NAME_PATTERN, Fields, make_literal
from executive.mission.parse.overrides import CELL_PREFIX, make_override_source, parse_override
from executive.mission.source import Mark
from executive.mission.text.yaml_text import YamlMapping, YamlNode, to_python_value

TYPES: Mapping[str, object] = {
    "text": str,
    "integer": int,
    "number": float,
    "boolean": bool,
    "list": list[Any],
}
"""Python types of params, by their names in a mission."""


def parse_params(fields: Fields, overrides: Mapping[str, str]) -> dict[str, MissionParam]:
    """Return the params of a mission file by name, with the values of the overrides."""
    params: dict[str, MissionParam] = {}

    def read_entry(name: str, mark: Mark, node: YamlNode) -> None:
        if not NAME_PATTERN.fullmatch(name):
            message = f'"{name}" is no valid name of a param'
            hint = 'Use letters, digits and "_", and begin with no digit.'
            fields.findings.append(make_error(mark, "bad-name", message, hint))
        params[name] = _read_param(name, mark, node, name in overrides, fields.findings)

    fields.read_entries("params", read_entry)
    for name, value in overrides.items():
        if name.startswith(CELL_PREFIX):
            continue
        if name in params:
            params[name] = _apply_override(name, value, params[name], fields.findings)
        else:
            mark = make_override_source(name, value).make_mark(1, 1, max(1, len(name)))
            hint = list_choices(name, params, "Params of the mission")
            message = f'the mission has no param "{name}"'
            fields.findings.append(make_error(mark, "unknown-param", message, hint))
    return params


def _read_param(
    name: str, mark: Mark, node: YamlNode, is_overridden: bool, findings: list[Finding]
) -> MissionParam:
    """Return a param, which the file declares by its default or by a mapping."""
    if not isinstance(node, YamlMapping):
        return MissionParam(mark, make_literal(node), _infer_type(to_python_value(node)))
    fields = Fields(f'the param "{name}"', mark, node, grammar.PARAM_KEYS, findings)
    default = fields.get("default")
    default_value = None if default is None else to_python_value(default)
    choices = fields.get("choices")
    param = MissionParam(
        mark,
        Literal(None, mark) if default is None else make_literal(default),
        _read_type(fields, findings) or _infer_type(default_value),
        _read_bound(fields, "min", findings),
        _read_bound(fields, "max", findings),
        None if choices is None else tuple(to_python_value(item) for item in fields.list_items("choices")),
        fields.read_text("doc"),
    )
    # With a valid value, no use of the param has an error of its own.
    fallback = replace(param, value=Literal(_choose_valid_value(param), mark))
    if problem := _explain_impossible(param):
        code, key = ("empty-list", "choices") if param.choices == () else ("out-of-range", "min")
        message = f"no value is allowed for {name}: {problem}"
        findings.append(make_error(fields.get_value_mark(key), code, message))
        return fallback
    if default is not None:
        return _check_value(name, param, param.value, findings) or fallback
    if not is_overridden:
        message = f'the param "{name}" has neither a default nor a value'
        findings.append(make_error(mark, "missing-param", message, f"Set it with --set {name}=..."))
    return fallback


def _explain_impossible(param: MissionParam) -> str:
    """Return the reason why the declaration allows no value, or ""."""
    if param.choices == ():
        return "choices is empty"
    if param.minimum is not None and param.maximum is not None and param.minimum > param.maximum:
        return f"min {param.minimum:g} is greater than max {param.maximum:g}"
    return ""


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


def _read_type(fields: Fields, findings: list[Finding]) -> str:
    """Return the value of the key `type`; "" if it is missing or, after adding an error, if it is unknown."""
    name = fields.read_text("type")
    if not name or name in TYPES:
        return name
    hint = list_choices(name, TYPES, "Types")
    mark = fields.get_value_mark("type")
    findings.append(make_error(mark, "wrong-value", f'there is no type "{name}"', hint))
    return ""


def _infer_type(value: object) -> str:
    """Return the name of the type of a value, or ""."""
    classes = {name: getattr(declared, "__origin__", declared) for name, declared in TYPES.items()}
    return next((name for name, cls in classes.items() if type(value) is cls), "")


def _read_bound(fields: Fields, key: str, findings: list[Finding]) -> float | None:
    node = fields.get(key)
    if node is None:
        return None
    value = to_python_value(node)
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return value
    message = f"{key} of {fields.owner} must be a number, not {describe_value(value)}"
    findings.append(make_error(node.mark, "wrong-type", message))
    return None


def _apply_override(name: str, text: str, param: MissionParam, findings: list[Finding]) -> MissionParam:
    """Return the param with the value of `--set`; unchanged, with an error, if the value is invalid."""
    node, override_findings = parse_override(name, text, is_text=param.type == "text")
    findings += override_findings
    if node is None:
        return param
    return _check_value(name, param, make_literal(node), findings) or param


def _check_value(
    name: str, param: MissionParam, value: Literal, findings: list[Finding]
) -> MissionParam | None:
    """Return the param with a value; if the value has a wrong type or is not allowed, add an error."""
    converted = value.value
    if param.type:
        try:
            converted = cast("JsonValue", convert_value(value.value, TYPES[param.type]))
        except WrongType as problem:
            findings.append(make_error(value.mark, "wrong-type", f"{name} {problem}"))
            return None
    if rule := _find_violated_rule(param, converted):
        message = f"{name} {rule}, not {describe_value(converted)}"
        findings.append(make_error(value.mark, "out-of-range", message))
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
