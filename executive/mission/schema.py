"""JSON Schemas (draft-07, for most editors) of mission, library and cell files."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TypeAlias, cast

import yaml
from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema, to_jsonable_python

from executive.cell.config import CellConfig
from executive.mission import grammar
from executive.mission.grammar import AllowedKeys, GrammarKey, GrammarKeys
from executive.mission.mapping_reader import NAME_PATTERN
from executive.mission.mission_file import PARAM_TYPES
from executive.mission.ports import is_plain_type
from executive.plugins import Skills
from executive.skill import Direction, Param, Port, Skill
from executive.tree.keys import PREDEFINED_LISTS, Key, KeyKind
from executive.tree.node import ControlNode
from executive.tree.node_registry import ControlNodes

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


_NAME = NAME_PATTERN.pattern
"""Regular expression of a name, for use in longer expressions."""
_KINDS_FILE = Path(__file__).parent / "kinds.yaml"
_SCHEMAS_BY_KIND: Mapping[str, Schema] = yaml.safe_load(_KINDS_FILE.read_text(encoding="utf-8"))
"""Schema of the value of a key, by `GrammarKey.kind`."""
_REASON: Schema = {"$ref": "#/definitions/reason"}
"""Schema of the name of a failure."""


def make_mission_schema(skills: Skills, node_classes: ControlNodes) -> Schema:
    """Return the schema of a mission file; its definition `library` is the schema of a library file."""
    return _make_file_schema("A mission", grammar.MISSION_KEYS, skills, node_classes)


def make_library_schema(skills: Skills, node_classes: ControlNodes) -> Schema:
    """Return the schema of a library file."""
    return _make_file_schema("A library", grammar.LIBRARY_KEYS, skills, node_classes)


def _make_file_schema(title: str, keys: GrammarKeys, skills: Skills, node_classes: ControlNodes) -> Schema:
    control_nodes = {word: _make_control_node_schema(node_class) for word, node_class in node_classes.items()}
    use = {"title": grammar.USE_KEYWORD, "description": "A subtree by its name.", **_SCHEMAS_BY_KIND["name"]}
    subtree = {"title": "A subtree", **_make_mapping_schema(grammar.SUBTREE_KEYS)}
    return {
        "$schema": DIALECT,
        "title": title,
        **_make_mapping_schema(keys),
        "definitions": {
            "node": _make_node_schema(skills, node_classes),
            "tree": {"anyOf": [_make_reference("node"), subtree]},
            "param": _make_mission_param_schema(),
            "library": _make_mapping_schema(grammar.LIBRARY_KEYS),
            "reason": _make_reason_schema(skills),
            "reasons": {"anyOf": [*_make_reason_schema(skills)["anyOf"], _make_list_schema(_REASON)]},
            "label": {"type": "string", "pattern": f"^{grammar.LABEL_PATTERN}$"},
            "reference": {"title": "$name", "type": "string", "pattern": rf"^\${_NAME}(\.{_NAME})?$"},
            **{name: make_settings_schema(name, skill) for name, skill in skills.items()},
            **control_nodes,
            grammar.USE_KEYWORD: use,
            grammar.BEHAVIOUR_KEYWORD: _make_behaviour_schema(),
        },
    }


def _make_node_schema(skills: Skills, node_classes: ControlNodes) -> Schema:
    """Return the schema of a node: a name, a list, or a mapping with one name (skill or keyword) as a key.

    The name selects the schema of the other keys by `dependencies`, because editors mark invalid keys and
    complete valid keys in `dependencies`, but not in alternatives.
    """
    label: Schema = {**_make_reference("label"), "description": grammar.LABEL_KEY.doc}
    names = [*skills, *node_classes, grammar.USE_KEYWORD, grammar.BEHAVIOUR_KEYWORD]
    nodes_without_body = [
        {"const": word, "title": word, "description": _get_first_line(node_class), **NO_ITEM_SUGGESTION}
        for word, node_class in node_classes.items()
        if grammar.is_value_optional(node_class)
    ]
    siblings: dict[str, Schema] = {grammar.USE_KEYWORD: _make_properties(grammar.USE_SIBLINGS)}
    requirements: dict[str, Schema] = {}
    for word, node_class in node_classes.items():
        keys = grammar.find_sibling_keys(node_class)
        siblings[word] = _make_properties(keys)
        requirements[word] = _require_any_of(node_class.any_of) if set(node_class.any_of) & set(keys) else {}
    return {
        "title": "A node",
        "anyOf": [
            *make_name_schemas(skills),
            *nodes_without_body,
            {"type": "array", "items": _make_reference("node"), **NO_ITEM_SUGGESTION},
            {"type": "object", **NO_ITEM_SUGGESTION},
        ],
        "minItems": 1,
        "dependencies": {
            name: {
                "properties": {name: _make_reference(name), "as": label, **siblings.get(name, {})},
                "additionalProperties": False,
                **requirements.get(name, {}),
            }
            for name in names
        },
        "if": {"anyOf": [{"required": [name]} for name in names]},
        "else": {
            "properties": {**{name: _make_reference(name) for name in names}, "as": label},
            "additionalProperties": False,
            "minProperties": 1,
            "dependencies": {"as": {"minProperties": 2}},
        },
    }


def _make_control_node_schema(node_class: type[ControlNode]) -> Schema:
    """Return the schema of the value of the keyword of a control node."""
    shorthand, inner_keys = grammar.find_shorthand_key(node_class), grammar.find_inner_keys(node_class)
    alternatives = [_make_value_schema(shorthand)] if shorthand else []
    if inner_keys:
        any_of = node_class.any_of
        requirement = _require_any_of(any_of) if set(any_of) <= set(inner_keys) else {}
        alternatives.append({**_make_mapping_schema(inner_keys), **requirement})
    value = alternatives[0] if len(alternatives) == 1 else {"anyOf": alternatives}
    return {"title": node_class.keyword, "description": _get_first_line(node_class), **value}


def _make_behaviour_schema() -> Schema:
    """Return the schema of the mapping under `PyTree`: its arguments and ports depend on the behaviour."""
    title = grammar.BEHAVIOUR_KEYWORD
    mapping = {**_make_mapping_schema(grammar.BEHAVIOUR_KEYS), "additionalProperties": True}
    return {"title": title, "description": "A behaviour of py_trees.", **mapping}


def _get_first_line(node_class: type[ControlNode]) -> str:
    return (inspect.getdoc(node_class) or "").partition("\n")[0]


def _make_value_schema(key: Key | GrammarKey) -> Schema:
    """Return the schema of the value of a key."""
    if isinstance(key, GrammarKey):
        return _SCHEMAS_BY_KIND[key.kind]
    match key.kind:
        case KeyKind.NODE:
            node = _make_reference("node")
            may_be_empty = key.shorthand and not key.is_required
            return {"allOf": [{"anyOf": [node, {"type": "null"}]}]} if may_be_empty else node
        case KeyKind.NODES | KeyKind.REASONS | KeyKind.VARIABLE:
            return _SCHEMAS_BY_KIND[key.kind.name.lower()]
        case KeyKind.REASONS_OR_SECTIONS:
            section = {**_make_mapping_schema(key.section.keys), **_require_any_of(key.section.any_of)}
            return {"anyOf": [_make_reference("reasons"), section, _make_list_schema(_REASON, section)]}
        case KeyKind.ELEMENTS:
            return make_value_or_reference_schema({"type": "array"}, {"enum": list(PREDEFINED_LISTS)})
        case KeyKind.SECTIONS:
            section = _make_mapping_schema(key.section.keys)
            return {**section, "type": ["array", "object"], "items": section}
        case KeyKind.SECTION:
            section = _make_mapping_schema(key.section.keys)
            shorthand = grammar.find_shorthand_key(key.section)
            if shorthand is None:
                return section
            value = shorthand.make_validator().json_schema()
            return make_value_or_reference_schema({**section, **value, "type": [value["type"], "object"]})
    constant = key.make_validator().json_schema()
    return make_value_or_reference_schema(*constant.get("anyOf", [constant]))


def _require_any_of(keys: Sequence[str]) -> Schema:
    """Return the schema that requires at least one of `keys`; {} without keys."""
    return {"anyOf": [{"required": [key]} for key in keys]} if keys else {}


def _make_reason_schema(skills: Skills) -> Schema:
    skill_reasons = [f"{name}.{reason}" for name, skill in skills.items() for reason in skill.reasons]
    label_pattern = rf"^{grammar.LABEL_PATTERN}\.{_NAME}$"
    return {
        "anyOf": [
            {"title": "Skill.reason", "enum": skill_reasons},
            {"title": "Behaviour.failed", "type": "string", "pattern": r"^[A-Za-z_]\w*\.failed$"},
            {"title": "label.reason", "type": "string", "pattern": label_pattern},
        ]
    }


def _make_list_schema(*item_schemas: Schema) -> Schema:
    """Return the schema of a list whose items have one of the schemas."""
    return {"title": "list", "type": "array", "items": {"anyOf": [*item_schemas]}, "minItems": 1}


def _make_mission_param_schema() -> Schema:
    declaration = _make_mapping_schema(grammar.PARAM_KEYS)
    declaration["properties"]["type"]["enum"] = list(PARAM_TYPES)
    return {**declaration, "type": ["object", "array", "string", "number", "boolean", "null"]}


def _make_mapping_schema(keys: AllowedKeys) -> Schema:
    return {
        "type": "object",
        "properties": _make_properties(keys),
        "required": [name for name, key in keys.items() if key.is_required],
        "additionalProperties": False,
    }


def _make_properties(keys: AllowedKeys) -> Schema:
    return {name: {"description": key.doc, **_make_value_schema(key)} for name, key in keys.items()}


def _make_reference(name: str) -> Schema:
    """Return the schema that refers to the definition with a name."""
    return {"$ref": f"#/definitions/{name}"}
