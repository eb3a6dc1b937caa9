"""Names: unique classes, verbs for functions, and none of the words that nobody outside the project uses."""

from __future__ import annotations

import ast
import re
from collections import Counter

from guide_blocks import GUIDES, ROOT

FORBIDDEN_WORDS = frozenset((ROOT / "tests/words.txt").read_text(encoding="utf-8").split())
SOURCES = {
    path: ast.parse(path.read_text(encoding="utf-8"))
    for folder in ("executive", "skills")
    for path in sorted((ROOT / folder).rglob("*.py"))
}
IRREGULAR_PARTICIPLES = (
    "begun|bought|broken|brought|built|caught|chosen|done|drawn|driven|fallen|found|given|gone|grown|heard|held|"
    "kept|known|laid|left|lost|made|meant|met|paid|seen|sent|shown|sold|spent|stood|stuck|taken|thrown|written"
)
PARTICIPLE = re.compile(
    rf"_*({IRREGULAR_PARTICIPLES}|[a-z]{(3,)}(ed|ing))(_(as|at|by|for|from|in|of|on|to|with).*)?"
)
NO_PARTICIPLES = frozenset({"during", "finding", "mapping", "proceed", "succeed", "warning"})
VALUE_DECORATORS = ("property", "contextmanager", "fixture")
"""Decorators of functions that are used like values."""


def find_forbidden(text: str) -> set[str]:
    words = re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", text)
    return {word.lower() for word in words} & FORBIDDEN_WORDS


def test_no_two_classes_have_the_same_name() -> None:
    bodies = [node for tree in SOURCES.values() for node in tree.body]
    names = Counter(node.name for node in bodies if isinstance(node, ast.ClassDef))
    assert [name for name, count in names.items() if count > 1] == []


def test_no_name_and_no_text_contains_a_forbidden_word() -> None:
    guides = [ROOT / guide for guide in (*GUIDES, "CONTRIBUTING.md", "executive/README.md")]
    missions = [*(ROOT / "missions").rglob("*.yaml"), *(ROOT / "executive").rglob("*.jinja")]
    pages = [path for path in (ROOT / "executive/view").rglob("*") if path.suffix in (".html", ".js", ".svg")]
    texts = [(path, path.read_text(encoding="utf-8")) for path in (*guides, *missions, *pages)]
    for path, tree in SOURCES.items():
        for node in ast.walk(tree):
            match node:
                case ast.FunctionDef(name=text) | ast.ClassDef(name=text) | ast.arg(arg=text):
                    texts.append((path, text))
                case ast.Name(id=text) | ast.Attribute(attr=text, ctx=ast.Store()) | ast.Constant(str(text)):
                    texts.append((path, text))
    assert [(str(path), words) for path, text in texts if (words := find_forbidden(text))] == []


def test_no_function_that_acts_is_named_by_a_participle() -> None:
    functions = [
        (str(path), node.name)
        for path, tree in SOURCES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        and not any(word in ast.unparse(one) for one in node.decorator_list for word in VALUE_DECORATORS)
    ]
    assert [
        (path, name)
        for path, name in functions
        if PARTICIPLE.fullmatch(name) and name.strip("_").split("_")[0] not in NO_PARTICIPLES
    ] == []
