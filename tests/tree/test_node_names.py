"""No file but its own names a control node."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path

import executive
from executive.mission.model.grammar import SEQUENCE_KEYWORD, USE_KEYWORD
from executive.tree.node_registry import load_control_nodes

PACKAGE = Path(inspect.getfile(executive)).parent

GRAMMAR = {("mission/model/grammar.py", SEQUENCE_KEYWORD), ("mission/model/grammar.py", USE_KEYWORD)}
"""The two words that belong to the grammar: a bare list is a sequence, and `use` stands before a subtree."""

OTHER_MEANINGS = {
    ("cells/sim/scene_file.py", "any"),  # any class of objects
    ("skill.py", "any"),  # any state of the tool
    ("record/diagnosis/diagnosis.py", "repeat"),  # label before the command that repeats a run
}
"""Strings that equal a word and mean something else."""


def names_in(file: Path, words: set[str], classes: dict[str, str]) -> Iterator[str]:
    """Yield the words of control nodes in strings, and the imports of their classes."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and node.value in words:
            yield str(node.value)
        elif isinstance(node, ast.ImportFrom) and node.module in classes:
            yield classes[node.module]
        elif isinstance(node, ast.Attribute | ast.Name):
            name = node.attr if isinstance(node, ast.Attribute) else node.id
            if name in classes:
                yield name


def test_no_other_file_names_a_control_node() -> None:
    kinds = load_control_nodes().values()
    words = {kind.keyword for kind in kinds} | {USE_KEYWORD}
    # `Sequence` is also a type of Python: imports of its module are found all the same.
    classes = {kind.__name__: kind.keyword for kind in kinds if kind.__name__ != "Sequence"}
    classes |= {kind.__module__: kind.keyword for kind in kinds}
    own = {Path(inspect.getfile(kind)) for kind in kinds}
    found = {
        (file.relative_to(PACKAGE).as_posix(), name)
        for file in sorted(PACKAGE.rglob("*.py"))
        if file not in own
        for name in names_in(file, words, classes)
    }
    assert found == GRAMMAR | OTHER_MEANINGS
