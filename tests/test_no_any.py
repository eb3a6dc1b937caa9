"""Signatures and fields of tree, missions, records, runs and views are typed: none of them contains `Any`."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from guide_blocks import ROOT

PACKAGES = ("events", "mission", "record", "run", "tree", "view")
ALLOWED = {
    "executive/tree/keys.py:_with_any_result",  # As in `dataclasses.field`: the attribute has the type.
    "executive/view/live/live_scene.py:serve_on_socket",  # Another package prescribes the signature.
}


def find_any(path: Path) -> Iterator[str]:
    """Yield each function and field of a module whose annotation contains `Any`."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        annotations: list[ast.expr | None] = []
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = node.args
            arguments = [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]
            annotations = [node.returns, *(one.annotation for one in arguments if one is not None)]
            name = node.name
        elif isinstance(node, ast.ClassDef):
            annotations = [field.annotation for field in node.body if isinstance(field, ast.AnnAssign)]
            name = node.name
        parts = (part for annotation in annotations if annotation for part in ast.walk(annotation))
        if any(isinstance(part, ast.Name) and part.id == "Any" for part in parts):
            yield f"{path.relative_to(ROOT).as_posix()}:{name}"


@pytest.mark.parametrize("package", PACKAGES)
def test_no_signature_contains_any(package: str) -> None:
    found = [one for path in (ROOT / "executive" / package).rglob("*.py") for one in find_any(path)]
    assert [one for one in found if one not in ALLOWED] == []
