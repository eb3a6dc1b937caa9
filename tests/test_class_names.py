"""Names of classes: each occurs once, so that a stack trace or a search is unambiguous."""

from __future__ import annotations

import ast
from collections import Counter

from guide_blocks import ROOT


def test_no_two_classes_have_the_same_name() -> None:
    paths = [path for folder in ("executive", "skills") for path in (ROOT / folder).rglob("*.py")]
    trees = (ast.parse(path.read_text(encoding="utf-8")) for path in paths)
    names = Counter(node.name for tree in trees for node in tree.body if isinstance(node, ast.ClassDef))
    assert [name for name, count in names.items() if count > 1] == []
