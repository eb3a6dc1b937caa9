"""The JSON Schema of mission, library and cell files: what it accepts, what it marks, and where."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import cache
from typing import Any

import pytest
from jsonschema import Draft7Validator
from referencing import Registry

from executive.behaviours import load_skills
from executive.mission.schema import (
    make_arm_schema,
    make_cell_schema,
    make_library_schema,
    make_mission_schema,
)
from executive.skill import Skill
from executive.text.files import get_shipped_folder
from executive.text.findings import Source
from executive.text.yaml_files import parse_yaml
from executive.tree.node import load_control_nodes

MISSIONS = get_shipped_folder()

Maker = Callable[[], dict[str, Any]]


@cache
def make_shipped_mission_schema() -> dict[str, Any]:
    return make_mission_schema(load_skills(), load_control_nodes())


@cache
def make_shipped_library_schema() -> dict[str, Any]:
    return make_library_schema(load_skills(), load_control_nodes())


SCHEMAS: dict[str, tuple[Maker, str]] = {
    "mission.schema.json": (make_shipped_mission_schema, ""),
    "cells/cell.schema.json": (cache(make_cell_schema), " --cell"),
    "arms/arm.schema.json": (cache(make_arm_schema), " --arm"),
}
"""The generated files: what makes the content of each, and the option that prints it."""
FILES = {
    "mission.schema.json": "*.yaml",
    "library/library.schema.json": "library/*.yaml",
    "cells/cell.schema.json": "cells/*.yaml",
    "arms/arm.schema.json": "arms/*.yaml",
}
"""The shipped schemas, and the files each is for."""


FOLDER = "file:///missions"
SHIPPED: Registry[Any] = Registry().with_contents(
    (f"{FOLDER}/{name}", json.loads((MISSIONS / name).read_text(encoding="utf-8"))) for name in FILES
)
"""The shipped schemas, which refer to each other by their place."""


def problems(schema: dict[str, Any], text: str) -> list[str]:
    """Return the place and the reason of everything that the schema finds wrong with a YAML text."""
    root, findings = parse_yaml(Source("shown.yaml", text))
    assert root is not None
    assert not findings
    found = Draft7Validator(schema, registry=SHIPPED).iter_errors(root.python_value)
    return [f"{'.'.join(map(str, problem.absolute_path))}: {problem.message}" for problem in found]


@pytest.mark.parametrize("name", SCHEMAS)
def test_the_shipped_schema_is_the_generated_one(name: str) -> None:
    make, option = SCHEMAS[name]
    written = json.loads((MISSIONS / name).read_text(encoding="utf-8"))
    assert written == make(), f"run `executive schema{option} > missions/{name}`"


@pytest.mark.parametrize(
    "make", [*(make for make, _ in SCHEMAS.values()), make_shipped_library_schema], ids=[*SCHEMAS, "library"]
)
def test_the_schema_is_sound_draft_07(make: Maker) -> None:
    schema = make()
    Draft7Validator.check_schema(schema)
    referred = set(re.findall(r'"\$ref": "#/definitions/(\w+)"', json.dumps(schema)))
    assert referred <= set(schema["definitions"])


@pytest.mark.parametrize("name", FILES)
def test_the_schema_accepts_every_shipped_file(name: str) -> None:
    files = {path.name: path.read_text(encoding="utf-8") for path in MISSIONS.glob(FILES[name])}
    found = {file: problems({"$ref": f"{FOLDER}/{name}"}, text) for file, text in files.items()}
    assert files and not {file: wrong for file, wrong in found.items() if wrong}


HEAD = "mission: m\ncell: cells/small.yaml\n"

WELL_FORMED = """
mission: m-1
description: Everything that the language has.
cell: cells/small.yaml
library: [library/one.yaml]
params:
  tries: 2
  names: [a, b]
  height: {default: 0.2, type: number, min: 0, max: 1, doc: How high.}
  kind: {type: text, choices: [cube, duck]}
routes: {cube: red_bin, duck: [red_bin, blue_bin]}
tree:
  - Look
  - Look:
  - Look: {view: $view, seen: $first}
    as: first
  - Pick: {seen: $first, height: 0.2, only: null}
  - parallel: [Look, succeed]
  - parallel: {wait_for: any, halt: true, do: [Look, {Drop: {bin: red_bin}}]}
  - fallback: [{sequence: [Look]}, {invert: Look}, {succeed: Look}, {succeed: }]
  - retry:
      attempts: $tries
      on: Pick.missed
      backoff: {first: 0.5, factor: 2, max: 8}
      recover: Look
      do: [Look, Pick]
  - retry: {attempts: 2, backoff: 1, do: Look}
  - repeat: {times: 3, until: [Look.unsure, first.hidden], do: Look}
  - while: {condition: Look, do: Pick}
  - guard: {holds: {all: [Look, {any: [Look, {not: Look}]}]}, do: Pick}
  - for_each: {each: name, in: $names, do: Pick}
  - for_each: {each: name, in: [a, b], do: Pick}
  - try: Pick
    catch: [{on: Pick.missed, do: Look}]
    finally: Look
    as: tried
  - timeout: {seconds: "= 1.5 * $n", do: Look}
  - if: {holds: $n < 3, then: Look, else: [{holds: $n == 4}, {set: n, to: = $n + 1}]}
  - {fail: "only {$n}", as: too_few}
  - finish: enough
  - use: look
    with: {view: full, height: 0.1}
    returns: {seen: $mine}
trees:
  look: {doc: A look., args: {view: table, height: }, returns: [seen], do: {Look: {view: $view}}}
  twice: {args: [height], do: [Look, Look]}
  again: {returns: $seen, do: Look}
  short: [Look, Pick]
  shorter: Look
"""


@pytest.fixture(scope="module")
def mission_schema(skills: dict[str, type[Skill]]) -> dict[str, Any]:
    """The schema of missions with the throw-away skills."""
    return make_mission_schema(skills, load_control_nodes())


def test_everything_of_the_language_is_accepted(mission_schema: dict[str, Any]) -> None:
    assert problems(mission_schema, WELL_FORMED) == []
    written = set(re.findall(r"[a-z_]+(?=:)", WELL_FORMED))
    assert set(load_control_nodes()) <= written, "the example must show every control node"


BROKEN = {
    "unknown top key": ("tre: Look\ntree: Look", "'tre' was unexpected"),
    "no tree": ("trees: {a: Look}", "'tree' is a required property"),
    "unknown skill": ("tree: Lok", "tree: 'Lok' is not valid"),
    "skill without what it needs": ("tree: Drop", "tree: 'Drop' is not valid"),
    "empty list": ("tree: []", "tree: [] should be non-empty"),
    "catch beside retry": ("tree: {retry: {attempts: 2, do: Look}, catch: []}", "'catch' was unexpected"),
    "bad label": ("tree: {Look: , as: First}", "tree.as: 'First' does not match"),
    "unknown param": ("tree: {Look: {vieww: full}}", "tree.Look: Additional properties"),
    "no such choice": ("tree: {Look: {view: ful}}", "tree.Look.view: 'ful' is not valid"),
    "misplaced dollar": ("tree: {Pick: {height: $}}", "tree.Pick.height: '$' is not valid"),
    "value for an output": ("tree: {Look: {seen: first}}", "tree.Look.seen: 'first' does not match"),
    "missing key": ("tree: {retry: {do: Look}}", "tree.retry: 'attempts' is a required property"),
    "unknown reason": ("tree: {repeat: {until: Pick.mised, do: Look}}", "tree.repeat.until: 'Pick.mised'"),
    "no time": ("tree: {timeout: {seconds: 0, do: Look}}", "tree.timeout.seconds: 0 is not valid"),
    "loop variable with dollar": ("tree: {for_each: {each: $n, in: [a], do: Look}}", "tree.for_each.each"),
    "subtree without do": ("tree: Look\ntrees: {a: {doc: A., args: []}}", "trees.a: {'doc'"),
    "bad name of a param": ("params: {a-b: 1}\ntree: Look", "params: 'a-b' does not match"),
    "no such type": ("params: {a: {default: 1, type: float}}\ntree: Look", "params.a.type: 'float' is not"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_wrong_is_marked(case: str, mission_schema: dict[str, Any]) -> None:
    text, expected = BROKEN[case]
    assert expected in "\n".join(problems(mission_schema, HEAD + text))


@pytest.mark.parametrize(
    "make",
    [lambda: {"$ref": f"{FOLDER}/library/library.schema.json"}, make_shipped_library_schema],
    ids=["shipped", "printed"],
)
def test_a_library_has_subtrees_and_no_tree(make: Maker) -> None:
    schema = make()
    assert problems(schema, "library: sorting\ntrees: {look: Detect}") == []
    assert "'tree' was unexpected" in problems(schema, "library: a\ntrees: {}\ntree: Detect")[0]
    assert "trees.look" in problems(schema, "library: a\ntrees: {look: {do: {Detect: {vieww: a}}}}")[0]


def test_a_cell_with_a_base_needs_no_other_key(small_cell: str) -> None:
    schema = SCHEMAS["cells/cell.schema.json"][0]()
    assert problems(schema, small_cell) == []
    assert problems(schema, "base: small.yaml") == []
    assert ": 'arm' is a required property" in problems(schema, "cell: a")
    assert "'tabel' was unexpected" in problems(schema, "base: small.yaml\ntabel: {}")[0]
    changed = "detectors: {embedded: {floor: 0.3}, other: }"
    assert problems(schema, f"base: small.yaml\n{changed}") == []
    alone = problems(schema, small_cell.replace("detectors:\n  first: {kind: embedded}", changed))
    assert sorted(alone) == [
        "detectors.embedded: 'kind' is a required property",
        "detectors.other: None is not of type 'object'",
    ]
    assert "safe_place: [0, 0] is too short" in problems(schema, "base: a.yaml\nsafe_place: [0, 0]")[0]
