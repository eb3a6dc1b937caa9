"""Checks of a skill's declarations and source text; nothing is run."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator, Sequence

from executive.mission.model.typed import WrongType, convert
from executive.skill import Param, Port
from executive.testing.conformance import source
from executive.testing.conformance.skill_runs import SkillRuns

RESOURCES = ("arm", "tool", "camera")
FOREIGN = (
    "py_trees", "pybullet", "ruckig", "threading", "multiprocessing", "concurrent", "subprocess", "time",
    "asyncio",
)  # fmt: skip
"""Packages that no skill may import: it runs on the tick thread, on the run's clock, on any cell."""
HALT = "halt"


def documented(runs: SkillRuns) -> Iterator[str]:
    """The docstring of the class begins with a sentence, and every param and port says what it is."""
    doc = vars(runs.skill).get("__doc__") or ""
    summary = inspect.cleandoc(doc).partition("\n")[0]
    if not summary.endswith("."):
        yield (
            f'the docstring of {runs.name} begins with "{summary}", which is no sentence. '
            "Say in its first line what is true when the skill has succeeded."
        )
    declarations: dict[str, Param | Port] = {**runs.skill.params, **runs.skill.ports}
    for name, declared in declarations.items():
        if not declared.doc.strip():
            declare = "param" if isinstance(declared, Param) else "port"
            yield f'{runs.name}.{name} has no doc. Write {declare}(..., doc="what it is").'


def defaults_allowed(runs: SkillRuns) -> Iterator[str]:
    """Every default is one that a mission could give: of the type, inside the bounds, among the choices."""
    for param in runs.skill.params.values():
        if not param.required and (problem := _default_fault(param)):
            yield (
                f"{runs.name}.{param.name} has the default {param.default!r}{problem}. "
                "Mend the default, or its limits."
            )


def reasons_declared(runs: SkillRuns) -> Iterator[str]:
    """Its reasons are a tuple, and none is raised that is not declared."""
    reasons = runs.skill.reasons
    if isinstance(reasons, str):
        yield f'{runs.name}.reasons is the text "{reasons}". Write a tuple: ("{reasons}",).'
        return
    for written in source.functions_reached(runs.skill):
        for reason, node in _raised(written.tree):
            if reason not in reasons:
                yield (
                    f'{written.place(node)} fails with "{reason}", which {runs.name} does not declare. '
                    f"Add it to reasons; there are: {', '.join(reasons) or 'none'}."
                )


def resources_declared(runs: SkillRuns) -> Iterator[str]:
    """It uses arm, tool and camera, the arm if it moves, and says how the tool is left by its own reasons."""
    skill, name = runs.skill, runs.name
    unknown = [repr(skill.uses)] if isinstance(skill.uses, str) else sorted(set(skill.uses) - set(RESOURCES))
    if unknown:
        yield f"{name} uses {', '.join(unknown)}. Write a tuple of {', '.join(RESOURCES)}."
    if skill.moves and "arm" not in skill.uses:
        yield f'{name} moves the arm but does not use it. Add "arm" to uses, or leave moves out.'
    known = (*skill.reasons, HALT)
    for ending in skill.tool_left:
        if ending not in known:
            yield f'{name}.tool_left has "{ending}", which is no ending of it. There are: {", ".join(known)}.'


def imports_allowed(runs: SkillRuns) -> Iterator[str]:
    """Its file imports nothing that has another clock, other threads, or one sort of cell only."""
    for path in filter(lambda path: path.is_file(), source.files_of(runs.skill)):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            for package in FOREIGN:
                if package in _imported(node):
                    yield (
                        f"{path.name}:{getattr(node, 'lineno', 0)} imports {package}. "
                        "A skill waits on cell.clock and acts through cell alone; find there what it needs."
                    )


def calls_take_effect(runs: SkillRuns) -> Iterator[str]:
    """No call is without effect: steps are yielded from, and failures are raised."""
    for written in source.functions_reached(runs.skill):
        for call in _dropped(written):
            callee, text = written.called(call), f"{ast.unparse(call.func)}(...)"
            where = written.place(call)
            if source.returns_steps(callee):
                yield (
                    f"{where} calls {text} and makes none of its steps, so it does nothing. "
                    f'Write "yield from {text}".'
                )
            elif source.returns_failure(callee):
                yield f'{where} calls {text} and does not raise it, so nothing fails. Write "raise {text}".'


def _default_fault(param: Param) -> str:
    """Return what is wrong with a default, to follow its value, or ""."""
    try:
        value = convert(param.default, param.type)
    except (WrongType, TypeError) as problem:
        return f": {problem}"
    if value is None:
        return ""
    number = value if isinstance(value, int | float) else None
    if number is not None and param.ge is not None and number < param.ge:
        return f", which is less than {param.ge!r}"
    if number is not None and param.le is not None and number > param.le:
        return f", which is more than {param.le!r}"
    # Where a param names something of the cell, its choices are further words.
    if param.choices is not None and not param.refers and value not in param.choices:
        return f", which is not among {', '.join(map(repr, param.choices))}"
    return ""


def _raised(tree: ast.AST) -> Iterator[tuple[str, ast.expr]]:
    """Yield every reason that stands in a function as `self.failed("reason", ...)`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("self.failed", "skill.failed"):
            reason = node.args[0] if node.args else None
            if isinstance(reason, ast.Constant) and isinstance(reason.value, str):
                yield reason.value, node


def _imported(node: ast.AST) -> Sequence[str]:
    """Return the outermost packages that a statement imports."""
    if isinstance(node, ast.Import):
        return [alias.name.partition(".")[0] for alias in node.names]
    if isinstance(node, ast.ImportFrom) and node.module and not node.level:
        return [node.module.partition(".")[0]]
    return []


def _dropped(written: source.Written) -> Iterator[ast.Call]:
    """Yield the calls in a function of which the value is not used."""
    nodes = list(ast.walk(written.tree))
    read = {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}
    # The value that `run` returns is dropped if it is a generator; of another function its caller may use it.
    is_run = written.function.__name__ == "run" and inspect.isgeneratorfunction(written.function)
    for node in nodes:
        if isinstance(node, ast.Expr) or (is_run and isinstance(node, ast.Return)):
            is_dropped = True
        elif isinstance(node, ast.Assign):
            is_dropped = not any(not isinstance(t, ast.Name) or t.id in read for t in node.targets)
        else:
            continue
        if is_dropped and isinstance(node.value, ast.Call):
            yield node.value
