"""Names: unique classes, and none of the words that nobody outside the project uses."""

from __future__ import annotations

import ast
import re
from collections import Counter
from pathlib import Path

import pytest
from guide_blocks import GUIDES, ROOT

FORBIDDEN_WORDS = frozenset((ROOT / "tests/words.txt").read_text(encoding="utf-8").split())


@pytest.fixture(scope="module")
def sources() -> dict[Path, ast.Module]:
    """Every module of the project."""
    paths = [path for folder in ("executive", "skills") for path in sorted((ROOT / folder).rglob("*.py"))]
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in paths}


def find_forbidden(text: str) -> set[str]:
    words = re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", text)
    return {word.lower() for word in words} & FORBIDDEN_WORDS


def test_no_two_classes_have_the_same_name(sources: dict[Path, ast.Module]) -> None:
    bodies = [node for tree in sources.values() for node in tree.body]
    names = Counter(node.name for node in bodies if isinstance(node, ast.ClassDef))
    assert [name for name, count in names.items() if count > 1] == []


def test_no_name_and_no_text_contains_a_forbidden_word(sources: dict[Path, ast.Module]) -> None:
    guides = [ROOT / guide for guide in (*GUIDES, "CONTRIBUTING.md", "executive/README.md")]
    missions = [*(ROOT / "missions").rglob("*.yaml"), *(ROOT / "executive").rglob("*.jinja")]
    pages = [path for path in (ROOT / "executive/view").rglob("*") if path.suffix in (".html", ".js", ".svg")]
    texts = [(path, path.read_text(encoding="utf-8")) for path in (*guides, *missions, *pages)]
    for path, tree in sources.items():
        for node in ast.walk(tree):
            match node:
                case ast.FunctionDef(name=text) | ast.ClassDef(name=text) | ast.arg(arg=text):
                    texts.append((path, text))
                case ast.Name(id=text) | ast.Attribute(attr=text, ctx=ast.Store()) | ast.Constant(str(text)):
                    texts.append((path, text))
    assert [(str(path), words) for path, text in texts if (words := find_forbidden(text))] == []
