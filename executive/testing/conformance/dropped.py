"""Calls of a skill that do nothing, because what they return is dropped."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator

from executive.testing.conformance.case import Case
from executive.testing.conformance.reach import Written, functions_reached, makes_failure, makes_steps


def calls_take_effect(case: Case) -> Iterator[str]:
    """Whatever it calls takes effect: steps are yielded from, and failures are raised."""
    for written in functions_reached(case.skill):
        for call in _dropped(written):
            callee, text = written.called(call), f"{ast.unparse(call.func)}(...)"
            where = f"{written.path.name}:{call.lineno}"
            if makes_steps(callee):
                yield (
                    f"{where} calls {text} and makes none of its steps, so it does nothing. "
                    f'Write "yield from {text}".'
                )
            elif makes_failure(callee):
                yield f'{where} calls {text} and does not raise it, so nothing fails. Write "raise {text}".'


def _dropped(written: Written) -> Iterator[ast.Call]:
    """Yield the calls in a function whose value goes nowhere."""
    read = {
        node.id
        for node in ast.walk(written.tree)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
    }
    for node in ast.walk(written.tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            yield node.value
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Call):
            kept = [t for t in node.targets if not isinstance(t, ast.Name) or t.id in read]
            yield from () if kept else (node.value,)
    # What `run` returns is dropped if it is a generator; what another one returns, its caller may want.
    if written.function.__name__ == "run" and inspect.isgeneratorfunction(written.function):
        for node in _own(written.tree):
            if isinstance(node, ast.Return) and isinstance(node.value, ast.Call):
                yield node.value


def _own(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield what is below a function, without what belongs to the functions inside it."""
    for node in ast.iter_child_nodes(tree):
        if not isinstance(node, ast.FunctionDef | ast.Lambda):
            yield node
            yield from _own(node)
