"""JSON Schemas (draft-07, for most editors) of Python types, the cell file and the skills."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Mapping
from itertools import pairwise
from typing import TypeAlias, cast

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema, to_jsonable_python

from executive.cell.config import CellConfig
from executive.mission.model.conversion import is_plain_type
from executive.skill import Direction, Param, Port, Skill

Schema: TypeAlias = JsonSchemaValue
"""A JSON Schema or a subschema."""

NO_ITEM_SUGGESTION: Schema = {"allOf": [True]}
"""Subschema that allows every value, but stops the suggestion "- (array item)" of yaml-language-server."""

REFERENCE: Schema = {"$ref": "#/definitions/reference"}
"""Schema of a reference `$name`."""

DIALECT = "http://json-schema.org/draft-07/schema#"
"""Value of `$schema` for draft-07."""


class Draft07(GenerateJsonSchema):
    """Generator of pydantic's JSON Schemas as draft-07, without titles from names in the code."""

    def tuple_schema(self, schema: core_schema.TupleSchema) -> Schema:
        """Return the schema of a tuple; draft-07 has the schemas of the elements under `items`."""
        tuple_schema = super().tuple_schema(schema)
        elements = tuple_schema.pop("prefixItems", None)
        if elements is None:
            return tuple_schema
        are_equal = all(element == elements[0] for element in elements)
        return {**tuple_schema, "items": elements[0] if are_equal else elements}

    def model_schema(self, schema: core_schema.ModelSchema) -> Schema:
        """Return the schema of a section of the cell file, without title."""
        section_schema = super().model_schema(schema)
        del section_schema["title"]
        for name, docstring in find_attribute_docstrings(schema["cls"]).items():
            section_schema["properties"][name]["description"] = docstring
        return section_schema

    def field_title_should_be_set(self, _schema: object) -> bool:
        """Return False, because no field has a title."""
        return False


def find_attribute_docstrings(declaring_class: type[object]) -> dict[str, str]:
    """Return the docstring of each annotated attribute in the body of a class, by name of the attribute.

    The option `use_attribute_docstrings` of pydantic would parse the source code in every process.
    """
    (class_definition,) = ast.parse(inspect.getsource(declaring_class)).body
    assert isinstance(class_definition, ast.ClassDef)
    docstrings = {}
    for attribute, comment in pairwise(class_definition.body):
        match attribute, comment:
            case ast.AnnAssign(target=ast.Name(name)), ast.Expr(ast.Constant(str(docstring))):
                docstrings[name] = inspect.cleandoc(docstring)
    return docstrings


def make_type_schema(declared_type: object) -> Schema:
    """Return the schema of the plain values of a Python type."""
    return TypeAdapter(cast("type[object]", declared_type)).json_schema(schema_generator=Draft07)


def make_cell_schema() -> Schema:
    """Return the schema of a cell file; with `base`, other keys and all keys of detectors are optional."""
    cell = CellConfig.model_json_schema(schema_generator=Draft07, ref_template="#/definitions/{model}")
    sections, required = cell.pop("$defs"), cell.pop("required")
    detector = sections["DetectorConfig"]
    complete_detector = {"type": detector["type"], "required": detector.pop("required")}
    detector["type"] = [complete_detector["type"], "null"]
    detectors = {"additionalProperties": complete_detector}
    return {
        "$schema": DIALECT,
        "title": "A cell",
        **cell,
        "if": {"required": ["base"]},
        "else": {"required": required, "properties": {"detectors": detectors}},
        "definitions": sections,
    }


def make_value_or_reference_schema(*alternatives: Schema) -> Schema:
    """Return the schema of a value with one of these schemas, or of a reference `$name`."""
    return {"anyOf": [*alternatives, REFERENCE]}


def make_settings_schema(name: str, skill: type[Skill]) -> Schema:
    """Return the schema of the mapping of params and ports under the name of a skill."""
    required = [param.name for param in skill.params.values() if param.is_required]
    params = {key: _make_param_schema(param) for key, param in skill.params.items()}
    ports = {key: _make_port_schema(port) for key, port in skill.ports.items()}
    mapping = {
        "type": "object" if required or skill.one_of else ["object", "null"],
        "properties": {**params, **ports},
        "required": required,
        "additionalProperties": False,
        **({"oneOf": [{"required": [key]} for key in skill.one_of]} if skill.one_of else {}),
    }
    # Due to `allOf`, editors insert only the name of the skill, which is valid as an item and as a key.
    return {"title": name, **_document_skill(skill), "allOf": [mapping]}


def make_name_schemas(skills: Mapping[str, type[Skill]]) -> list[Schema]:
    """Return the schemas of skills that may be written as a name only: they require no setting."""
    return [
        {"const": name, "title": name, **_document_skill(skill), **NO_ITEM_SUGGESTION}
        for name, skill in skills.items()
        if not (skill.one_of or any(param.is_required for param in skill.params.values()))
    ]


def _document_skill(skill: type[Skill]) -> Schema:
    """Return the description of a skill for editors, with its docstring and reasons."""
    docstring = inspect.getdoc(skill) or ""
    markdown = f"{docstring}\n\nFailures: {', '.join(skill.reasons) or 'none'}"
    return {"description": docstring.partition("\n")[0], "markdownDescription": markdown}


def _make_param_schema(param: Param) -> Schema:
    schema = make_type_schema(param.type)
    bounds = {"minimum": param.ge, "maximum": param.le}
    schema |= {key: bound for key, bound in bounds.items() if bound is not None}
    if param.choices is not None:
        # A param for a name in the cell accepts the names in the cell file and the choices.
        schema["examples" if param.refers_to else "enum"] = list(param.choices)
    if not param.is_required:
        schema["default"] = to_jsonable_python(param.default)
    return {"description": _describe_param(param), **make_value_or_reference_schema(schema)}


def _describe_param(param: Param) -> str:
    """Return the description of a param with unit, bounds and default, because editors omit these."""
    limits = [f"at least {param.ge:g}"] if param.ge is not None else []
    limits += [f"at most {param.le:g}"] if param.le is not None else []
    limits += [f"{param.default} if not given"] if param.default not in (..., "", None) else []
    parts = (param.doc, f"[{param.unit}]" if param.unit else "", f"({', '.join(limits)})" if limits else "")
    return " ".join(part for part in parts if part)


def _make_port_schema(port: Port) -> Schema:
    is_output = port.direction is Direction.OUT
    description = f"{'output' if is_output else 'input'}: {port.doc}"
    if is_output or not is_plain_type(port.type):
        return {"description": description, **REFERENCE}
    return {"description": description, **make_value_or_reference_schema(make_type_schema(port.type))}
