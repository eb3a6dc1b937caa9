"""Generator of `missions/reference.md`; `uv run python .ci/mission_reference.py` writes it again."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator, Mapping
from math import inf
from pathlib import Path
from typing import Any

import yaml

from executive.behaviours import load_skills
from executive.cell.arm_config import ArmFile
from executive.cell.config import CellConfig
from executive.cell.device_config import Section
from executive.cell.tools import load_tool_models
from executive.cli.check import Declaration, collect_declarations
from executive.cli.main import main as command_line
from executive.drivers.sim.scene import SceneConfig
from executive.mission.grammar import LibraryKeys, MissionKeys, NodeKeys, ParamKeys, SubtreeKeys, UseKeys
from executive.mission.schema import Schema, make_key_schema, make_schema, make_type_schema
from executive.perception.detectors.detector_registry import find_detector_kinds
from executive.perception.detectors.noisy import NoisyOptions
from executive.perception.detectors.rfdetr import RfdetrOptions
from executive.perception.detectors.roboflow.detector import RoboflowOptions
from executive.text.files import list_shipped_missions
from executive.text.findings import MEANING_BY_CODE
from executive.tree.keys import KeyOwner
from executive.tree.node import load_control_nodes

MISSIONS = Path(__file__).parent.parent / "missions"
PATH = MISSIONS / "reference.md"
COMMAND = "uv run python .ci/mission_reference.py"
INTRODUCTION = f"""# Reference: missions, skills, cells and findings

This file is generated from the code: `{COMMAND}`. The tutorial is [README.md](README.md).

The column "default" shows the value of a key that a file does not contain; *required*: a file must contain \
the key. A *section* is a mapping with keys of its own; the heading of its table is its path. `NAME` \
stands for a name that you choose. Units are in brackets.
"""
KEYS = "key, value, default, meaning"
"""Columns of the tables of keys."""
DETECTOR_OPTIONS = {
    "embedded": None, "noisy": NoisyOptions, "rfdetr": RfdetrOptions, "roboflow": RoboflowOptions,
}  # fmt: skip
DEFINITIONS = {"expression": "expression after `=`", "formula": "expression",
    "node": "node", "reason": "reason", "variable": "name of a variable",
    "ParamKeys": "param", "SubtreeKeys": "subtree",
}  # fmt: skip
"""Values in words, by the definition in the schema of missions."""
VALUES_IN_WORDS = {
    "routes": "classes with bins",
    "quotas": "bins with numbers, or with numbers by class",
    "trees": "names with subtrees",
    "args": "list of names, or names with values",
    "with": "names with values",
    "until": "reason, expression after `=`, or list of both",
    "catch": "section, or list of sections",
}
"""Values of keys whose schemas are too long for a sentence."""
PARAM_TYPES = {"float": "number", "int": "whole number", "str": "text", "str | None": "text"}
"""Types of the params of skills in words."""


def generate() -> str:
    """Return the text of the reference."""
    codes = ([f"`{code}`", meaning] for code, meaning in MEANING_BY_CODE.items())
    chapters = {
        "Mission files": _mission_files(),
        "Control nodes": _control_nodes(),
        "Skills": (part for name, skill in load_skills().items() for part in _skill(name, skill)),
        "Subtrees of library/sorting.yaml": _sorting_library(),
        "Shipped missions": _shipped_missions(),
        "Cell files": _model(CellConfig),
        "Tools": _tools(),
        "Arm files": _model(ArmFile),
        "Detectors": _detectors(),
        "Scene files": _model(SceneConfig),
        "Findings of executive check": [_table("code, meaning", codes)],
        "Exit codes": [inspect.cleandoc(command_line.help or "").partition("Exit codes: ")[2]],
    }
    contents = "\n".join(f"* [{title}](#{slug(title)})" for title in chapters)
    texts = ("\n\n".join([f"## {title}", *parts]) for title, parts in chapters.items())
    return "\n\n".join([INTRODUCTION + "\n" + contents, *texts]) + "\n"


def slug(heading: str) -> str:
    """Return the anchor of a heading."""
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def _mission_files() -> Iterator[str]:
    models = {
        "A mission": MissionKeys, "A param of a mission": ParamKeys, "A library": LibraryKeys,
        "A subtree": SubtreeKeys, "Beside `use`": UseKeys, "Any node": NodeKeys,
    }  # fmt: skip
    for title, model in models.items():
        yield f"### {title}"
        properties = make_schema(model, {})["properties"]
        rows = []
        for name, field in model.get_keys().items():
            default = _default(... if field.is_required() else "")
            value = VALUES_IN_WORDS.get(name) or _value(properties[name])
            rows.append([f"`{name}`", value, default, properties[name].get("description", "")])
        yield _table(KEYS, rows)


def _control_nodes() -> Iterator[str]:
    yield (
        "The last lines about each node name its counterparts in other libraries, and the differences. "
        "`executive tree MISSION --format btcpp` writes the nodes of BehaviorTree.CPP."
    )
    for word, node in load_control_nodes().items():
        comparisons = {"BehaviorTree.CPP": f"custom node `{word}`", "py_trees": "no counterpart"}
        doc = inspect.getdoc(node) or ""
        missing = [f"* {name}: {text}." for name, text in comparisons.items() if f"* {name}: " not in doc]
        yield "\n".join([f"### `{word}`\n\n{doc}", *(["", *missing] if missing else [])])
        if node.any_of:
            yield f"At least one of {_listed(node.any_of)} is required."
        if node.reasons:
            yield f"Reason of its own: {_listed(f'{word}.{reason}' for reason in node.reasons)}."
        yield _table(KEYS, _key_rows(word, node))


def _key_rows(owner: str, node: type[KeyOwner], prefix: str = "") -> Iterator[list[str]]:
    for name, key in node.keys.items():
        written = f"`{prefix}{name}`" + (f", beside `{owner}`" if key.sibling else "")
        if key.shorthand:
            written = (f"{written}, or " if node.inner_keys else "") + f"the value of `{owner}`"
        schema = key.make_validator().json_schema() if key.is_constant else make_key_schema(key, {})
        value = VALUES_IN_WORDS.get(name) or _value(schema)
        value = value.replace("node", "condition") if key.requires_conditions else value
        value += f", at most {key.max_count}" if key.max_count else ""
        default = ... if key.is_required else key.field.default
        yield [written, value, _default(default), key.field.description or ""]
        if key.section:
            yield from _key_rows(name, key.section, f"{name}.")


def _skill(name: str, skill: type) -> Iterator[str]:
    facts = collect_declarations(name, skill)
    yield f"### `{name}`\n\n{facts['doc']}"
    tool = facts["tool"]
    left = "".join(f"; {state} after `{ending}`" for ending, state in tool["left"].items())
    yield (
        f"* Reasons: {_listed(facts['reasons']) or 'none'}\n"
        f"* Parts of the cell: {_listed(facts['uses']) or 'none'}\n"
        f"* Tool: {tool['before']} before, {tool['after']} after success{left}"
    )
    if entries := [*facts["ports"], *facts["params"]]:
        yield _table("name, kind, value, default, meaning", map(_skill_row, entries))


def _skill_row(entry: Declaration) -> list[str]:
    kind = {"in": "input", "out": "output", "": "param"}[entry.get("direction", "")]
    value = PARAM_TYPES.get(entry["type"], f"`{entry['type']}`")
    if entry["refers"]:
        value = f"name of {'an' if entry['refers'][0] in 'aeiou' else 'a'} {entry['refers']}"
        if entry["type"].startswith("list["):
            value = f"list of names of {entry['refers']}s"
    if entry.get("choices"):
        value = f"{_listed(entry['choices'])}{', or ' + value if entry['refers'] else ''}"
    value += f" [{entry['unit']}]" if entry.get("unit") else ""
    value += _bounds({"minimum": entry.get("min"), "maximum": entry.get("max")})
    default = "" if kind == "output" else ... if entry["required"] else entry["default"]
    return [f"`{entry['name']}`", kind, value, _default(default), entry["doc"]]


def _sorting_library() -> Iterator[str]:
    library, rows = yaml.safe_load((MISSIONS / "library" / "sorting.yaml").read_text(encoding="utf-8")), []
    yield library["description"]
    for name, tree in library["trees"].items():
        args = tree.get("args", {})
        defaults = [f"{arg}: {args[arg]}" if isinstance(args, dict) else arg for arg in args]
        rows.append([f"`{name}`", _listed(defaults), tree["doc"]])
    yield _table("subtree, arguments and defaults, meaning", rows)


def _shipped_missions() -> Iterator[str]:
    texts = ((MISSIONS / f"{name}.yaml").read_text(encoding="utf-8") for name in list_shipped_missions())
    missions = map(yaml.safe_load, texts)
    rows = ([f"`{one['mission']}`", f"`{one['cell']}`", one["description"]] for one in missions)
    yield _table("mission, cell, meaning", rows)


def _tools() -> Iterator[str]:
    for name, model in load_tool_models().items():
        yield f"### Tool `{name}`"
        yield from _model(model)


def _detectors() -> Iterator[str]:
    for name, entry in find_detector_kinds().items():
        yield f"### Kind `{name}`\n\n{(inspect.getdoc(entry.load()) or '').splitlines()[0]}"
        if options := DETECTOR_OPTIONS[name]:
            yield from _model(options)


def _model(model: type[Section]) -> Iterator[str]:
    """Yield the tables of a file or section, and of the sections below it."""
    schema = make_type_schema(model)
    paths: dict[str, list[str]] = {}

    def visit(part: Schema, prefix: str) -> None:
        # The section `tool` has the keys of its kind, which have a chapter of their own.
        for name, key in part.get("properties", {}).items():
            for one in key.get("anyOf", [key]):
                named = one.get("additionalProperties")
                if "$ref" in (section := named if isinstance(named, dict) else one):
                    definition = section["$ref"].rpartition("/")[2]
                    path = f"{prefix}{name}.NAME" if section is named else f"{prefix}{name}"
                    paths.setdefault(definition, []).append(path)
                    visit(schema["$defs"][definition], f"{path}.")

    visit(schema, "")
    sections = {"": schema, **{name: schema["$defs"][name] for name in paths}}
    for definition, section in sections.items():
        if "properties" not in section:
            continue
        rows = []
        for name, key in section["properties"].items():
            default = ... if name in section.get("required", ()) else key.get("default")
            rows.append([f"`{name}`", _value(key), _default(default), key.get("description", "")])
        heading = f"### {_listed(paths[definition])}\n\n" if definition else ""
        yield f"{heading}{section['description']}\n\n{_table(KEYS, rows)}"


def _value(schema: Schema, plural: str = "") -> str:
    """Return a JSON schema in words."""
    (schema,) = schema.get("allOf", [schema])
    if not schema.keys() - {"description"}:
        return "any value"
    types = schema.get("type")
    if "properties" in schema:
        return f"section{plural}"
    if isinstance(types, list):
        if types == ["string", "number", "boolean"]:
            return f"text{plural}"
        alternatives = [{**schema, "type": one} for one in types]
        return _value({"anyOf": alternatives}, plural)
    if "anyOf" in schema:
        values = [_value(one, plural) for one in schema["anyOf"] if one.get("type") != "null"]
        return ", or ".join(dict.fromkeys(values))
    if "const" in schema or "enum" in schema:
        return _listed(schema.get("enum") or [schema["const"]])
    if "$ref" in schema:
        definition = schema["$ref"].rpartition("/")[2]
        return "`$name`" if definition == "reference" else f"{DEFINITIONS.get(definition, 'section')}{plural}"
    if types == "object":
        named = schema.get("additionalProperties") or next(iter(schema["patternProperties"].values()))
        return f"names with {_value(named, 's')}"
    if types == "array":
        items = schema.get("items", {})
        items = items[0] if isinstance(items, list) else items
        count = f"{schema['minItems']} " if schema.get("minItems") == schema.get("maxItems", 0) else ""
        return f"list{plural} of {count}{_value(items, 's')}" if items else f"list{plural}"
    if types == "string" and "pattern" in schema:
        return f"name{plural}"
    words = {"number": f"number{plural}", "integer": f"whole number{plural}", "string": f"text{plural}"}
    return words.get(types, "`true` or `false`") + _bounds(schema)


def _bounds(schema: Mapping[str, float | None]) -> str:
    words = {
        "minimum": "at least", "exclusiveMinimum": "above", "maximum": "at most", "exclusiveMaximum": "below",
    }  # fmt: skip
    bounds = {word: schema[key] for key, word in words.items() if schema.get(key) is not None}
    if list(bounds) == ["at least", "at most"]:
        return ", {:g} to {:g}".format(*bounds.values())
    return "".join(f", {word} {bound:g}" for word, bound in bounds.items())


def _default(value: Any) -> str:
    """Return a default in words; `...`: the value is required."""
    if value is ...:
        return "*required*"
    if value in (None, "", (), [], {}, inf):
        return ""
    value = str(value).lower() if isinstance(value, bool) else value
    return "its defaults" if isinstance(value, dict) else f"`{value}`"


def _listed(words: Iterable[object]) -> str:
    return ", ".join(f"`{word}`" for word in words)


def _table(columns: str, rows: Iterable[list[str]]) -> str:
    lines = [columns.split(", "), ["---"] * (columns.count(",") + 1)]
    for row in rows:
        assert row[-1], f"{row[0]} has no description; write it where {row[0]} is declared"
        lines.append([" ".join(cell.split()).replace("|", "\\|") for cell in row])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    PATH.write_text(generate(), encoding="utf-8")
