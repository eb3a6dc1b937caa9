"""What a skill declares, as far as it can be judged without running it."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from typing import Any, get_args

from executive.mission.model.typed import WrongType, convert, is_plain
from executive.skill import Param, Port, ToolState
from executive.testing.conformance.case import Case
from executive.testing.conformance.source import class_trees_of, trees_of

RESOURCES = ("arm", "tool", "camera")
FOREIGN = ("py_trees", "pybullet", "ruckig", "threading", "time", "asyncio")
"""Packages that no skill may import: it runs on the tick thread, on the run's clock, on any cell."""
RATIO = "[-]"
"""What the doc of a number without a unit says."""
HALT = "halt"

_NAME = re.compile(r"[A-Z][A-Za-z0-9]*")
_REASON = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


def named_for_missions(case: Case) -> Iterator[str]:
    """Its name is one that a mission can say: letters and digits, a capital first."""
    if not _NAME.fullmatch(case.name):
        yield f'no mission can name a skill "{case.name}". Call it in CamelCase, for instance PointAt.'


def class_documented(case: Case) -> Iterator[str]:
    """The docstring of the class begins with a sentence."""
    doc = vars(case.skill).get("__doc__") or ""
    summary = inspect.cleandoc(doc).partition("\n")[0]
    if not summary:
        yield f"{case.name} has no docstring. Say in a sentence what is true when it has succeeded."
    elif not summary.endswith("."):
        yield (
            f'the docstring of {case.name} begins with "{summary}", which is no sentence. '
            "End the first line with a full stop."
        )


def settings_documented(case: Case) -> Iterator[str]:
    """Every param and every port says in its doc what it is."""
    declarations: dict[str, Param | Port] = {**case.skill.params, **case.skill.ports}
    for name, declared in declarations.items():
        if not declared.doc.strip():
            declare = "param" if isinstance(declared, Param) else "port"
            yield f'{case.name}.{name} has no doc. Write {declare}(..., doc="what it is").'


def numbers_have_units(case: Case) -> Iterator[str]:
    """Every number that is not whole has a unit, or its doc says that it is a ratio."""
    for param in case.skill.params.values():
        if not param.unit and _is_bare_number(param.type) and RATIO not in param.doc:
            yield (
                f"{case.name}.{param.name} is a float without a unit. Declare it as Seconds, Metres or "
                f'Annotated[float, "N"]; if it is a ratio, write {RATIO} into its doc.'
            )


def defaults_allowed(case: Case) -> Iterator[str]:
    """Every default is one that a mission could give: of the type, inside the bounds, among the choices."""
    for param in case.skill.params.values():
        where = f"{case.name}.{param.name}"
        if not is_plain(param.type):
            yield (
                f"{where} is a {getattr(param.type, '__name__', param.type)}, which no mission can say. "
                "Declare a text with choices, a number or a list of them."
            )
        elif not param.required and (problem := _default_fault(param)):
            yield f"{where} {problem}. Mend the default, or what it is checked against."


def reasons_declared(case: Case) -> Iterator[str]:
    """Reasons are lower_snake words, each declared once, and none is raised that is not declared."""
    reasons = case.skill.reasons
    if isinstance(reasons, str):
        yield f'{case.name}.reasons is the text "{reasons}". Write a tuple: ("{reasons}",).'
        return
    for reason in dict.fromkeys(reasons):
        if not _REASON.fullmatch(reason) or reason == HALT:
            yield (
                f'{case.name} declares the reason "{reason}". '
                f'Call it by a lower_snake word other than "{HALT}".'
            )
        if list(reasons).count(reason) > 1:
            yield f'{case.name} declares the reason "{reason}" twice. Leave one out.'
    for path, tree in class_trees_of(case.skill):
        for reason, line in _raised(tree):
            if reason not in reasons:
                yield (
                    f'{path.name}:{line} fails with "{reason}", which {case.name} does not declare. '
                    f"Add it to reasons; there are: {', '.join(reasons) or 'none'}."
                )


def resources_declared(case: Case) -> Iterator[str]:
    """What it uses are arm, tool and camera, and it uses the arm if it moves."""
    uses = case.skill.uses
    if isinstance(uses, str):
        yield f'{case.name}.uses is the text "{uses}". Write a tuple: ("{uses}",).'
        return
    for part in uses:
        if part not in RESOURCES:
            yield f'{case.name} uses "{part}", which no cell has. There are: {", ".join(RESOURCES)}.'
    if case.skill.moves and "arm" not in uses:
        yield f'{case.name} moves the arm but does not use it. Add "arm" to uses, or leave moves out.'


def tool_declared(case: Case) -> Iterator[str]:
    """What the tool holds before and after, and after every way to fail, is said in known words."""
    state, left = case.skill.tool_state, case.skill.tool_left
    if not (isinstance(state, tuple) and len(state) == 2 and all(isinstance(s, ToolState) for s in state)):
        yield f"{case.name}.tool_state is {state!r}. Write two of ANY, EMPTY and HOLDING: before and after."
    for ending, after in left.items():
        if ending not in (*case.skill.reasons, HALT):
            known = ", ".join((*case.skill.reasons, HALT))
            yield f'{case.name}.tool_left tells of "{ending}", which is no ending of it. There are: {known}.'
        if not isinstance(after, ToolState):
            yield f'{case.name}.tool_left["{ending}"] is {after!r}. Write ANY, EMPTY or HOLDING.'


def imports_allowed(case: Case) -> Iterator[str]:
    """Its file imports nothing that has another clock, other threads, or one sort of cell only."""
    for path, tree in trees_of(case.skill):
        for node in ast.walk(tree):
            for package in _imported(node):
                if package in FOREIGN:
                    yield (
                        f"{path.name}:{node.lineno} imports {package}. "  # type: ignore[attr-defined]
                        "A skill waits on cell.clock and acts through cell alone; find there what it needs."
                    )


def _is_bare_number(declared: Any) -> bool:
    """Tell whether a type is float, or has it among its alternatives, without a unit."""
    if hasattr(declared, "__metadata__"):
        return False
    return declared is float or any(_is_bare_number(part) for part in get_args(declared))


def _default_fault(param: Param) -> str:
    """Return what is wrong with a default, to follow the param's name, or ""."""
    try:
        value = convert(param.default, param.type)
        limits = "" if value is None else _outside(value, param)
    except (WrongType, TypeError) as problem:
        limits = f": {problem}"
    return limits and f"has the default {param.default!r}{limits}"


def _outside(value: Any, param: Param) -> str:
    """Return in which way a value is not allowed, or ""."""
    if param.ge is not None and value < param.ge:
        return f", which is less than {param.ge!r}"
    if param.le is not None and value > param.le:
        return f", which is more than {param.le!r}"
    # Where a param names something of the cell, its choices are further words.
    if param.choices is not None and not param.refers and value not in param.choices:
        return f", which is not among {', '.join(map(repr, param.choices))}"
    return ""


def _raised(tree: ast.ClassDef) -> Iterator[tuple[str, int]]:
    """Yield every reason that stands in the text of a class as `self.failed("reason", ...)`, and its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "self.failed" and node.args:
            reason = node.args[0]
            if isinstance(reason, ast.Constant) and isinstance(reason.value, str):
                yield reason.value, node.lineno


def _imported(node: ast.AST) -> Iterator[str]:
    """Yield the outermost packages that a statement imports."""
    if isinstance(node, ast.Import):
        yield from (alias.name.partition(".")[0] for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
        yield node.module.partition(".")[0]
