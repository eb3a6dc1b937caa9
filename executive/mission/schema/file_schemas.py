"""JSON Schema of mission and library files, from the grammar, installed skills and control nodes."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from executive.mission.model import grammar
from executive.mission.model.grammar import AllowedKeys, GrammarKey, GrammarKeys
from executive.mission.parse.mapping_reader import NAME_PATTERN
from executive.mission.parse.params import PARAM_TYPES
from executive.mission.schema.types import (
    DIALECT,
    NO_ITEM_SUGGESTION,
    Schema,
    make_name_schemas,
    make_settings_schema,
    make_value_or_reference_schema,
)
from executive.plugins import Skills
from executive.tree.keys import PREDEFINED_LISTS, Key, KeyKind
from executive.tree.node import ControlNode
from executive.tree.node_registry import ControlNodes

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
            "param": _make_param_schema(),
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


def _make_param_schema() -> Schema:
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
