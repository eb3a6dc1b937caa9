"""Rules for the declarations and the source code of a skill, which are checked without a run.

Each public function is a rule: its docstring states the rule, and it yields one text per violation.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator, Sequence
from dataclasses import replace

from executive.mission.check.skill_settings import find_param_problem
from executive.skill import Param, Port
from executive.testing.conformance import source_code
from executive.testing.conformance.skill_runs import SkillRuns

RESOURCES = ("arm", "tool", "camera")
"""Values that `uses` of a skill may contain."""
FORBIDDEN_PACKAGES = (
    "py_trees", "pybullet", "ruckig", "threading", "multiprocessing", "concurrent", "subprocess", "time",
    "asyncio",
)  # fmt: skip
"""Packages that skills must not import: a skill runs in the tick thread, by the run's clock, on any cell."""
HALT = "halt"
"""Key of `tool_left` for the state of the tool after a halt."""


def has_documentation(runs: SkillRuns) -> Iterator[str]:
    """The docstring of the class begins with a sentence, and each param and port has a `doc`."""
    doc = vars(runs.skill).get("__doc__") or ""
    summary = inspect.cleandoc(doc).partition("\n")[0]
    if not summary.endswith("."):
        yield (
            f'the docstring of {runs.name} begins with "{summary}", which is not a sentence. '
            "State in the first line what the skill achieves."
        )
    declarations: dict[str, Param | Port] = {**runs.skill.params, **runs.skill.ports}
    for name, declared in declarations.items():
        if not declared.doc.strip():
            declare = "param" if isinstance(declared, Param) else "port"
            yield f'{runs.name}.{name} has no doc. Write {declare}(..., doc="its meaning").'


def has_allowed_defaults(runs: SkillRuns) -> Iterator[str]:
    """Each default is a valid value of its param: of the type, within the bounds, among the choices."""
    for param in runs.skill.params.values():
        if not param.is_required and (problem := _describe_default_problem(param)):
            yield f"the default of {runs.name}.{param.name} {problem}. Correct default or bounds."


def declares_reasons(runs: SkillRuns) -> Iterator[str]:
    """The reasons are a tuple, and the code fails only with declared reasons."""
    reasons = runs.skill.reasons
    if isinstance(reasons, str):
        yield f'{runs.name}.reasons is the string "{reasons}". Write a tuple: ("{reasons}",).'
        return
    for function in source_code.walk_functions(runs.skill):
        for reason, node in _find_failure_reasons(function.tree):
            if reason not in reasons:
                yield (
                    f'{function.locate(node)} fails with "{reason}", which {runs.name} does not declare. '
                    f"Add it to the reasons, which are: {', '.join(reasons) or 'none'}."
                )


def declares_resources(runs: SkillRuns) -> Iterator[str]:
    """`uses` has only arm, tool and camera; `moves` requires arm; `tool_left` has only own reasons."""
    skill, name = runs.skill, runs.name
    unknown = [repr(skill.uses)] if isinstance(skill.uses, str) else sorted(set(skill.uses) - set(RESOURCES))
    if unknown:
        yield f"{name} uses {', '.join(unknown)}. Write a tuple of {', '.join(RESOURCES)}."
    if skill.moves and "arm" not in skill.uses:
        yield f'{name} moves the arm but does not use it. Add "arm" to uses, or remove moves.'
    known = (*skill.reasons, HALT)
    for ending in skill.tool_left:
        if ending not in known:
            allowed = ", ".join(known)
            yield f'{name}.tool_left has "{ending}", which is not a reason of the skill. Allowed: {allowed}.'


def imports_allowed_modules(runs: SkillRuns) -> Iterator[str]:
    """The file imports no package with another clock, with threads, or for only one kind of cell."""
    for path in filter(lambda path: path.is_file(), source_code.find_source_files(runs.skill)):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            for package in _find_imported_packages(node):
                if package in FORBIDDEN_PACKAGES:
                    yield (
                        f"{path.name}:{getattr(node, 'lineno', 0)} imports {package}. "
                        "A skill must get the time from cell.clock, and act only through cell."
                    )


def calls_take_effect(runs: SkillRuns) -> Iterator[str]:
    """Each call has an effect: generators are executed with `yield from`, and failures are raised."""
    for function in source_code.walk_functions(runs.skill):
        for call in _find_calls_without_used_value(function):
            callee, text = function.resolve_callee(call), f"{ast.unparse(call.func)}(...)"
            place = function.locate(call)
            if source_code.is_returning_steps(callee):
                yield f'{place} calls {text} without executing its steps. Write "yield from {text}".'
            elif source_code.is_returning_failure(callee):
                yield f'{place} calls {text} without raising the failure. Write "raise {text}".'


def _describe_default_problem(param: Param) -> str:
    """Return the error of a default, as a sentence without its subject; "" if the default is valid."""
    # The default None is allowed even if it is not among the choices.
    checked = replace(param, choices=None) if param.default is None else param
    try:
        return find_param_problem(checked, param.default)[1]
    except TypeError as problem:
        return str(problem)


def _find_failure_reasons(tree: ast.AST) -> Iterator[tuple[str, ast.expr]]:
    """Yield reason and call of each `self.failure("reason", ...)` in the syntax tree of a function."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("self.failure", "skill.failure"):
            reason = node.args[0] if node.args else None
            if isinstance(reason, ast.Constant) and isinstance(reason.value, str):
                yield reason.value, node


def _find_imported_packages(node: ast.AST) -> Sequence[str]:
    """Return the top-level packages that a statement imports; empty if it is not an import."""
    if isinstance(node, ast.Import):
        return [alias.name.partition(".")[0] for alias in node.names]
    if isinstance(node, ast.ImportFrom) and node.module and not node.level:
        return [node.module.partition(".")[0]]
    return []


def _find_calls_without_used_value(function: source_code.FunctionSource) -> Iterator[ast.Call]:
    """Yield the calls in a function whose return value is not used."""
    nodes = list(ast.walk(function.tree))
    read_names = {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}
    # Nobody uses the return value of a generator `run`; callers may use those of other functions.
    is_run = function.function.__name__ == "run" and inspect.isgeneratorfunction(function.function)
    for node in nodes:
        if isinstance(node, ast.Expr) or (is_run and isinstance(node, ast.Return)):
            is_dropped = True
        elif isinstance(node, ast.Assign):
            is_dropped = not any(not isinstance(t, ast.Name) or t.id in read_names for t in node.targets)
        else:
            continue
        if is_dropped and isinstance(node.value, ast.Call):
            yield node.value
