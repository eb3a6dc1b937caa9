"""Rules for the declarations of a skill, which are checked without a run.

Each public function is a rule: its docstring states the rule, and the function yields one text per violation.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import replace

from executive.mission.model.conversion import find_problem
from executive.skill import Param, Port
from executive.testing.conformance.skill_runs import SkillRuns

RESOURCES = ("arm", "tool", "camera")
"""Values that `uses` of a skill may contain."""
HALT = "halt"
"""Key of `tool_state_after_failure` for the state of the tool after a halt."""


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
            function = "param" if isinstance(declared, Param) else "port"
            yield f'{runs.name}.{name} has no doc. Write {function}(..., doc="its meaning").'


def has_allowed_defaults(runs: SkillRuns) -> Iterator[str]:
    """Each default is a valid value of its param: of the type, within the bounds, among the choices."""
    for param in runs.skill.params.values():
        if not param.is_required and (problem := _describe_default_problem(param)):
            yield f"the default of {runs.name}.{param.name} {problem}. Correct the default or the bounds."


def declares_reasons(runs: SkillRuns) -> Iterator[str]:
    """The reasons are a tuple."""
    reasons = runs.skill.reasons
    if isinstance(reasons, str):
        yield f'{runs.name}.reasons is the string "{reasons}". Write a tuple: ("{reasons}",).'


def declares_resources(runs: SkillRuns) -> Iterator[str]:
    """`uses` has only arm, tool, camera; `moves` needs arm; `tool_state_after_failure`: reasons or `halt`."""
    skill, name = runs.skill, runs.name
    unknown_uses = [repr(skill.uses)] if isinstance(skill.uses, str) else sorted({*skill.uses} - {*RESOURCES})
    if unknown_uses:
        yield f"{name} uses {', '.join(unknown_uses)}. Write a tuple of {', '.join(RESOURCES)}."
    if skill.moves and "arm" not in skill.uses:
        yield f'{name} moves the arm but does not use it. Add "arm" to uses, or remove moves.'
    allowed_keys = (*skill.reasons, HALT)
    for key in skill.tool_state_after_failure:
        if key not in allowed_keys:
            problem = f'{name}.tool_state_after_failure has "{key}", which is not a reason of the skill'
            yield f"{problem}. Allowed: {', '.join(allowed_keys)}."


def _describe_default_problem(param: Param) -> str:
    """Return the predicate of a sentence about an invalid default; "" if the default is valid."""
    # The default None is allowed even if it is not among the choices.
    declaration = replace(param, choices=None) if param.default is None else param
    try:
        return str(find_problem(param.default, declaration) or "")
    except TypeError as problem:
        return str(problem)
