"""The functions of which a skill is made, as syntax trees, and the functions that they call."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import FunctionType
from typing import Any, get_origin, get_type_hints

from executive.cell.protocols import Cell, Clock
from executive.skill import Skill, SkillFailed

_CUSTOMARY: Mapping[str, Any] = {"cell": Cell, "clock": Clock, "skill": Skill}
"""Types of the arguments and local names that every skill calls so."""


@dataclass(frozen=True)
class Written:
    """A function as it stands in its file.

    Attributes:
        function: The function.
        tree: Its syntax tree, with the file's line numbers.
        skill: The skill that it belongs to, or that calls it.
    """

    function: FunctionType
    tree: ast.AST
    skill: type[Skill]

    def place(self, node: ast.expr | ast.stmt) -> str:
        """Return where a part of it stands: `wave.py:12`."""
        return f"{Path(self.function.__code__.co_filename).name}:{node.lineno}"

    def called(self, call: ast.Call) -> Any:
        """Return the function or class that is called, or None where only a run would show it."""
        return self._meaning(call.func)

    def _meaning(self, node: ast.expr) -> Any:
        """Return the value of an expression, or its class where only that is known."""
        if isinstance(node, ast.Attribute):
            return _member(self._meaning(node.value), node.attr)
        if not isinstance(node, ast.Name):
            return None
        if node.id == "self":
            return self.skill
        code = self.function.__code__
        if node.id in (*code.co_varnames, *code.co_cellvars):
            return _CUSTOMARY.get(node.id)
        return self.function.__globals__.get(node.id)


def own_functions(skill: type[Skill]) -> list[FunctionType]:
    """Return the functions of a skill's class and of the skills from which it derives, its own first."""
    parents = [parent for parent in skill.__mro__ if issubclass(parent, Skill) and parent is not Skill]
    members = [member for parent in parents for member in vars(parent).values()]
    plain = [getattr(member, "__func__", member) for member in members]
    return [member for member in plain if isinstance(member, FunctionType)]


def files_of(skill: type[Skill]) -> list[Path]:
    """Return the files in which a skill is written, its own first."""
    return [*dict.fromkeys(Path(function.__code__.co_filename) for function in own_functions(skill))]


def place_in(skill: type[Skill], frames: Iterable[tuple[str, int]]) -> str:
    """Return the first of some files and lines that is in the skill's own files, as `wave.py:12`, or ""."""
    files = set(map(str, files_of(skill)))
    return next((f"{Path(file).name}:{line}" for file, line in frames if file in files), "")


def functions_reached(skill: type[Skill]) -> Iterator[Written]:
    """Yield the functions of a skill's class, and those of its author's package that they call by name."""
    package = skill.__module__.partition(".")[0]
    waiting, seen = own_functions(skill), set[FunctionType]()
    while waiting:
        function = waiting.pop(0)
        if function in seen or (tree := _tree_of(function)) is None:
            continue
        seen.add(function)
        written = Written(function, tree, skill)
        yield written
        callees = [written.called(node) for node in ast.walk(tree) if isinstance(node, ast.Call)]
        functions = [callee for callee in callees if isinstance(callee, FunctionType)]
        waiting += [callee for callee in functions if callee.__module__.partition(".")[0] == package]


def returns_steps(callee: Any) -> bool:
    """Return True if a call of this returns steps that nobody has taken yet."""
    returned = _returned(callee)
    return inspect.isgeneratorfunction(callee) or (get_origin(returned) or returned) in (Iterator, Generator)


def returns_failure(callee: Any) -> bool:
    """Return True if a call of this returns a failure that nobody has raised yet."""
    return callee is SkillFailed or _returned(callee) is SkillFailed


def _returned(callee: Any) -> Any:
    """Return the declared type of what a function returns, or None."""
    if not isinstance(callee, FunctionType):
        return None
    try:
        return get_type_hints(callee).get("return")
    except (NameError, AttributeError, TypeError):
        return None  # A type that is imported for type checkers alone is not known.


def _member(owner: Any, name: str) -> Any:
    """Return a member of a module or class; of an attribute of an instance its class."""
    if owner is None:
        return None
    if isinstance(owner, type) and not issubclass(owner, Skill) and name in get_type_hints(owner):
        return get_type_hints(owner)[name]
    member = inspect.getattr_static(owner, name, None)
    return member.__func__ if isinstance(member, staticmethod | classmethod) else member


def _tree_of(function: FunctionType) -> ast.AST | None:
    """Return the tree of a function that begins with `def`, or None."""
    try:
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, SyntaxError):
        return None
    return ast.increment_lineno(tree.body[0], first - 1)
