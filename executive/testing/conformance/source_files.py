"""Source files of a skill and of its base classes."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from types import FunctionType

from executive.skill import Skill


def _list_functions(skill: type[Skill]) -> list[FunctionType]:
    """Return the functions of a skill and its base classes, except base classes of this package."""
    package = Skill.__module__.partition(".")[0]
    skills = [parent for parent in skill.__mro__ if issubclass(parent, Skill)]
    parents = [parent for parent in skills if parent.__module__.partition(".")[0] != package]
    members = [member for parent in parents for member in vars(parent).values()]
    functions = [getattr(member, "__func__", member) for member in members]
    return [member for member in functions if isinstance(member, FunctionType)]


def find_source_files(skill: type[Skill]) -> list[Path]:
    """Return the source files of the class of a skill and of its base classes, in this order."""
    return [*dict.fromkeys(Path(function.__code__.co_filename) for function in _list_functions(skill))]


def find_skill_line(skill: type[Skill], frames: Iterable[tuple[str, int]]) -> str:
    """Return the first `(file, line)` that is in a source file of the skill, as `wave.py:12`, or ""."""
    files = set(map(str, find_source_files(skill)))
    return next((f"{Path(file).name}:{line}" for file, line in frames if file in files), "")
