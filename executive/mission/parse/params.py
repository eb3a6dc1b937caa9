"""The params of a mission: constants with a type, bounds and a value that may be given beside the file."""

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
"""The types a param may have, by the word for them."""


def parse_params(fields: Fields, overrides: Mapped[str, str]) -> dict[str, MissionParam]:
    """Return the params of a mission file, with the values given beside the file put in."""
    params: dict[str, MissionParam] = {}

    def read(name: str, mark: Mark, node: Node) -> None:
        if not NAME.fullmatch(name):
            fields.findings.append(error(mark, "bad-name", f'"{name}" cannot be written as ${name}'))
        params[name] = _param(name, mark, node, name in overrides, fields.findings)

    fields.mapping("params", read)
    for name, value in overrides.items():
        if name.startswith(CELL):
            continue
        if name in params:
            params[name] = _given(name, value, params[name], fields.findings)
        else:
            mark = override_source(name, value).mark(1, 1, max(1, len(name)))
            hint = alternatives(name, params, "The mission's params")
            message = f'the mission has no param "{name}"'
            fields.findings.append(error(mark, "unknown-param", message, hint))
    return params


def _param(name: str, mark: Mark, node: Node, given: bool, findings: list[Finding]) -> MissionParam:
    """Return a param as it is declared: by its default alone, or by a mapping."""
    if not isinstance(node, Mapping):
        return MissionParam(mark, literal_of(node), _type_of(plain(node)))
    fields = Fields(f'the param "{name}"', mark, node, grammar.PARAM, findings)
    default = fields.get("default")
    kind = _declared_type(fields, findings) or _type_of(None if default is None else plain(default))
    choices = fields.get("choices")
    param = MissionParam(
        mark,
        Literal(None, mark) if default is None else literal_of(default),
        kind,
        _bound(fields, "min", findings),
        _bound(fields, "max", findings),
        None if choices is None else tuple(plain(item) for item in fields.items("choices")),
        fields.text("doc"),
    )
    # What is wrong is told here, not again wherever the param is used.
    fallback = replace(param, value=Literal(_any_value(param), mark))
    if sentence := _impossible(param):
        code, key = ("empty-list", "choices") if param.choices == () else ("out-of-range", "min")
        findings.append(error(fields.value_mark(key), code, f"{name} can have no value: {sentence}"))
        return fallback
    if default is not None:
        return _checked(name, param, param.value, findings) or fallback
    if not given:
        message = f'the param "{name}" has no default and was not given'
        findings.append(error(mark, "missing-param", message, f"Give it with --set {name}=..."))
    return fallback


def _impossible(param: MissionParam) -> str:
    """Return why no value fits the declaration, or ""."""
    if param.choices == ():
        return "no choices"
    if param.minimum is not None and param.maximum is not None and param.minimum > param.maximum:
        return f"min {param.minimum:g} is above max {param.maximum:g}"
    return ""


def _any_value(param: MissionParam) -> JsonValue:
    """Return a value that a param could have, so that one that is missing is told once, not at every use."""
    if param.choices:
        return param.choices[0]
    least = param.minimum if param.minimum is not None else 1
    values: dict[str, JsonValue] = {
        "text": "",
        "integer": int(least),
        "number": float(least),
        "boolean": False,
        "list": [None],
    }
    return values.get(param.type)


def _declared_type(fields: Fields, findings: list[Finding]) -> str:
    written = fields.text("type")
    if not written or written in TYPES:
        return written
    hint = alternatives(written, TYPES, "There are")
    findings.append(error(fields.value_mark("type"), "wrong-value", f'there is no type "{written}"', hint))
    return ""


def _type_of(value: object) -> str:
    kinds = {word: getattr(kind, "__origin__", kind) for word, kind in TYPES.items()}
    return next((word for word, kind in kinds.items() if type(value) is kind), "")


def _bound(fields: Fields, key: str, findings: list[Finding]) -> float | None:
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


def _given(name: str, text: str, param: MissionParam, findings: list[Finding]) -> MissionParam:
    """Return the param with the value given beside the file, which must fit as the default does."""
    node, wrong = override_node(name, text, as_text=param.type == "text")
    findings += wrong
    if node is None:
        return param
    return _checked(name, param, literal_of(node), findings) or param


def _checked(name: str, param: MissionParam, value: Literal, findings: list[Finding]) -> MissionParam | None:
    """Return the param with a value of its type and within its bounds, or None with a finding."""
    fitting = value.value
    if param.type:
        try:
            fitting = cast("JsonValue", convert(value.value, TYPES[param.type]))
        except WrongType as problem:
            findings.append(error(value.mark, "wrong-type", f"{name} {problem}"))
            return None
    if sentence := _out_of_bounds(param, fitting):
        findings.append(error(value.mark, "out-of-range", f"{name} {sentence}, not {describe(fitting)}"))
        return None
    return replace(param, value=replace(value, value=fitting))


def _out_of_bounds(param: MissionParam, value: object) -> str:
    if isinstance(value, int | float):
        if param.minimum is not None and value < param.minimum:
            return f"must be at least {param.minimum:g}"
        if param.maximum is not None and value > param.maximum:
            return f"must be at most {param.maximum:g}"
    if param.choices is not None and value not in param.choices:
        return f"must be one of {', '.join(map(str, param.choices))}"
    return ""
