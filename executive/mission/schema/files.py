"""The JSON Schema of mission and library files, from the grammar and the installed skills."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from executive.mission.model import grammar
from executive.mission.model.grammar import Form, Key
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

_NAME = NAME.pattern


def mission_schema(skills: Mapping[str, type[Skill]]) -> Json:
    """Return the schema of a mission file that may use these skills; `library` defines library files."""
    return _file("A mission", grammar.MISSION, skills)


def library_schema(skills: Mapping[str, type[Skill]]) -> Json:
    """Return the schema of a library file whose subtrees may use these skills."""
    return _file("A library", grammar.LIBRARY, skills)


def _file(title: str, keys: Mapping[str, Key], skills: Mapping[str, type[Skill]]) -> Json:
    return {
        "$schema": DIALECT,
        "title": title,
        **_mapping(keys),
        "definitions": {
            "node": _node([*skills, *grammar.CONTROL], skills),
            "tree": {"anyOf": [_ref("node"), {"title": "A subtree", **_mapping(grammar.SUBTREE)}]},
            "param": _param(),
            "library": _mapping(grammar.LIBRARY),
            "catch": _mapping(grammar.CATCH),
            "reasons": _reasons(skills),
            "label": {"type": "string", "pattern": f"^{grammar.LABEL}$"},
            "reference": {"title": "$name", "type": "string", "pattern": rf"^\${_NAME}$"},
            **{name: settings(name, skill) for name, skill in skills.items()},
            **{word: _form(word, form) for word, form in grammar.CONTROL.items()},
        },
    }


def _node(heads: list[str], skills: Mapping[str, type[Skill]]) -> Json:
    """Return the schema of a node: a word, a list, or a mapping with one head and what belongs to it.

    A mapping is judged by the heads it has, never by trying one kind of node after the other, so an
    editor complains about the key that is wrong and completes the keys that fit.
    """
    label: Json = {**_ref("label"), "description": grammar.AS.doc}
    bodiless = [
        {"const": word, "title": word, "description": form.doc, **ALTERNATIVE}
        for word, form in grammar.CONTROL.items()
        if form.short == "node?"
    ]
    partners = {word: _properties(form.partners) for word, form in grammar.CONTROL.items()}
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
                "properties": {head: _ref(head), "as": label, **partners.get(head, {})},
                "additionalProperties": False,
                **_one_of(grammar.CONTROL[head].one_of if partners.get(head) else ()),
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


def _form(word: str, form: Form) -> Json:
    shapes = [_KINDS[form.short]] if form.short else []
    shapes += [{**_mapping(form.keys), **_one_of(form.one_of)}] if form.keys else []
    return {"title": word, "description": form.doc, **(shapes[0] if len(shapes) == 1 else {"anyOf": shapes})}


def _one_of(keys: Sequence[str]) -> Json:
    """Return the demand that one of these keys at least is there."""
    return {"anyOf": [{"required": [key]} for key in keys]} if keys else {}


def _reasons(skills: Mapping[str, type[Skill]]) -> Json:
    one = [
        {"title": "Skill.reason", "enum": failures(skills)},
        {"title": "label.reason", "type": "string", "pattern": rf"^{grammar.LABEL}\.{_NAME}$"},
    ]
    several = {"title": "list", "type": "array", "items": {"anyOf": one}, "minItems": 1}
    return {"anyOf": [*one, several]}


def _param() -> Json:
    declared = _mapping(grammar.PARAM)
    declared["properties"]["type"]["enum"] = list(TYPES)
    return {**declared, "type": ["object", "array", "string", "number", "boolean", "null"]}


def _mapping(keys: Mapping[str, Key]) -> Json:
    return {
        "type": "object",
        "properties": _properties(keys),
        "required": [name for name, key in keys.items() if key.required],
        "additionalProperties": False,
    }


def _properties(keys: Mapping[str, Key]) -> Json:
    return {name: {"description": key.doc, **_value(key)} for name, key in keys.items()}


def _value(key: Key) -> Json:
    given = {"minimum": key.minimum, "exclusiveMinimum": key.above}
    bounds = {word: bound for word, bound in given.items() if bound is not None}
    if key.kind in ("integer", "number", "boolean"):
        return or_reference({"type": key.kind, **bounds})
    if key.kind == "count":
        return or_reference({"enum": ["all", "any", "lead"]}, {"type": "integer", **bounds})
    if key.kind == "catches":
        return {**_mapping(grammar.CATCH), "type": ["array", "object"], "items": _ref("catch")}
    if key.kind == "backoff":
        return or_reference({**_mapping(grammar.BACKOFF), "type": ["number", "object"], **bounds})
    return _KINDS[key.kind]


def _ref(name: str) -> Json:
    return {"$ref": f"#/definitions/{name}"}


def _named(value: Json) -> Json:
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
    "node?": {"allOf": [{"anyOf": [_ref("node"), {"type": "null"}]}]},
    "nodes": {"type": "array", "items": _ref("node"), "minItems": 1},
    "reasons": _ref("reasons"),
    "text": {"type": ["string", "number", "boolean"]},
    "word": {"type": "string", **_WORD},
    "words": {**_one_or_several({"pattern": rf"^\$?{_NAME}$"}), "minItems": 0},
    "list": or_reference({"type": "array"}),
    "value": {},
    "values": _named({}),
    "variables": _named(REFERENCE),
    "paths": _one_or_several({}),
    "params": _named(_ref("param")),
    "routes": {"type": ["object", "null"], "additionalProperties": _one_or_several({})},
    "trees": _named(_ref("tree")),
    "args": {**_named({}), "type": ["object", "array", "null"], "items": {"type": "string", **_WORD}},
}
"""What stands under a key, by its kind; kinds made of other keys are built in `_value`."""
