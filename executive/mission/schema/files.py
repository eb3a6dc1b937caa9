"""JSON Schema of mission and library files, from the grammar and the installed skills."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from executive.mission.model import grammar
from executive.mission.model.grammar import GrammarKey
from executive.mission.parse.control import find_inner_keys, find_shorthand_key
from executive.mission.parse.fields import NAME
from executive.mission.parse.params import TYPES
from executive.mission.schema.types import (
    ALTERNATIVE,
    DIALECT,
    REFERENCE,
    Json,
    failures,
    or_reference,
    settings,
    words,
)
from executive.skill import Skill
from executive.tree.keys import Key, Kind
from executive.tree.node import ControlNode
from executive.tree.registry import ControlNodes

Skills: TypeAlias = Mapping[str, type[Skill]]

_NAME = NAME.pattern


def mission_schema(skills: Skills, control: ControlNodes) -> Json:
    """Return the schema of a mission file that may use these skills and control nodes.

    Its definition `library` is that of library files.
    """
    return _file("A mission", grammar.MISSION, skills, control)


def library_schema(skills: Skills, control: ControlNodes) -> Json:
    """Return the schema of a library file whose subtrees may use these skills and control nodes."""
    return _file("A library", grammar.LIBRARY, skills, control)


def _file(title: str, keys: Mapping[str, GrammarKey], skills: Skills, control: ControlNodes) -> Json:
    forms = {word: _form(kind) for word, kind in control.items()}
    forms[grammar.USE] = {"title": grammar.USE, "description": "A subtree by its name.", **_KINDS["word"]}
    return {
        "$schema": DIALECT,
        "title": title,
        **_mapping(keys),
        "definitions": {
            "node": _node(skills, control),
            "tree": {"anyOf": [_ref("node"), {"title": "A subtree", **_mapping(grammar.SUBTREE)}]},
            "param": _param(),
            "library": _mapping(grammar.LIBRARY),
            "reasons": _reasons(skills),
            "label": {"type": "string", "pattern": f"^{grammar.LABEL_PATTERN}$"},
            "reference": {"title": "$name", "type": "string", "pattern": rf"^\${_NAME}$"},
            **{name: settings(name, skill) for name, skill in skills.items()},
            **forms,
        },
    }


def _node(skills: Skills, control: ControlNodes) -> Json:
    """Return the schema of a node: a word, a list, or a mapping with one head and its siblings.

    The head selects the schema of a mapping, without alternatives, so that an editor marks the invalid key
    and completes the valid keys.
    """
    label: Json = {**_ref("label"), "description": grammar.AS.doc}
    heads = [*skills, *control, grammar.USE]
    bodiless = [
        {"const": word, "title": word, "description": _sentence(kind), **ALTERNATIVE}
        for word, kind in control.items()
        if (bare := find_shorthand_key(kind)) is not None and not bare.is_required
    ]
    siblings: dict[str, Json] = {grammar.USE: _properties(grammar.USE_SIBLINGS)}
    demands: dict[str, Json] = {}
    for word, kind in control.items():
        beside = {name: key for name, key in kind.keys.items() if key.is_sibling}
        siblings[word] = {name: _key(key) for name, key in beside.items()}
        demands[word] = _any_of(kind.any_of) if set(kind.any_of) & set(beside) else {}
    return {
        "title": "A node",
        "anyOf": [
            *words(skills),
            *bodiless,
            {"type": "array", "items": _ref("node"), **ALTERNATIVE},
            {"type": "object", **ALTERNATIVE},
        ],
        "minItems": 1,
        "dependencies": {
            head: {
                "properties": {head: _ref(head), "as": label, **siblings.get(head, {})},
                "additionalProperties": False,
                **demands.get(head, {}),
            }
            for head in heads
        },
        "if": {"anyOf": [{"required": [head]} for head in heads]},
        "else": {
            "properties": {**{head: _ref(head) for head in heads}, "as": label},
            "additionalProperties": False,
            "minProperties": 1,
            "dependencies": {"as": {"minProperties": 2}},
        },
    }


def _form(kind: type[ControlNode]) -> Json:
    """Return the schema of the value under the keyword of a control node."""
    bare, inner = find_shorthand_key(kind), find_inner_keys(kind)
    shapes = [_value_of(bare)] if bare else []
    if inner:
        demand = _any_of(kind.any_of) if set(kind.any_of) <= set(inner) else {}
        shapes.append({**_object(inner), **demand})
    whole = shapes[0] if len(shapes) == 1 else {"anyOf": shapes}
    return {"title": kind.keyword, "description": _sentence(kind), **whole}


def _sentence(kind: type[ControlNode]) -> str:
    return (inspect.getdoc(kind) or "").partition("\n")[0]


def _object(keys: Mapping[str, Key]) -> Json:
    return {
        "type": "object",
        "properties": {name: _key(key) for name, key in keys.items()},
        "required": [name for name, key in keys.items() if key.is_required],
        "additionalProperties": False,
    }


def _key(key: Key) -> Json:
    return {"description": key.doc, **_value_of(key)}


def _value_of(key: Key) -> Json:
    """Return the schema of the value of a key of a control node."""
    match key.kind:
        case Kind.NODE:
            is_needed = key.is_required or not key.is_shorthand
            return _ref("node") if is_needed else {"allOf": [{"anyOf": [_ref("node"), {"type": "null"}]}]}
        case Kind.NODES:
            return _KINDS["nodes"]
        case Kind.REASONS:
            return _ref("reasons")
        case Kind.VARIABLE:
            return _KINDS["word"]
        case Kind.ELEMENTS:
            return _KINDS["list"]
        case Kind.SECTIONS:
            section = _object(key.section.keys)
            return {**section, "type": ["array", "object"], "items": section}
        case Kind.SECTION:
            section, bare = _object(key.section.keys), find_shorthand_key(key.section)
            if bare is None:
                return section
            written = bare.make_validator().json_schema()
            return or_reference({**section, **written, "type": [written["type"], "object"]})
    written = key.make_validator().json_schema()
    return or_reference(*written.get("anyOf", [written]))


def _any_of(keys: Sequence[str]) -> Json:
    """Return the schema that requires at least one of these keys."""
    return {"anyOf": [{"required": [key]} for key in keys]} if keys else {}


def _reasons(skills: Skills) -> Json:
    one = [
        {"title": "Skill.reason", "enum": failures(skills)},
        {"title": "label.reason", "type": "string", "pattern": rf"^{grammar.LABEL_PATTERN}\.{_NAME}$"},
    ]
    several = {"title": "list", "type": "array", "items": {"anyOf": one}, "minItems": 1}
    return {"anyOf": [*one, several]}


def _param() -> Json:
    declared = _mapping(grammar.PARAM)
    declared["properties"]["type"]["enum"] = list(TYPES)
    return {**declared, "type": ["object", "array", "string", "number", "boolean", "null"]}


def _mapping(keys: Mapping[str, GrammarKey]) -> Json:
    return {
        "type": "object",
        "properties": _properties(keys),
        "required": [name for name, key in keys.items() if key.required],
        "additionalProperties": False,
    }


def _properties(keys: Mapping[str, GrammarKey]) -> Json:
    return {name: {"description": key.doc, **_KINDS[key.kind]} for name, key in keys.items()}


def _ref(name: str) -> Json:
    return {"$ref": f"#/definitions/{name}"}


def _map_names_to(value: Json) -> Json:
    """Return the schema of a mapping from names to values."""
    return {
        "type": ["object", "null"],
        "patternProperties": {f"^{_NAME}$": value},
        "additionalProperties": False,
    }


def _one_or_several(text: Json) -> Json:
    return {**text, "type": ["string", "array"], "items": {"type": "string", **text}, "minItems": 1}


_WORD: Json = {"pattern": "^[A-Za-z_][A-Za-z0-9_-]*$"}

_KINDS: Mapping[str, Json] = {
    "node": _ref("node"),
    "nodes": {"type": "array", "items": _ref("node"), "minItems": 1},
    "number": {"type": "number"},
    "text": {"type": ["string", "number", "boolean"]},
    "word": {"type": "string", **_WORD},
    "words": {**_one_or_several({"pattern": rf"^\$?{_NAME}$"}), "minItems": 0},
    "list": or_reference({"type": "array"}),
    "value": {},
    "values": _map_names_to({}),
    "variables": _map_names_to(REFERENCE),
    "paths": _one_or_several({}),
    "params": _map_names_to(_ref("param")),
    "routes": {"type": ["object", "null"], "additionalProperties": _one_or_several({})},
    "trees": _map_names_to(_ref("tree")),
    "args": {**_map_names_to({}), "type": ["object", "array", "null"], "items": {"type": "string", **_WORD}},
}
"""Content of a key, by its kind."""
