"""The situations in which a skill is tried, each arranged as often as wanted."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from executive.skill import ANY, EMPTY, HOLDING, Direction, Param, Port, Skill
from executive.testing.conformance.patience import Stuck
from executive.testing.conformance.stage import Stage, set_up
from executive.testing.conformance.values import CannotMakeUp, made_up, other_values

Arrange = Callable[[Stage], Mapping[str, Any]]
"""Changes a stage for a skill and returns values for some of its params and inputs."""

_HOLDING: Mapping[Any, tuple[bool, ...]] = {EMPTY: (False,), HOLDING: (True,), ANY: (False, True)}
_NAMES = {False: "with an empty tool", True: "with an item in the tool"}


class NotTried(Exception):
    """A check cannot be made; the text says why."""


class NotArranged(NotTried):
    """A skill cannot be tried, because nobody knows what to give it; the text says what to do."""


@dataclass(frozen=True)
class Situation:
    """One way to begin.

    Attributes:
        name: Its name, for a sentence: `with an empty tool`.
        holding: The tool holds an object.
        params: Params that differ from their defaults.
        has_all_inputs: Inputs that may be left out are given, too.
    """

    name: str
    holding: bool
    params: Mapping[str, Any] = field(default_factory=dict)
    has_all_inputs: bool = False


class Scene:
    """A situation arranged for a skill on a fake cell; it begins again as often as wanted.

    Args:
        skill: The skill that is to act in it.
        situation: The situation.
        arrange: What the skill's author wants to be otherwise.

    Attributes:
        situation: The situation.
        cell: The fake cell; its parts are new with every beginning.
        given: Names of the params and inputs that `arrange` gave.

    Raises:
        NotArranged: A value that the skill needs is given by nobody, or none can be copied.
    """

    def __init__(self, skill: type[Skill], situation: Situation, arrange: Arrange) -> None:
        stage = set_up(skill, holding=situation.holding)
        given = _arranged(skill, arrange, stage)
        self.situation, self.cell, self.given = situation, stage.cell, frozenset(given)
        values = {**_made_up(skill, situation, stage, given), **situation.params, **given}
        try:
            self._beginning = self.copied((vars(stage.cell), values))
        except Exception as error:
            raise NotArranged(
                f"the beginning cannot be kept to be repeated: {type(error).__name__}: {error}. "
                "Give inputs that copy.deepcopy can copy."
            ) from error

    def begin(self) -> dict[str, Any]:
        """Bring the cell back to its beginning, and return the values to start the skill with."""
        parts, values = self.copied(self._beginning)
        vars(self.cell).clear()
        vars(self.cell).update(parts)
        return values

    def copied(self, state: Any) -> Any:
        """Return a copy of a state of the cell, or of values that belong to it."""
        # The cell itself is not copied: its parts, and the functions of its author, reach each other through it.
        return copy.deepcopy(state, {id(self.cell): self.cell})


def scenes(skill: type[Skill], arrange: Arrange) -> list[Scene]:
    """Return every situation in which a skill is tried, arranged.

    With the tool as the skill needs it, or both empty and not where it needs neither; with defaults alone,
    with all its inputs, and with every other choice of a param that its author does not give.

    Raises:
        NotArranged: One cannot be arranged.
    """
    found = [Scene(skill, situation, arrange) for situation in situations(skill)]
    return [scene for scene in found if not scene.given & set(scene.situation.params)]


def situations(skill: type[Skill]) -> Iterator[Situation]:
    """Yield the situations in which a skill is tried.

    Raises:
        NotArranged: It does not say what it needs of the tool.
    """
    state = skill.tool_state
    if not isinstance(state, tuple) or not state or state[0] not in _HOLDING:
        raise NotArranged(f"its tool_state is {state!r}; it must begin with ANY, EMPTY or HOLDING")
    first = _HOLDING[state[0]][0]
    for holding in _HOLDING[state[0]]:
        yield Situation(_NAMES[holding], holding)
    if any(not port.required for port in _inputs(skill).values()):
        yield Situation(f"{_NAMES[first]} and every input given", first, has_all_inputs=True)
    stage = set_up(skill, holding=first)
    for param in skill.params.values():
        for value in other_values(param, stage):
            yield Situation(f"{_NAMES[first]} and {param.name}: {value}", first, {param.name: value})


def _arranged(skill: type[Skill], arrange: Arrange, stage: Stage) -> dict[str, Any]:
    try:
        given = dict(arrange(stage))
    except Stuck as stuck:
        raise NotArranged(f"what arranges it {stuck}") from None
    except Exception as error:
        raise NotArranged(f"what arranges it raised {type(error).__name__}: {error}") from error
    known = {**skill.params, **_inputs(skill)}
    if unknown := [name for name in given if name not in known]:
        raise NotArranged(
            f'what arranges it gives a value for "{unknown[0]}", which is neither a param nor an input; '
            f"it has: {', '.join(known) or 'none'}"
        )
    return given


def _made_up(
    skill: type[Skill], situation: Situation, stage: Stage, given: Mapping[str, Any]
) -> dict[str, Any]:
    """Return values for what nobody has given: what has no default, and where it is wanted all inputs."""
    values, missing = {}, {}
    declarations: list[Param | Port] = [*skill.params.values(), *_inputs(skill).values()]
    for declared in declarations:
        is_optional = situation.has_all_inputs and isinstance(declared, Port)
        if declared.name in {**given, **situation.params} or not (declared.required or is_optional):
            continue
        try:
            values[declared.name] = made_up(declared, stage)
        except CannotMakeUp as problem:
            if declared.required:
                missing[declared.name] = str(problem)
    if missing:
        wanted = ", ".join(f'"{name}": ...' for name in missing)
        raise NotArranged(
            f"no value can be made up for {' and '.join(missing.values())}. Give it in a test: "
            f"conformance({skill.__name__}, lambda stage: {{{wanted}}}), as skills/README.md shows."
        )
    return values


def _inputs(skill: type[Skill]) -> dict[str, Port]:
    return {name: port for name, port in skill.ports.items() if port.direction is Direction.IN}
