"""The files in which a skill is written, as syntax trees."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import FunctionType

from executive.skill import Skill


def functions_of(skill: type[Skill]) -> list[FunctionType]:
    """Return the functions of a skill's class and of the skills that it derives from, its own first."""
    return [function for _, function in _members(skill)]


def files_of(skill: type[Skill]) -> list[Path]:
    """Return the files of a skill's class and of the skills that it derives from, its own first."""
    return [*dict.fromkeys(Path(f.__code__.co_filename) for f in functions_of(skill))]


def place_in(skill: type[Skill], frames: Iterable[tuple[str, int]]) -> str:
    """Return the first of some files and lines that is in the skill's own files, as `wave.py:12`, or ""."""
    files = {str(path) for path in files_of(skill)}
    return next((f"{Path(file).name}:{line}" for file, line in frames if file in files), "")


def trees_of(skill: type[Skill]) -> Iterator[tuple[Path, ast.Module]]:
    """Yield every such file that can be read, with its tree."""
    for path in files_of(skill):
        if path.is_file():
            yield path, ast.parse(path.read_text(encoding="utf-8"))


def class_trees_of(skill: type[Skill]) -> Iterator[tuple[Path, ast.ClassDef]]:
    """Yield the trees of the class and of the skills it derives from, with their files."""
    codes = [(name, function.__code__) for name, function in _members(skill)]
    written = {(name, code.co_filename, code.co_firstlineno) for name, code in codes}
    for path, tree in trees_of(skill):
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                lines = range(node.lineno, (node.end_lineno or node.lineno) + 1)
                if any(w[:2] == (node.name, str(path)) and w[2] in lines for w in written):
                    yield path, node


def _members(skill: type[Skill]) -> Iterator[tuple[str, FunctionType]]:
    """Yield every function of a skill, with the name of its class."""
    for parent in skill.__mro__:
        if issubclass(parent, Skill) and parent is not Skill:
            for member in vars(parent).values():
                plain = member.__func__ if isinstance(member, classmethod | staticmethod) else member
                if isinstance(plain, FunctionType):
                    yield parent.__name__, plain
