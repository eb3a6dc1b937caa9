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

_TYPES_BY_CONVENTIONAL_NAME: Mapping[str, Any] = {"cell": Cell, "clock": Clock, "skill": Skill}
"""Assumed types of arguments and local variables, by their name."""


@dataclass(frozen=True)
class FunctionSource:
    """A function and its syntax tree.

    Attributes:
        function: The function.
        syntax_tree: Syntax tree of the function, with the line numbers of its file.
        skill: Skill whose methods contain the function or call it, directly or through other functions.
    """

    function: FunctionType
    syntax_tree: ast.AST
    skill: type[Skill]

    def locate(self, node: ast.expr | ast.stmt) -> str:
        """Return file and line of a node of the syntax tree, for instance `wave.py:12`."""
        return f"{Path(self.function.__code__.co_filename).name}:{node.lineno}"

    def resolve(self, node: ast.expr) -> Any:
        """Return the value of an expression, or the class of an unknown value; None if both are unknown."""
        if isinstance(node, ast.Attribute):
            return _find_member(self.resolve(node.value), node.attr)
        if not isinstance(node, ast.Name):
            return None
        if node.id == "self":
            return self.skill
        code = self.function.__code__
        if node.id in (*code.co_varnames, *code.co_cellvars):
            return _TYPES_BY_CONVENTIONAL_NAME.get(node.id)
        return self.function.__globals__.get(node.id)


def list_skill_functions(skill: type[Skill]) -> list[FunctionType]:
    """Return the functions of a skill and its base classes, except base classes of this package."""
    package = Skill.__module__.partition(".")[0]
    skills = [parent for parent in skill.__mro__ if issubclass(parent, Skill)]
    parents = [parent for parent in skills if parent.__module__.partition(".")[0] != package]
    members = [member for parent in parents for member in vars(parent).values()]
    functions = [getattr(member, "__func__", member) for member in members]
    return [member for member in functions if isinstance(member, FunctionType)]


def find_source_files(skill: type[Skill]) -> list[Path]:
    """Return the source files of the class of a skill and of its base classes, in this order."""
    return [*dict.fromkeys(Path(function.__code__.co_filename) for function in list_skill_functions(skill))]


def find_skill_line(skill: type[Skill], frames: Iterable[tuple[str, int]]) -> str:
    """Return the first `(file, line)` that is in a source file of the skill, as `wave.py:12`, or ""."""
    files = set(map(str, find_source_files(skill)))
    return next((f"{Path(file).name}:{line}" for file, line in frames if file in files), "")


def walk_functions(skill: type[Skill]) -> Iterator[FunctionSource]:
    """Yield the functions of a skill, and the functions of the same package that they call."""
    package = skill.__module__.partition(".")[0]
    pending, visited = list_skill_functions(skill), set[FunctionType]()
    while pending:
        function = pending.pop(0)
        if function in visited or (syntax_tree := _parse(function)) is None:
            continue
        visited.add(function)
        function_source = FunctionSource(function, syntax_tree, skill)
        yield function_source
        calls = [node for node in ast.walk(syntax_tree) if isinstance(node, ast.Call)]
        callees = [function_source.resolve(call.func) for call in calls]
        functions = [callee for callee in callees if isinstance(callee, FunctionType)]
        pending += [callee for callee in functions if callee.__module__.partition(".")[0] == package]


def returns_steps(callee: Any) -> bool:
    """Return True if a call of the function returns an iterator of control steps."""
    return_type = _find_return_type(callee)
    is_iterator = (get_origin(return_type) or return_type) in (Iterator, Generator)
    return is_iterator or inspect.isgeneratorfunction(callee)


def returns_failure(callee: Any) -> bool:
    """Return True if a call of the function or class returns a SkillFailed."""
    return SkillFailed in (callee, _find_return_type(callee))


def _find_return_type(callee: Any) -> Any:
    """Return the declared return type of a function, or None."""
    if not isinstance(callee, FunctionType):
        return None
    try:
        return get_type_hints(callee).get("return")
    except (NameError, AttributeError, TypeError):
        return None  # A name in an annotation is imported only for type checkers.


def _find_member(owner: Any, name: str) -> Any:
    """Return the declared type of an attribute; if undeclared, the member of the module or class, or None."""
    if owner is None:
        return None
    if isinstance(owner, type) and not issubclass(owner, Skill) and name in get_type_hints(owner):
        return get_type_hints(owner)[name]
    member = inspect.getattr_static(owner, name, None)
    return member.__func__ if isinstance(member, staticmethod | classmethod) else member


def _parse(function: FunctionType) -> ast.AST | None:
    """Return the syntax tree of a function, or None if its source code is not available."""
    try:
        lines, first_line = inspect.getsourcelines(function)
        syntax_tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, SyntaxError):
        return None
    return ast.increment_lineno(syntax_tree.body[0], first_line - 1)
