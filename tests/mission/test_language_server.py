"""The shipped schemas in an editor: what the YAML language server completes, marks and shows.

Skipped where there is none: `npm install yaml-language-server`, and name its program in the variable
YAML_LANGUAGE_SERVER, or put it on the PATH. Tried with yaml-language-server 1.25.0 and Node 20.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from editor import Editor

from executive.discovery import discover
from executive.mission.model import grammar
from executive.mission.text.files import shipped_folder

SERVER = os.environ.get("YAML_LANGUAGE_SERVER") or shutil.which("yaml-language-server")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        SERVER is None or shutil.which("node") is None, reason="there is no yaml-language-server"
    ),
]

MISSIONS = shipped_folder()
HEAD = "# yaml-language-server: $schema=mission.schema.json\nmission: m\ncell: cells/overhead.yaml\n"
CELL_HEAD = "# yaml-language-server: $schema=cells/cell.schema.json\n"


@pytest.fixture(scope="module")
def editor() -> Iterator[Editor]:
    editor = Editor(str(SERVER), MISSIONS)
    yield editor
    editor.close()


SKILLS = set(discover())
WORDS = {name for name, skill in discover().items() if not any(p.required for p in skill.params.values())}
"""Skills that may stand for themselves."""

REASONS = {"Detect.unsure", "Grasp.missed", "Transit.dropped"}

COMPLETED = {
    "top-level keys": ("|", {"description", "params", "routes", "tree", "trees"}, {"mission", "cell"}),
    "skills after a key": ("tree: |\n", WORDS | {"succeed"}, {"retry"}),
    "skills and control words on a new line": ("tree:\n  |\n", SKILLS | set(grammar.CONTROL), {"do"}),
    "skills and control words in a list": ("tree:\n  - |\n", SKILLS | set(grammar.CONTROL), {"do"}),
    "a word begun in a list": ("tree:\n  - Detect\n  - Gr|\n", {"Grasp"}, {"do"}),
    "skills in a list in brackets": ("tree: [Detect, |]\n", WORDS, {"do"}),
    "a word begun in a list in brackets": ("tree: [Detect, Gr|]\n", {"Grasp"}, {"do"}),
    "a word begun in braces": ("tree: [Detect, {Mo|}]\n", {"MoveToScan"}, {"do"}),
    "params of a skill": ("tree:\n  - Detect:\n      |\n", {"view", "detector", "detections"}, {"Grasp"}),
    "params of a skill in braces": ("tree:\n  - Detect: {v|}\n", {"view"}, {"Grasp"}),
    "further params": ("tree:\n  - Detect: {view: full, d|}\n", {"doubtful"}, {"view"}),
    "choices of a param": ("tree:\n  - Detect: {view: |}\n", {"table", "full"}, {"Grasp"}),
    "keys of a control node": ("tree:\n  retry:\n    |\n", {"attempts", "on", "recover", "do"}, {"catch"}),
    "nodes under a key": ("tree:\n  retry:\n    do: |\n", WORDS, {"attempts"}),
    "reasons": ("tree:\n  retry:\n    on: |\n", REASONS, {"Grasp"}),
    "reasons in brackets": ("tree:\n  retry:\n    on: [Grasp.missed, De|]\n", REASONS, {"Grasp"}),
    "reasons in a list": ("tree:\n  retry:\n    on:\n      - |\n", REASONS, {"Grasp"}),
    "until": ("tree:\n  repeat:\n    until: |\n", {"SelectTarget.no_candidate"}, {"SelectTarget"}),
    "partners of try": ("tree:\n  - try: Detect\n    |\n", {"as", "catch", "finally"}, {"with", "Grasp"}),
    "partners of use": ("tree:\n  - use: look\n    |\n", {"as", "with", "returns"}, {"catch", "Grasp"}),
    "keys of a catch": ("tree:\n  try: Detect\n  catch:\n    - |\n", {"on", "do"}, {"Grasp"}),
    "keys of a subtree": ("trees:\n  look:\n    doc: A look.\n    |\n", {"args", "do", "returns"}, {"Grasp"}),
    "keys of a declared param": ("params:\n  a:\n    |\n", {"default", "type", "min", "max", "doc"}, {"do"}),
}  # fmt: skip


@pytest.mark.parametrize("case", COMPLETED)
def test_what_fits_is_completed_and_nothing_else(case: str, editor: Editor) -> None:
    text, wanted, unwanted = COMPLETED[case]
    offered = set(editor.completions(HEAD + text))
    assert wanted <= offered
    assert not unwanted & offered


def test_a_skill_is_written_as_one_word_and_a_control_node_with_what_it_needs(editor: Editor) -> None:
    offered = editor.completions(HEAD + "tree:\n  - |\n")
    assert {offered[skill] for skill in SKILLS} == SKILLS
    assert offered["retry"] == "retry:\n    attempts: $1\n    do: $2"


MARKED = {
    "unknown top key": ("tre: Detect\ntree: Detect", "tre", "Property tre is not allowed."),
    "unknown control word": ("tree:\n  - rety: {do: Detect}", "rety", "Property rety is not allowed."),
    "unknown skill": ("tree: [Detect, Gras]", "Gras", 'Value must be "Approach" |'),
    "unknown param": ("tree:\n  - Detect: {vieww: full}", "vieww", "Property vieww is not allowed."),
    "unknown choice": ("tree: {Detect: {view: ful}}", "ful", 'Valid values: "table", "full"'),
    "too large": ("tree: {Approach: {offset: 0.9}}", "0.9", "above the maximum of 0.02"),
    "unknown reason": ("tree: {retry: {attempts: 2, on: [Grasp.mised], do: Grasp}}", "Grasp.mised", "Valid"),
    "missing key": ("tree: {retry: {do: Grasp}}", "retry", 'Missing property "attempts".'),
    "misspelt below": ("tree: Detect\ntrees: {a: {do: [{Grasp: {setle: 1}}]}}", "setle", "is not allowed."),
    "no partner": ("tree: {retry: {attempts: 2, do: Grasp}, catch: []}", "catch", "catch is not allowed."),
}


@pytest.mark.parametrize("case", MARKED)
def test_a_mistake_is_marked_where_it_is(case: str, editor: Editor) -> None:
    text, marked, message = MARKED[case]
    ((where, said),) = editor.problems(HEAD + text + "\n")
    assert where == marked
    assert message in said


def test_two_skills_in_one_mapping_are_both_marked(editor: Editor) -> None:
    found = editor.problems(HEAD + "tree: {Detect: , Grasp: }\n")
    assert sorted(where for where, _ in found) == ["Detect", "Grasp"]


@pytest.mark.parametrize(
    "path",
    sorted(MISSIONS.rglob("*.yaml")),
    ids=lambda path: str(path.relative_to(MISSIONS)),
)
def test_nothing_is_marked_in_a_shipped_file(path: Path, editor: Editor) -> None:
    (schema,) = path.parent.glob("*.schema.json")
    text = path.read_text(encoding="utf-8")
    assert editor.problems(f"# yaml-language-server: $schema={schema.name}\n{text}", path.parent) == []


def test_a_library_is_completed_and_checked(editor: Editor) -> None:
    head = "# yaml-language-server: $schema=library/library.schema.json\nlibrary: l\n"
    assert {"trees", "description"} <= set(editor.completions(head + "|"))
    assert editor.completions(head + "trees:\n  a:\n    - |\n").keys() >= SKILLS
    assert editor.problems(head + "trees: {a: {Detect: {vieww: full}}}\n") == [
        ("vieww", "Property vieww is not allowed.")
    ]


def test_a_cell_is_completed_and_checked(editor: Editor) -> None:
    assert {"arm", "bins", "safe_place"} <= set(editor.completions(CELL_HEAD + "base: overhead.yaml\n|"))
    assert set(editor.completions(CELL_HEAD + "base: a\ntable:\n  |\n")) >= {"x", "y", "objects", "gap"}
    assert editor.problems(CELL_HEAD + "base: overhead.yaml\ntabel: {}\n") == [
        ("tabel", "Property tabel is not allowed.")
    ]


SHOWN = {
    "a skill": ("tree: [De|tect]\n", "Know which objects a fresh image shows"),
    "a skill with params": ("tree:\n  - Det|ect: {view: full}\n", "* may fail with `unsure`, `hidden`"),
    "a param": ("tree: {Approach: {off|set: 0.01}}\n", "(at least 0, at most 0.02, 0.0025 if not given)"),
    "a control node": ("tree: {ret|ry: {attempts: 2, do: Grasp}}\n", "Again after a failure."),
    "a key": ("tree: {retry: {att|empts: 2, do: Grasp}}\n", "How often at most, first time included."),
}


@pytest.mark.parametrize("case", SHOWN)
def test_what_a_word_means_is_shown(case: str, editor: Editor) -> None:
    text, meaning = SHOWN[case]
    assert meaning in editor.hover(HEAD + text).replace("\\", "")
