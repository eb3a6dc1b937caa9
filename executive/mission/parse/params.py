"""Parser for the params of a mission: constants with a type, bounds and a value, which `--set` overrides."""

from __future__ import annotations

import math
from collections.abc import Mapping as Mapped
from dataclasses import replace
from typing import Any, cast

from pydantic import JsonValue

from executive.mission.findings import Finding, alternatives, error
from executive.mission.model import grammar
from executive.mission.model.mission import MissionParam
from executive.mission.model.typed import WrongType, convert
from executive.mission.model.values import Literal
from executive.mission.parse.fields import NAME, Fields, literal_of
from executive.mission.parse.overrides import CELL, override_node, override_source
from executive.mission.source import Mark
from executive.mission.text.yaml_text import Mapping, Node, plain
from executive.mission.words import describe

TYPES: Mapped[str, object] = {
    "text": str,
    "integer": int,
    "number": float,
    "boolean": bool,
    "list": list[Any],
}
"""Python types of params, by their names in a mission."""


def parse_params(fields: Fields, overrides: Mapped[str, str]) -> dict[str, MissionParam]:
    """Return the params of a mission file with the values of the overrides."""
    params: dict[str, MissionParam] = {}

    def read(name: str, mark: Mark, node: Node) -> None:
        if not NAME.fullmatch(name):
            fields.findings.append(error(mark, "bad-name", f'"{name}" cannot be written as ${name}'))
        params[name] = _read_param(name, mark, node, name in overrides, fields.findings)

    fields.mapping("params", read)
    for name, value in overrides.items():
        if name.startswith(CELL):
            continue
        if name in params:
            params[name] = _apply_override(name, value, params[name], fields.findings)
        else:
            mark = override_source(name, value).mark(1, 1, max(1, len(name)))
            hint = alternatives(name, params, "The mission's params")
            message = f'the mission has no param "{name}"'
            fields.findings.append(error(mark, "unknown-param", message, hint))
    return params


def _read_param(name: str, mark: Mark, node: Node, given: bool, findings: list[Finding]) -> MissionParam:
    """Return a param that is declared by its default or by a mapping."""
    if not isinstance(node, Mapping):
        return MissionParam(mark, literal_of(node), _infer_type(plain(node)))
    fields = Fields(f'the param "{name}"', mark, node, grammar.PARAM, findings)
    default = fields.get("default")
    kind = _read_type(fields, findings) or _infer_type(None if default is None else plain(default))
    choices = fields.get("choices")
    param = MissionParam(
        mark,
        Literal(None, mark) if default is None else literal_of(default),
        kind,
        _read_bound(fields, "min", findings),
        _read_bound(fields, "max", findings),
        None if choices is None else tuple(plain(item) for item in fields.items("choices")),
        fields.text("doc"),
    )
    # A valid value prevents further findings at every use of the param.
    fallback = replace(param, value=Literal(_choose_valid_value(param), mark))
    if problem := _explain_impossible(param):
        code, key = ("empty-list", "choices") if param.choices == () else ("out-of-range", "min")
        findings.append(error(fields.value_mark(key), code, f"{name} can have no value: {problem}"))
        return fallback
    if default is not None:
        return _check_value(name, param, param.value, findings) or fallback
    if not given:
        message = f'the param "{name}" has no default and was not given'
        findings.append(error(mark, "missing-param", message, f"Give it with --set {name}=..."))
    return fallback


def _explain_impossible(param: MissionParam) -> str:
    """Return the reason why no value fits the declaration, or ""."""
    if param.choices == ():
        return "no choices"
    if param.minimum is not None and param.maximum is not None and param.minimum > param.maximum:
        return f"min {param.minimum:g} is above max {param.maximum:g}"
    return ""


def _choose_valid_value(param: MissionParam) -> JsonValue:
    """Return a valid value for a param; a missing value is reported only at the declaration."""
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
    written = fields.text("type")
    if not written or written in TYPES:
        return written
    hint = alternatives(written, TYPES, "There are")
    findings.append(error(fields.value_mark("type"), "wrong-value", f'there is no type "{written}"', hint))
    return ""


def _infer_type(value: object) -> str:
    kinds = {word: getattr(kind, "__origin__", kind) for word, kind in TYPES.items()}
    return next((word for word, kind in kinds.items() if type(value) is kind), "")


def _read_bound(fields: Fields, key: str, findings: list[Finding]) -> float | None:
    node = fields.get(key)
    if node is None:
        return None
    value = plain(node)
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return value
    findings.append(
        error(node.mark, "wrong-type", f"{fields.owner}.{key} must be a number, not {describe(value)}")
    )
    return None


def _apply_override(name: str, text: str, param: MissionParam, findings: list[Finding]) -> MissionParam:
    """Return the param with the value of `--set`, which is checked like the default."""
    node, override_findings = override_node(name, text, as_text=param.type == "text")
    findings += override_findings
    if node is None:
        return param
    return _check_value(name, param, literal_of(node), findings) or param


def _check_value(
    name: str, param: MissionParam, value: Literal, findings: list[Finding]
) -> MissionParam | None:
    """Return the param with a value of its type and within its bounds, or None after adding a finding."""
    converted = value.value
    if param.type:
        try:
            converted = cast("JsonValue", convert(value.value, TYPES[param.type]))
        except WrongType as problem:
            findings.append(error(value.mark, "wrong-type", f"{name} {problem}"))
            return None
    if violation := _explain_violation(param, converted):
        findings.append(error(value.mark, "out-of-range", f"{name} {violation}, not {describe(converted)}"))
        return None
    return replace(param, value=replace(value, value=converted))


def _explain_violation(param: MissionParam, value: object) -> str:
    if isinstance(value, int | float):
        if param.minimum is not None and value < param.minimum:
            return f"must be at least {param.minimum:g}"
        if param.maximum is not None and value > param.maximum:
            return f"must be at most {param.maximum:g}"
    if param.choices is not None and value not in param.choices:
        return f"must be one of {', '.join(map(str, param.choices))}"
    return ""
