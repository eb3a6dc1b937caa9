"""The functions that a skill is made of, as syntax trees, and what the calls in them are calls of."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import FunctionType
from typing import Any, get_origin, get_type_hints

from executive.cell import Cell, Clock
from executive.skill import Skill, SkillFailed
from executive.testing.conformance.source import functions_of

_CUSTOMARY: Mapping[str, Any] = {"cell": Cell, "clock": Clock, "skill": Skill}
"""What an argument, or a local name, stands for in a skill: it is known by custom alone."""
_BY_NAME: Mapping[str, Any] = {"SkillFailed": SkillFailed, "Steps": Iterator, "Iterator[None]": Iterator}


@dataclass(frozen=True)
class Written:
    """A function as it stands in its file.

    Attributes:
        function: The function.
        path: Its file.
        tree: Its syntax tree, with the file's line numbers.
        skill: The skill that it belongs to, or that calls it.
    """

    function: FunctionType
    path: Path
    tree: ast.FunctionDef
    skill: type[Skill]

    def called(self, call: ast.Call) -> Any:
        """Return what is called, or None where that is not known before it runs."""
        return self._meant(call.func)

    def _meant(self, node: ast.expr) -> Any:
        """Return what an expression stands for: a value, or the class of one."""
        if isinstance(node, ast.Attribute):
            return _member(self._meant(node.value), node.attr)
        if not isinstance(node, ast.Name):
            return None
        if node.id == "self":
            return self.skill
        code = self.function.__code__
        if node.id in (*code.co_varnames, *code.co_cellvars):
            return _CUSTOMARY.get(node.id)
        return self.function.__globals__.get(node.id)


def functions_reached(skill: type[Skill]) -> Iterator[Written]:
    """Yield the functions of a skill's class, and those of its author's package that they call by name."""
    package = skill.__module__.partition(".")[0]
    waiting, seen = functions_of(skill), set[FunctionType]()
    while waiting:
        function = waiting.pop(0)
        if function in seen or (tree := _tree_of(function)) is None:
            continue
        seen.add(function)
        written = Written(function, Path(function.__code__.co_filename), tree, skill)
        yield written
        for node in ast.walk(tree):
            callee = written.called(node) if isinstance(node, ast.Call) else None
            if isinstance(callee, FunctionType) and callee.__module__.partition(".")[0] == package:
                waiting.append(callee)


def makes_steps(callee: Any) -> bool:
    """Tell whether whoever calls this gets steps, which nobody has made yet."""
    returned = _returned(callee)
    return inspect.isgeneratorfunction(callee) or (get_origin(returned) or returned) in (Iterator, Generator)


def makes_failure(callee: Any) -> bool:
    """Tell whether whoever calls this gets a failure, which nobody has raised yet."""
    return callee is SkillFailed or _returned(callee) is SkillFailed


def _returned(callee: Any) -> Any:
    """Return what a function says that it returns, or None."""
    if not isinstance(callee, FunctionType):
        return None
    try:
        return get_type_hints(callee).get("return")
    except (NameError, AttributeError, TypeError):
        # What is imported for type checkers alone is known by its name.
        return _BY_NAME.get(str(callee.__annotations__.get("return")))


def _member(owner: Any, name: str) -> Any:
    """Return a member of a module, or of what is of a class: its class, where only that is known."""
    if owner is None:
        return None
    if isinstance(owner, type) and not issubclass(owner, Skill) and name in get_type_hints(owner):
        return get_type_hints(owner)[name]
    member = inspect.getattr_static(owner, name, None)
    return member.__func__ if isinstance(member, staticmethod | classmethod) else member


def _tree_of(function: FunctionType) -> ast.FunctionDef | None:
    """Return the tree of a function, or None if it stands in no file, or is none that `def` begins."""
    path, first = Path(function.__code__.co_filename), function.__code__.co_firstlineno
    if not path.is_file():
        return None
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return next((node for node in nodes if isinstance(node, ast.FunctionDef) and _begin(node) == first), None)


def _begin(node: ast.FunctionDef) -> int:
    """Return the line in which a function begins, its decorators included."""
    return min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
