"""JSON Schemas (draft-07, for most editors) of mission, library, cell and arm files."""

from __future__ import annotations

import ast
import inspect
import json
import re
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import chain, pairwise
from typing import TypeAlias, cast, get_origin

from pydantic import BaseModel, TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema, to_jsonable_python

from executive.behaviours import Skills
from executive.cell.arm_config import ArmFile
from executive.cell.config import CellConfig
from executive.mission import grammar
from executive.mission.grammar import BehaviourKeys, FileKeys, LibraryKeys, MissionKeys, NodeKeys, UseKeys
from executive.mission.node_parser import EXPRESSION_PATTERN
from executive.mission.ports import is_plain_type
from executive.skill import Direction, Param, Port, Skill
from executive.tree.keys import AnyValue, Children, Elements, Key, KeyOwner, list_member_types
from executive.tree.node import ControlNode, ControlNodes
from executive.tree.specification import Expression

Schema: TypeAlias = JsonSchemaValue
"""A JSON Schema or a subschema."""

NO_ITEM_SUGGESTION: Schema = {"allOf": [True]}
"""Subschema that allows every value, but stops the suggestion "- (array item)" of yaml-language-server."""

REFERENCE: Schema = {"$ref": "#/definitions/reference"}
"""Schema of a reference `$name`."""

EXPRESSION: Schema = {"$ref": "#/definitions/expression"}
"""Schema of an expression after `=`."""

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
        """Return the schema of a section of a file, without title."""
        section_schema = super().model_schema(schema)
        del section_schema["title"]
        ancestors = reversed(schema["cls"].__mro__[:-1])
        sections = (each for each in ancestors if issubclass(each, BaseModel) and each is not BaseModel)
        for section in sections:
            for name, docstring in find_attribute_docstrings(section).items():
                key = section.model_fields[name].alias or name
                section_schema["properties"][key]["description"] = docstring
        return section_schema

    def field_title_should_be_set(self, _schema: object) -> bool:
        """Return False, because no field has a title."""
        return False


@cache
def find_attribute_docstrings(declaring_class: type[object]) -> Mapping[str, str]:
    """Return the docstring of each annotated attribute of a class and its bases in the same module, by name.

    The option `use_attribute_docstrings` of pydantic would parse the source code in every process. Cached,
    because several sections contain the same class, and the module is parsed for each class.
    """
    owners = [owner for owner in declaring_class.__mro__ if owner.__module__ == declaring_class.__module__]
    definitions = [ast.parse(inspect.getsource(owner)).body[0] for owner in owners]
    docstrings = {}
    for attribute, comment in chain.from_iterable(pairwise(ast.iter_child_nodes(one)) for one in definitions):
        match attribute, comment:
            case ast.AnnAssign(target=ast.Name(name)), ast.Expr(ast.Constant(str(docstring))):
                docstrings[name] = inspect.cleandoc(docstring)
    return docstrings


def make_type_schema(declared_type: object) -> Schema:
    """Return the schema of the plain values of a Python type."""
    return TypeAdapter(cast("type[object]", declared_type)).json_schema(schema_generator=Draft07)


def make_arm_schema() -> Schema:
    """Return the schema of an arm file; limits that a URDF can contain are optional."""
    arm = _make_model_schema(ArmFile)
    arm["required"].remove("effort")
    limits = arm["$defs"]["LimitsConfig"]
    limits["required"] = [key for key in limits["required"] if key not in ("position_deg", "velocity_deg")]
    return {"$schema": DIALECT, "title": "An arm", **arm, "definitions": arm.pop("$defs")}


def make_cell_schema() -> Schema:
    """Return the schema of a cell file; with `base`, other keys and all keys of detectors are optional.

    The keys of the sections of an arm file are optional, except those of `limits` if `arm` names no file.
    """
    cell = _make_model_schema(CellConfig)
    sections = cell.pop("$defs")
    limits = {"required": sections["LimitsConfig"].pop("required")}
    sections["ArmConfig"]["else"]["properties"] = {"limits": limits}
    del sections["FlangeConfig"]["required"]
    required = cell.pop("required")
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


def _make_model_schema(model: type[BaseModel]) -> Schema:
    return model.model_json_schema(schema_generator=Draft07, ref_template="#/definitions/{model}")


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


def make_name_schemas(skills: Skills) -> list[Schema]:
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
    if param.candidate:
        return {"description": _describe_param(param), "$ref": "#/definitions/formula"}
    schema = make_type_schema(param.type)
    bounds = {"minimum": param.ge, "maximum": param.le}
    schema |= {key: bound for key, bound in bounds.items() if bound is not None}
    if param.choices is not None:
        # A param for a name in the cell accepts the names in the cell file and the choices.
        schema["examples" if param.refers_to else "enum"] = list(param.choices)
    if not param.is_required:
        schema["default"] = to_jsonable_python(param.default)
    return {"description": _describe_param(param), **make_value_or_reference_schema(schema, EXPRESSION)}


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
    return {
        "description": description,
        **make_value_or_reference_schema(make_type_schema(port.type), EXPRESSION),
    }


class _FileSchema(Draft07):
    """Generator of the schemas of mission and library files.

    A union of types whose schemas do not overlap becomes one schema with a list of types, because editors
    mark errors more precisely in such a schema than in `anyOf`.
    """

    def union_schema(self, schema: core_schema.UnionSchema) -> Schema:
        """Return the schema of a union of types."""
        return _merge_alternatives(super().union_schema(schema))

    def nullable_schema(self, schema: core_schema.NullableSchema) -> Schema:
        """Return the schema of an optional value."""
        return _merge_alternatives(super().nullable_schema(schema))

    def dict_schema(self, schema: core_schema.DictSchema) -> Schema:
        """Return the schema of a mapping; no other keys are allowed than those of the declared pattern."""
        mapping = super().dict_schema(schema)
        return {**mapping, "additionalProperties": False} if "patternProperties" in mapping else mapping

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> Schema:
        """Return the schema without default, which editors would insert."""
        return self.generate_inner(schema["schema"])


def _merge_alternatives(schema: Schema) -> Schema:
    """Return one schema with a list of types for `anyOf`, if no alternative restricts another one."""
    alternatives = schema.get("anyOf", [])
    keywords = [name for one in alternatives for name in one if name != "type"]
    if not all("type" in one for one in alternatives) or len(keywords) > len(set(keywords)):
        return schema
    types: list[str] = []
    merged: Schema = {}
    for one in alternatives:
        types += [one["type"]] if isinstance(one["type"], str) else one["type"]
        merged |= one
    return {**merged, "type": types}


def make_mission_schema(skills: Skills, node_classes: ControlNodes) -> Schema:
    """Return the schema of a mission file; its definition `library` is the schema of a library file."""
    return _make_file_schema("A mission", MissionKeys, skills, node_classes)


def make_library_schema(skills: Skills, node_classes: ControlNodes) -> Schema:
    """Return the schema of a library file."""
    return _make_file_schema("A library", LibraryKeys, skills, node_classes)


def _make_file_schema(title: str, keys: type[FileKeys], skills: Skills, node_classes: ControlNodes) -> Schema:
    definitions: dict[str, Schema] = {}
    file = make_schema(keys, definitions)
    name: Schema = {"type": "string", "pattern": f"^{grammar.NAME_EXPRESSION}$"}
    definitions |= {
        "library": make_schema(LibraryKeys, definitions),
        "node": _make_node_schema(skills, node_classes, definitions),
        "reason": _make_reason_schema(skills),
        "variable": name,
        "reference": {
            "title": "$name",
            "type": "string",
            "pattern": rf"^\${grammar.NAME_EXPRESSION}(\.{grammar.NAME_EXPRESSION})?$",
        },
        "expression": {"title": "= expression", "type": "string", "pattern": "^="},
        "formula": {"title": "expression", "type": ["string", "boolean"]},
        **{skill: make_settings_schema(skill, skills[skill]) for skill in skills},
        **{
            word: {
                "title": word,
                "description": _get_first_line(node_class),
                **_make_owner_schema(node_class, definitions),
            }
            for word, node_class in node_classes.items()
        },
        grammar.USE_KEYWORD: {"title": grammar.USE_KEYWORD, "description": "A subtree by its name.", **name},
        grammar.BEHAVIOUR_KEYWORD: {
            **make_schema(BehaviourKeys, definitions),
            "title": grammar.BEHAVIOUR_KEYWORD,
            "description": "A behaviour of py_trees.",
        },
    }
    return {"$schema": DIALECT, **file, "title": title, "definitions": definitions}


def make_schema(declared_type: object, definitions: dict[str, Schema]) -> Schema:
    """Return the schema of a type, with references to the definitions in the schema of a file.

    The schemas of the models that the type contains are added to `definitions`.
    """
    adapter: TypeAdapter[object] = TypeAdapter(cast("type[object]", declared_type))
    schema = adapter.json_schema(schema_generator=_FileSchema, ref_template="#/definitions/{model}")
    # `Child` and other types name a definition, because pydantic accepts references to its own models only.
    text = re.sub(r'"definition": "(\w+)"', r'"$ref": "#/definitions/\1"', json.dumps(schema))
    resolved: Schema = json.loads(text)
    definitions |= resolved.pop("$defs", {})
    return resolved


def _make_node_schema(skills: Skills, node_classes: ControlNodes, definitions: dict[str, Schema]) -> Schema:
    """Return the schema of a node: a name, a list, or a mapping with one name (skill or keyword) as a key.

    The name selects the schema of the other keys by `dependencies`, because editors mark invalid keys and
    complete valid keys in `dependencies`, but not in alternatives.
    """
    label: Schema = make_schema(NodeKeys, definitions)["properties"]
    names = [*skills, *node_classes, grammar.USE_KEYWORD, grammar.BEHAVIOUR_KEYWORD]
    nodes_without_body = [
        {"const": word, "title": word, "description": _get_first_line(node_class), **NO_ITEM_SUGGESTION}
        for word, node_class in node_classes.items()
        if node_class.is_value_optional()
    ]
    siblings: dict[str, Schema] = {grammar.USE_KEYWORD: make_schema(UseKeys, definitions)["properties"]}
    requirements: dict[str, Schema] = {}
    for word, node_class in node_classes.items():
        keys = node_class.sibling_keys
        siblings[word] = _make_properties(keys, definitions)
        requirements[word] = _require_any_of(node_class.any_of) if set(node_class.any_of) & set(keys) else {}
    return {
        "title": "A node",
        "anyOf": [
            *make_name_schemas(skills),
            *nodes_without_body,
            {
                "title": "expression",
                "type": "string",
                "pattern": EXPRESSION_PATTERN.pattern,
                **NO_ITEM_SUGGESTION,
            },
            {"type": "array", "items": _make_reference("node"), **NO_ITEM_SUGGESTION},
            {"type": "object", **NO_ITEM_SUGGESTION},
        ],
        "minItems": 1,
        "dependencies": {
            name: {
                "properties": {name: _make_reference(name), **label, **siblings.get(name, {})},
                "additionalProperties": False,
                **requirements.get(name, {}),
            }
            for name in names
        },
        "if": {"anyOf": [{"required": [name]} for name in names]},
        "else": {
            "properties": {**{name: _make_reference(name) for name in names}, **label},
            "additionalProperties": False,
            "minProperties": 1,
            "dependencies": {"as": {"minProperties": 2}},
        },
    }


def _make_owner_schema(owner: type[KeyOwner], definitions: dict[str, Schema]) -> Schema:
    """Return the schema of the value of a control node or of a section: its keys, or one value."""
    shorthand = owner.shorthand_key
    inner_keys = owner.inner_keys
    alternatives = [make_key_schema(shorthand, definitions)] if shorthand else []
    if inner_keys:
        mapping = {
            "type": "object",
            "properties": _make_properties(inner_keys, definitions),
            "required": [name for name, key in inner_keys.items() if key.is_required],
            "additionalProperties": False,
        }
        requirement = _require_any_of(owner.any_of) if set(owner.any_of) <= set(inner_keys) else {}
        alternatives.append({**mapping, **requirement})
    return alternatives[0] if len(alternatives) == 1 else {"anyOf": alternatives}


def _get_first_line(node_class: type[ControlNode]) -> str:
    return (inspect.getdoc(node_class) or "").partition("\n")[0]


def make_key_schema(key: Key, definitions: dict[str, Schema]) -> Schema:
    """Return the schema of the value of a key; a single value counts as a list with one item."""
    if key.value_type == Expression:
        return _make_reference("formula")
    if key.value_type == AnyValue:
        return {}
    if key.is_constant:
        constant = key.make_validator().json_schema()
        expressions = [EXPRESSION] if key.accepts_expression else []
        return make_value_or_reference_schema(*constant.get("anyOf", [constant]), *expressions)
    if key.value_type == Elements:
        return make_value_or_reference_schema(*make_schema(Elements, definitions)["anyOf"])
    section = key.section
    items = [
        _make_owner_schema(section, definitions)
        if section is not None and member is section
        else make_schema(member, definitions)
        for member in list_member_types(key.value_type)
    ]
    if key.value_type == Children:
        return _make_list_schema(items)
    if get_origin(key.value_type) is tuple:
        return _merge_alternatives({"anyOf": [*items, _make_list_schema(items)]})
    # Due to `allOf`, editors insert only the keyword of a node without a body.
    may_be_empty = key.shorthand and not key.is_required
    return {"allOf": [{"anyOf": [*items, {"type": "null"}]}]} if may_be_empty else items[0]


def _make_list_schema(items: Sequence[Schema]) -> Schema:
    item = items[0] if len(items) == 1 else {"anyOf": items}
    return {"type": "array", "items": item, "minItems": 1}


def _require_any_of(keys: Sequence[str]) -> Schema:
    """Return the schema that requires at least one of `keys`; {} without keys."""
    return {"anyOf": [{"required": [key]} for key in keys]} if keys else {}


def _make_reason_schema(skills: Skills) -> Schema:
    skill_reasons = [f"{name}.{reason}" for name, skill in skills.items() for reason in skill.reasons]
    label_pattern = rf"^{grammar.LABEL_EXPRESSION}\.{grammar.NAME_EXPRESSION}$"
    return {
        "anyOf": [
            {"title": "Skill.reason", "enum": skill_reasons},
            {"title": "Behaviour.failed", "type": "string", "pattern": r"^[A-Za-z_]\w*\.failed$"},
            {"title": "label.reason", "type": "string", "pattern": label_pattern},
        ]
    }


def _make_properties(keys: Mapping[str, Key], definitions: dict[str, Schema]) -> Schema:
    return {
        name: {"description": key.field.description, **make_key_schema(key, definitions)}
        for name, key in keys.items()
    }


def _make_reference(name: str) -> Schema:
    """Return the schema that refers to the definition with a name."""
    return {"$ref": f"#/definitions/{name}"}
