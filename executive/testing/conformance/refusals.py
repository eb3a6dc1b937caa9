"""Mistakes that a mission may make with a skill, and who must find them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from executive.errors import InputError
from executive.mission.findings import Finding, MissionError
from executive.mission.load import load_mission
from executive.mission.model.typed import WrongType, convert, is_plain
from executive.skill import Param
from executive.testing.conformance.case import Case

UNKNOWN = "no_such_setting"
NAMED = ("bin", "class", "detector", "pose")
"""What a param may name of the cell; a name that the cell lacks is refused."""

_ALIAS = "Skill"
_HEAD = ("mission: mistakes", "cell: cells/overhead.yaml", "tree:")
_FIRST = len(_HEAD) + 1
"""Line of the first mistake in the mission."""


@dataclass(frozen=True)
class _Mistake:
    """A value that a mission must not give.

    Attributes:
        name: The param, or what is none.
        value: The value.
        wrong: What is wrong with it, to follow `a value`.
    """

    name: str
    value: Any
    wrong: str


def mistakes_refused(case: Case) -> Iterator[str]:
    """The mission loader refuses, by name, settings unknown, of a wrong type, out of bounds, of no choice."""
    mistakes = [_Mistake(UNKNOWN, 1, "for what is no param")]
    try:
        for param in case.skill.params.values():
            mistakes += _mistakes(param)
        findings = _findings(case, mistakes)
    except Exception as error:
        yield (
            f"what a mission says to {case.name} cannot be checked: {type(error).__name__}: {error}. "
            "Declare params of plain types, with bounds and choices that their values can be compared with."
        )
        return
    for line, mistake in enumerate(mistakes, _FIRST):
        names = f"{_ALIAS}.{mistake.name}", f'"{mistake.name}"'
        told = [finding.message for finding in findings if finding.line == line]
        if not any(name in message for name in names for message in told):
            yield (
                f"the mission loader takes {mistake.value!r} for {case.name}.{mistake.name}, a value "
                f"{mistake.wrong}. Declare the param's type, bounds and choices as narrow as they are."
            )


def unknown_keywords_refused(case: Case) -> Iterator[str]:
    """The constructor refuses a keyword that is neither param nor input, and names it."""
    advice = "Leave the constructor to Skill; what it needs is declared by param, In and Out."
    try:
        case.skill(**{UNKNOWN: 1})
    except InputError as error:
        if UNKNOWN not in str(error):
            yield f'{case.name}({UNKNOWN}=1) is refused without naming it: "{error}". {advice}'
    except Exception as error:
        yield f"{case.name}({UNKNOWN}=1) raises {type(error).__name__}: {error}. {advice}"
    else:
        yield f"{case.name}({UNKNOWN}=1) is taken. {advice}"


def _mistakes(param: Param) -> Iterator[_Mistake]:
    values: tuple[Any, ...] = ("text", [[]], 1.5, {"no": "value"})
    wrong = next((value for value in values if not _fits(value, param.type)), values[-1])
    yield _Mistake(param.name, wrong, "of a wrong type")
    if not is_plain(param.type):
        return
    if param.ge is not None:
        yield _Mistake(param.name, param.ge - 1, "below its bounds")
    if param.le is not None:
        yield _Mistake(param.name, param.le + 1, "above its bounds")
    if param.refers in NAMED:
        yield _Mistake(param.name, f"no_such_{param.refers}", f"that names no {param.refers} of the cell")
    elif param.choices is not None:
        text = isinstance(param.choices[0], str)
        yield _Mistake(param.name, "no_such_choice" if text else -12345, "that is not among its choices")


def _fits(value: Any, declared: Any) -> bool:
    try:
        convert(value, declared)
    except WrongType:
        return False
    return True


def _findings(case: Case, mistakes: list[_Mistake]) -> tuple[Finding, ...]:
    """Return what the loader says of a mission that makes every mistake, each in a line of its own."""
    uses = [f"  - {_ALIAS}: {{{mistake.name}: {json.dumps(mistake.value)}}}" for mistake in mistakes]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "mistakes.yaml"
        path.write_text("\n".join([*_HEAD, *uses]), encoding="utf-8")
        try:
            load_mission(path, {_ALIAS: case.skill})
        except MissionError as error:
            return error.findings
    return ()
