"""Syntax trees of the functions of a skill, and of the functions that they call."""

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

_CONVENTIONAL_TYPES: Mapping[str, Any] = {"cell": Cell, "clock": Clock, "skill": Skill}
"""Types of arguments and local variables with these names."""


@dataclass(frozen=True)
class FunctionSource:
    """A function and its syntax tree.

    Attributes:
        function: The function.
        tree: Its syntax tree, with the file's line numbers.
        skill: The skill that has or calls the function.
    """

    function: FunctionType
    tree: ast.AST
    skill: type[Skill]

    def locate(self, node: ast.expr | ast.stmt) -> str:
        """Return file and line of a node of the tree: `wave.py:12`."""
        return f"{Path(self.function.__code__.co_filename).name}:{node.lineno}"

    def resolve_callee(self, call: ast.Call) -> Any:
        """Return the called function or class, or None if it is known only during a run."""
        return self._resolve(call.func)

    def _resolve(self, node: ast.expr) -> Any:
        """Return the value of an expression, or only its class, or None."""
        if isinstance(node, ast.Attribute):
            return _find_member(self._resolve(node.value), node.attr)
        if not isinstance(node, ast.Name):
            return None
        if node.id == "self":
            return self.skill
        code = self.function.__code__
        if node.id in (*code.co_varnames, *code.co_cellvars):
            return _CONVENTIONAL_TYPES.get(node.id)
        return self.function.__globals__.get(node.id)


def list_functions(skill: type[Skill]) -> list[FunctionType]:
    """Return the functions of a skill's class, followed by those of its base skills."""
    parents = [parent for parent in skill.__mro__ if issubclass(parent, Skill) and parent is not Skill]
    members = [member for parent in parents for member in vars(parent).values()]
    plain = [getattr(member, "__func__", member) for member in members]
    return [member for member in plain if isinstance(member, FunctionType)]


def find_files(skill: type[Skill]) -> list[Path]:
    """Return the files with the code of a skill and of its base skills, in this order."""
    return [*dict.fromkeys(Path(function.__code__.co_filename) for function in list_functions(skill))]


def find_own_line(skill: type[Skill], frames: Iterable[tuple[str, int]]) -> str:
    """Return the first of the `(file, line)` in the skill's own files, as `wave.py:12`, or ""."""
    files = set(map(str, find_files(skill)))
    return next((f"{Path(file).name}:{line}" for file, line in frames if file in files), "")


def walk_functions(skill: type[Skill]) -> Iterator[FunctionSource]:
    """Yield the functions of a skill's class, and the called functions of the same package."""
    package = skill.__module__.partition(".")[0]
    waiting, seen = list_functions(skill), set[FunctionType]()
    while waiting:
        function = waiting.pop(0)
        if function in seen or (tree := _parse(function)) is None:
            continue
        seen.add(function)
        function_source = FunctionSource(function, tree, skill)
        yield function_source
        callees = [
            function_source.resolve_callee(node) for node in ast.walk(tree) if isinstance(node, ast.Call)
        ]
        functions = [callee for callee in callees if isinstance(callee, FunctionType)]
        waiting += [callee for callee in functions if callee.__module__.partition(".")[0] == package]


def is_returning_steps(callee: Any) -> bool:
    """Return True if a call returns an iterator of steps."""
    returned = _find_return_type(callee)
    return inspect.isgeneratorfunction(callee) or (get_origin(returned) or returned) in (Iterator, Generator)


def is_returning_failure(callee: Any) -> bool:
    """Return True if a call returns a SkillFailed."""
    return SkillFailed in (callee, _find_return_type(callee))


def _find_return_type(callee: Any) -> Any:
    """Return the declared return type of a function, or None."""
    if not isinstance(callee, FunctionType):
        return None
    try:
        return get_type_hints(callee).get("return")
    except (NameError, AttributeError, TypeError):
        return None  # The type is imported only for type checkers.


def _find_member(owner: Any, name: str) -> Any:
    """Return a member of a module or class, or the declared type of an attribute, or None."""
    if owner is None:
        return None
    if isinstance(owner, type) and not issubclass(owner, Skill) and name in get_type_hints(owner):
        return get_type_hints(owner)[name]
    member = inspect.getattr_static(owner, name, None)
    return member.__func__ if isinstance(member, staticmethod | classmethod) else member


def _parse(function: FunctionType) -> ast.AST | None:
    """Return the syntax tree of a function, or None without source text."""
    try:
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, SyntaxError):
        return None
    return ast.increment_lineno(tree.body[0], first - 1)
