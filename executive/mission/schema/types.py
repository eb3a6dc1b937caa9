"""JSON Schema draft-07, which most editors support, of Python types, the cell file and the skills."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import TypeAlias, cast

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema, to_jsonable_python

from executive.cell.config import CellConfig
from executive.mission.model.typed import is_plain
from executive.skill import Direction, Param, Port, Skill

Json: TypeAlias = JsonSchemaValue
"""A JSON Schema, or a part of one."""

ALTERNATIVE: Json = {"allOf": [True]}
"""Allows everything; without it yaml-language-server offers "- (array item)" beside every alternative."""

REFERENCE: Json = {"$ref": "#/definitions/reference"}

DIALECT = "http://json-schema.org/draft-07/schema#"


class Draft07(GenerateJsonSchema):
    """Pydantic's JSON Schema as draft-07, without titles from names in the code."""

    def tuple_schema(self, schema: core_schema.TupleSchema) -> Json:
        """Return the schema of a tuple, whose elements draft-07 lists under `items`."""
        written = super().tuple_schema(schema)
        places = written.pop("prefixItems", None)
        if places is None:
            return written
        alike = all(place == places[0] for place in places)
        return {**written, "items": places[0] if alike else places}

    def model_schema(self, schema: core_schema.ModelSchema) -> Json:
        """Return the schema of a section."""
        written = super().model_schema(schema)
        del written["title"]
        return written

    def field_title_should_be_set(self, schema: object) -> bool:
        """Return False for every field."""
        del schema
        return False


def type_schema(declared: object) -> Json:
    """Return the schema of the plain values of a Python type."""
    return TypeAdapter(cast("type[object]", declared)).json_schema(schema_generator=Draft07)


def cell_schema() -> Json:
    """Return the schema of a cell file.

    With a `base`, no other key and no `kind` of a detector is required, and a detector may be empty.
    """
    written = CellConfig.model_json_schema(schema_generator=Draft07, ref_template="#/definitions/{model}")
    sections, required = written.pop("$defs"), written.pop("required")
    detector = sections["DetectorConfig"]
    whole = {"type": detector["type"], "required": detector.pop("required")}
    detector["type"] = [whole["type"], "null"]
    return {
        "$schema": DIALECT,
        "title": "A cell",
        **written,
        "if": {"required": ["base"]},
        "else": {"required": required, "properties": {"detectors": {"additionalProperties": whole}}},
        "definitions": sections,
    }


def or_reference(*written: Json) -> Json:
    """Return the schema of a value with one of these schemas, or of a reference `$name`."""
    return {"anyOf": [*written, REFERENCE]}


def settings(name: str, skill: type[Skill]) -> Json:
    """Return the schema of the params and ports under the name of a skill."""
    required = [param.name for param in skill.params.values() if param.is_required]
    params = {key: _param(param) for key, param in skill.params.items()}
    ports = {key: _port(port) for key, port in skill.ports.items()}
    shape = {
        "type": "object" if required else ["object", "null"],
        "properties": {**params, **ports},
        "required": required,
        "additionalProperties": False,
    }
    # With allOf an editor completes only the name, which is valid in a list and in a mapping.
    return {"title": name, **_documentation(skill), "allOf": [shape]}


def words(skills: Mapping[str, type[Skill]]) -> list[Json]:
    """Return the schemas of the names of skills without required params."""
    return [
        {"const": name, "title": name, **_documentation(skill), **ALTERNATIVE}
        for name, skill in skills.items()
        if not any(param.is_required for param in skill.params.values())
    ]


def failures(skills: Mapping[str, type[Skill]]) -> list[str]:
    """Return `Skill.reason` for each reason of each skill."""
    return [f"{name}.{reason}" for name, skill in skills.items() for reason in skill.reasons]


def _documentation(skill: type[Skill]) -> Json:
    text = inspect.getdoc(skill) or ""
    flows = {
        "reads": [port.name for port in skill.ports.values() if port.direction is Direction.IN],
        "writes": [port.name for port in skill.ports.values() if port.direction is Direction.OUT],
        "may fail with": skill.reasons,
    }
    facts = [f"* {verb} {', '.join(f'`{name}`' for name in names)}" for verb, names in flows.items() if names]
    whole = "\n\n".join(part for part in (text, "\n".join(facts)) if part)
    return {"description": text.partition("\n")[0], "markdownDescription": whole}


def _param(param: Param) -> Json:
    written = type_schema(param.type)
    bounds = {"minimum": param.ge, "maximum": param.le}
    written |= {word: bound for word, bound in bounds.items() if bound is not None}
    if param.choices is not None:
        # A param that names a part of the cell accepts other values than its choices.
        written["examples" if param.refers else "enum"] = list(param.choices)
    if not param.is_required:
        written["default"] = to_jsonable_python(param.default)
    return {"description": _describe_param(param), **or_reference(written)}


def _describe_param(param: Param) -> str:
    """Return the description of a param with unit, bounds and default, which editors do not show."""
    facts = [f"at least {param.ge:g}"] if param.ge is not None else []
    facts += [f"at most {param.le:g}"] if param.le is not None else []
    facts += [f"{param.default} if not given"] if param.default not in (..., "", None) else []
    parts = (param.doc, f"[{param.unit}]" if param.unit else "", f"({', '.join(facts)})" if facts else "")
    return " ".join(part for part in parts if part)


def _port(port: Port) -> Json:
    written = port.direction is Direction.OUT
    description = f"{'output' if written else 'input'}: {port.doc}"
    if written or not is_plain(port.type):
        return {"description": description, **REFERENCE}
    return {"description": description, **or_reference(type_schema(port.type))}
