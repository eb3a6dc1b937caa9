"""The files in which a skill is written, as syntax trees."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path
from types import CodeType

from executive.skill import Skill


def files_of(skill: type[Skill]) -> list[Path]:
    """Return the files of a skill's class and of the skills that it derives from, its own first."""
    return [*dict.fromkeys(Path(code.co_filename) for _, code in _functions(skill))]


def trees_of(skill: type[Skill]) -> Iterator[tuple[Path, ast.Module]]:
    """Yield every such file that can be read, with its tree."""
    for path in files_of(skill):
        if path.is_file():
            yield path, ast.parse(path.read_text(encoding="utf-8"))


def class_trees_of(skill: type[Skill]) -> Iterator[tuple[Path, ast.ClassDef]]:
    """Yield the trees of the class and of the skills it derives from, with their files."""
    written = {(name, code.co_filename, code.co_firstlineno) for name, code in _functions(skill)}
    for path, tree in trees_of(skill):
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                lines = range(node.lineno, (node.end_lineno or node.lineno) + 1)
                if any(w[:2] == (node.name, str(path)) and w[2] in lines for w in written):
                    yield path, node


def _functions(skill: type[Skill]) -> Iterator[tuple[str, CodeType]]:
    """Yield the name of the class and the code of every function of a skill."""
    for parent in skill.__mro__:
        if issubclass(parent, Skill) and parent is not Skill:
            for member in vars(parent).values():
                if inspect.isfunction(member):
                    yield parent.__name__, member.__code__
