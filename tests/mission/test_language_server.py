"""The shipped schemas in an editor: what the YAML language server completes and shows.

It marks what the schemas do not accept, which `test_schema` tests.

Skipped where there is none: `npm install yaml-language-server`, and name its program in the variable
YAML_LANGUAGE_SERVER, or put it on the PATH. Tried with yaml-language-server 1.25.0 and Node 20.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator

import pytest
from editor import Editor

from executive.mission.text.file_search import get_shipped_folder
from executive.plugins import load_skills
from executive.tree.node_registry import load_control_nodes

SERVER = os.environ.get("YAML_LANGUAGE_SERVER") or shutil.which("yaml-language-server")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        SERVER is None or shutil.which("node") is None, reason="there is no yaml-language-server"
    ),
]

MISSIONS = get_shipped_folder()
HEAD = "# yaml-language-server: $schema=mission.schema.json\nmission: m\ncell: cells/overhead.yaml\n"
LIBRARY = "# yaml-language-server: $schema=library/library.schema.json\nlibrary: l\n"
CELL = "# yaml-language-server: $schema=cells/cell.schema.json\nbase: overhead.yaml\n"


@pytest.fixture(scope="module")
def editor() -> Iterator[Editor]:
    editor = Editor(str(SERVER), MISSIONS)
    yield editor
    editor.close()


SKILLS = set(load_skills())
WORDS = {
    name for name, skill in load_skills().items() if not any(p.is_required for p in skill.params.values())
}
"""Skills that may stand for themselves."""

REASONS = {"Detect.unsure", "Grasp.missed", "Transit.dropped"}

COMPLETED = {
    "top-level keys": ("|", {"description", "params", "routes", "tree", "trees"}, {"mission", "cell"}),
    "skills after a key": ("tree: |\n", WORDS | {"succeed"}, {"retry"}),
    "words on a new line": ("tree:\n  |\n", SKILLS | {*load_control_nodes(), "use"}, {"do"}),
    "a word begun in a list": ("tree:\n  - Detect\n  - Gr|\n", {"Grasp"}, {"do"}),
    "params of a skill": ("tree:\n  - Detect:\n      |\n", {"view", "detector", "detections"}, {"Grasp"}),
    "further params": ("tree:\n  - Detect: {view: full, d|}\n", {"doubtful"}, {"view"}),
    "choices of a param": ("tree:\n  - Detect: {view: |}\n", {"table", "full"}, {"Grasp"}),
    "nodes under a key": ("tree:\n  retry:\n    do: |\n", WORDS, {"attempts"}),
    "reasons in brackets": ("tree:\n  retry:\n    on: [Grasp.missed, De|]\n", REASONS, {"Grasp"}),
    "until": ("tree:\n  repeat:\n    until: |\n", {"SelectTarget.no_candidate"}, {"SelectTarget"}),
    "partners of try": ("tree:\n  - try: Detect\n    |\n", {"as", "catch", "finally"}, {"with", "Grasp"}),
    "partners of use": ("tree:\n  - use: look\n    |\n", {"as", "with", "returns"}, {"catch", "Grasp"}),
    "keys of a catch": ("tree:\n  try: Detect\n  catch:\n    - |\n", {"on", "do"}, {"Grasp"}),
    "keys of a subtree": ("trees:\n  look:\n    doc: A look.\n    |\n", {"args", "do", "returns"}, {"Grasp"}),
    "a library": (f"{LIBRARY}|", {"trees", "description"}, {"tree"}),
    "nodes of a library": (f"{LIBRARY}trees:\n  a:\n    - |\n", SKILLS, {"do"}),
    "a cell": (f"{CELL}|", {"arm", "bins", "safe_place"}, {"tree"}),
    "keys of a cell": (f"{CELL}table:\n  |\n", {"x", "y", "objects", "gap"}, {"arm"}),
    "keys of a declared param": ("params:\n  a:\n    |\n", {"default", "type", "min", "max", "doc"}, {"do"}),
}  # fmt: skip


@pytest.mark.parametrize("case", COMPLETED)
def test_what_fits_is_completed_and_nothing_else(case: str, editor: Editor) -> None:
    text, wanted, unwanted = COMPLETED[case]
    offered = set(editor.completions(text if text.startswith("#") else HEAD + text))
    assert wanted <= offered
    assert not unwanted & offered


def test_a_skill_is_written_as_one_word_and_a_control_node_with_what_it_needs(editor: Editor) -> None:
    offered = editor.completions(HEAD + "tree:\n  - |\n")
    assert {offered[skill] for skill in SKILLS} == SKILLS
    assert offered["retry"] == "retry:\n    attempts: $1\n    do: $2"


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
