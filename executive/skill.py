"""Base class of skills: typed ports and params, declared reasons of failure, and a generator `run`.

The generator `run` yields once per control step (status RUNNING), returns for SUCCESS, and raises
`self.failure(reason, message)` for FAILURE. The `finally` clauses of `run` are also executed after a halt. A
`run` that never waits may be a function without `yield`. The mission checker, the JSON Schema, the
documentation and the tree use the declarations in the class body.
"""

from __future__ import annotations

import inspect
import keyword
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Annotated, Any, ClassVar, TypeVar, get_args, get_origin, get_type_hints

from executive.cell.protocols import Cell
from executive.errors import InputError, to_text

T = TypeVar("T")
"""Type of the value of a port."""


class Direction(Enum):
    """Direction of a port."""

    IN = "in"
    OUT = "out"


In = Annotated[T, Direction.IN]
"""Annotation of an input: the skill reads the variable of the port when the skill starts."""

Out = Annotated[T, Direction.OUT]
"""Annotation of an output: the skill writes the variable of the port when the skill succeeds."""

Seconds = Annotated[float, "s"]
Metres = Annotated[float, "m"]
MetresPerSecond = Annotated[float, "m/s"]
Newtons = Annotated[float, "N"]


class ToolState(Enum):
    """State of the tool that a skill requires, or that a skill leaves."""

    ANY = "any"
    EMPTY = "empty"
    HOLDING = "holding"


ANY = ToolState.ANY
EMPTY = ToolState.EMPTY
HOLDING = ToolState.HOLDING

DEVICES = ("arm", "tool", "camera")
"""Values that `Skill.uses` may contain."""
HALT = "halt"
"""Key of `Skill.tool_state_after_failure` for the state of the tool after a halt."""


@dataclass(frozen=True)
class Param:
    """A typed constant of a skill, which a mission sets.

    Attributes:
        name: Key in the mission file.
        type: Python type of the value.
        unit: SI unit, or "".
        default: Value if the mission sets none; `...` if the mission must set a value.
        ge: Minimum value, or None.
        le: Maximum value, or None.
        choices: Allowed values, or None for any value.
        refers_to: Kind of the name (`bin`, `detector`, `pose`, `class`) if the value is a name; otherwise "".
        doc: Description of the param.
        candidate: For a function of one object: name of the variable that contains the object in the
            expression of the mission; otherwise "".
    """

    name: str
    type: Any
    unit: str
    default: Any
    ge: float | None
    le: float | None
    choices: tuple[Any, ...] | None
    refers_to: str
    doc: str
    candidate: str = ""

    @property
    def is_required(self) -> bool:
        """True if the mission must set a value."""
        return self.default is ...

    @property
    def accepts_variable(self) -> bool:
        """True if a mission may set the param to a variable that contains a name or one of `choices`."""
        return bool(self.refers_to or self.choices)


@dataclass(frozen=True)
class Port:
    """A typed input or output of a skill.

    Attributes:
        name: Name in the mission file, and by default also of the variable.
        type: Python type of the value.
        direction: IN or OUT.
        default: Value of an input whose variable is unwritten; `...` if the variable must be written.
        refers_to: Kind of the name (`item`, `bin`, `class`) if the value is a name; otherwise "".
        doc: Description of the port.
    """

    name: str
    type: Any
    direction: Direction
    default: Any
    refers_to: str
    doc: str

    @property
    def is_required(self) -> bool:
        """True for an input without a default."""
        return self.direction is Direction.IN and self.default is ...


def param(
    default: Any = ...,
    *,
    ge: float | None = None,
    le: float | None = None,
    choices: tuple[Any, ...] | None = None,
    refers_to: str = "",
    doc: str = "",
    candidate: str = "",
) -> Any:
    """Declare a param of a skill; `Param` describes the arguments."""
    # `Skill.__init_subclass__` sets name, type and unit.
    return Param("", None, "", default, ge, le, choices, refers_to, doc, candidate)


def port(*, default: Any = ..., refers_to: str = "", doc: str = "") -> Any:
    """Declare a port of a skill; `Port` describes the arguments."""
    # `Skill.__init_subclass__` sets name, type and direction.
    return Port("", None, Direction.IN, default, refers_to, doc)


class SkillFailed(Exception):
    """Failure of a skill: a reason that the skill declares, and a message with measured values."""

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason
        # A skill may give any object, for instance a measured value.
        self.message = to_text(message)


class Skill:
    """Base class of skills; subclasses declare params and ports, and implement `run`.

    The attribute of a param or port named like a keyword of Python ends with `_`: `not_` for `not`.

    Attributes:
        params: Declared params by name.
        ports: Declared ports by name.
        one_of: Names of optional inputs of which a mission sets exactly one. An unset input
            usually reads the variable with the name of the port; the inputs in `one_of` do not.
        reasons: Reasons with which the skill may fail.
        uses: Devices that no concurrent branch may use at the same time: `arm`, `tool`, `camera`.
        senses: True if the skill gets new information: an image, or a request of the operator.
        moves: True if the skill moves the arm.
        is_condition: True if the skill is a condition, which decides in one tick, writes no output, uses no
            device, and changes nothing. The `tool_state` of a condition is not checked before the start: a
            success shows that the tool is in this state.
        tool_state: Required state of the tool (ANY: no requirement); state after success (ANY: unchanged).
        tool_state_after_failure: State of the tool after a failure, by reason, and after a halt, by the key
            `halt`; ANY if unknown. A failure or halt without a key leaves the state unchanged.
        waits: Name of the param whose duration passes before every success, or "".
    """

    params: ClassVar[Mapping[str, Param]] = {}
    ports: ClassVar[Mapping[str, Port]] = {}
    one_of: ClassVar[tuple[str, ...]] = ()
    reasons: ClassVar[tuple[str, ...]] = ()
    uses: ClassVar[tuple[str, ...]] = ()
    senses: ClassVar[bool] = False
    moves: ClassVar[bool] = False
    is_condition: ClassVar[bool] = False
    tool_state: ClassVar[tuple[ToolState, ToolState]] = (ANY, ANY)
    tool_state_after_failure: ClassVar[Mapping[str, ToolState]] = {}
    waits: ClassVar[str] = ""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """Convert the annotated attributes of the class body to `params` and `ports`.

        Raises:
            TypeError: A declaration in the class body is invalid.
        """
        super().__init_subclass__(**kwargs)
        _require_annotations(cls)
        if "tool_left" in vars(cls):
            raise TypeError(f"{cls.__qualname__}.tool_left: the attribute is now tool_state_after_failure")
        params = dict(cls.params)
        ports = dict(cls.ports)
        for name, hint in list(cls.__annotations__.items()):
            if hint is ClassVar or str(hint).endswith("ClassVar"):
                # `get_type_hints` of Python 3.10 does not accept a ClassVar without a type.
                del cls.__annotations__[name]
        hints = get_type_hints(cls, include_extras=True)
        for attribute in cls.__annotations__:
            hint = hints[attribute]
            if get_origin(hint) is ClassVar:
                continue
            name = _get_mission_name(attribute)
            value_type, *metadata = get_args(hint) if get_origin(hint) is Annotated else (hint,)
            declaration = cls.__dict__.get(attribute)
            direction = next((value for value in metadata if isinstance(value, Direction)), None)
            if direction is not None:
                entry = declaration if isinstance(declaration, Port) else port()
                ports[name] = replace(entry, name=name, type=value_type, direction=direction)
                _check_entry(cls, ports[name])
            elif isinstance(declaration, Param):
                unit = next((value for value in metadata if isinstance(value, str)), "")
                params[name] = replace(declaration, name=name, type=value_type, unit=unit)
                _check_entry(cls, params[name])
            else:
                place = f"{cls.__qualname__}.{attribute}"
                raise TypeError(f"{place}: attributes of a skill are In[...], Out[...] or param(...)")
            if isinstance(declaration, Param | Port):
                delattr(cls, attribute)
        cls.params = params
        cls.ports = ports
        _check_attributes(cls)

    def __init__(self, **values: Any) -> None:
        """Set the params and inputs in `values`, and all other params and inputs to their defaults."""
        inputs = {name: port for name, port in self.ports.items() if port.direction is Direction.IN}
        settings: dict[str, Param | Port] = {**self.params, **inputs}
        if (unknown_name := next((name for name in values if name not in settings), None)) is not None:
            names = ", ".join(settings) or "none"
            raise InputError(f'{type(self).__name__} has no param or input "{unknown_name}"; it has: {names}')
        for name, setting in settings.items():
            value = values.get(name, setting.default)
            if value is ...:
                raise InputError(f'{type(self).__name__} needs a value for "{name}"')
            setattr(self, get_attribute_name(name), value)

    def run(self, cell: Cell) -> Iterator[None] | None:
        """Execute the skill: `yield` ends a control step, `return` is success, `SkillFailed` is failure."""
        raise NotImplementedError

    @classmethod
    def is_instantaneous(cls) -> bool:
        """Return True if the skill ends in its first tick: `run` is no generator and returns None.

        If `run` returns an iterator of another function, its return annotation must not be None.
        """
        has_steps = inspect.isgeneratorfunction(cls.run)
        annotation = cls.run.__annotations__.get("return", "")
        return cls.is_condition or (not has_steps and annotation in ("None", None))

    def failure(self, reason: str, message: str) -> SkillFailed:
        """Return the exception for a failure; an undeclared reason ends the run as a fault."""
        return SkillFailed(reason, message)


def get_attribute_name(name: str) -> str:
    """Return the attribute of a skill for a param or port: `name`, or `name_` for a keyword of Python."""
    return f"{name}_" if keyword.iskeyword(name) else name


def _get_mission_name(attribute: str) -> str:
    """Return the name of a param or port in missions; inverse of `get_attribute_name`."""
    name = attribute.removesuffix("_")
    return name if get_attribute_name(name) == attribute else attribute


def list_condition_violations(skill: type[Skill]) -> list[str]:
    """Return the reasons why a skill is not a condition, as ends of a message: `moves the arm`."""
    effects = ["moves the arm"] if skill.moves else []
    effects += [f"writes ${name}" for name, port in skill.ports.items() if port.direction is Direction.OUT]
    effects += [f"uses the {device}" for device in skill.uses]
    effects += [f"takes time ({skill.waits})"] if skill.waits else []
    return effects + (["requires a state of the tool"] if skill.tool_state[0] is not ANY else [])


def _require_annotations(skill: type[Skill]) -> None:
    """Raise TypeError if a `param` or `port` in the class body has no type annotation."""
    for name, declaration in vars(skill).items():
        if isinstance(declaration, Param | Port) and name not in skill.__annotations__:
            raise TypeError(
                f"{skill.__qualname__}.{name} has no type annotation; "
                f'write, for instance, "{name}: int = param(...)" for a param, '
                f'"{name}: In[...] = port(...)" for an input, "{name}: Out[...] = port(...)" for an output'
            )


def _check_entry(skill: type[Skill], entry: Param | Port) -> None:
    """Raise TypeError if a param or port of a skill has no `doc`, or a default that is not allowed."""
    name = f"{skill.__qualname__}.{entry.name}"
    if not entry.doc.strip():
        function = "param" if isinstance(entry, Param) else "port"
        raise TypeError(f'{name} has no doc. Write {function}(..., doc="its meaning").')
    if isinstance(entry, Param) and (problem := _describe_default_problem(entry)):
        raise TypeError(f"the default of {name} must be {problem}. Correct the default or the bounds.")


def _describe_default_problem(param: Param) -> str:
    """Return what the default of a param must be, and what it is; "" if the default is allowed."""
    default = param.default
    unit = f" {param.unit}" if param.unit else ""
    if param.is_required:
        return ""
    allowed_types = {bool: (bool,), int: (int,), float: (float, int), str: (str,)}.get(param.type)
    if allowed_types is not None and type(default) not in allowed_types:
        return f"of the type {param.type.__name__}, not {default!r}"
    if isinstance(default, int | float) and param.ge is not None and default < param.ge:
        return f"at least {param.ge:g}{unit}, not {default:g}"
    if isinstance(default, int | float) and param.le is not None and default > param.le:
        return f"at most {param.le:g}{unit}, not {default:g}"
    # For names of the cell, `choices` contains additional values.
    has_choices = param.choices is not None and not param.refers_to and default is not None
    if has_choices and default not in (param.choices or ()):
        return f"{' or '.join(map(repr, param.choices or ()))}, not {default!r}"
    return ""


def _check_attributes(skill: type[Skill]) -> None:
    """Raise TypeError if the docstring or a class attribute of a skill violates a rule for all skills."""
    name = skill.__qualname__
    summary = inspect.cleandoc(skill.__doc__ or "").partition("\n")[0]
    # Python removes docstrings with the option -OO. A class without `run` is a base class, or varies a skill.
    if "run" in vars(skill) and sys.flags.optimize < 2 and not summary.endswith("."):
        raise TypeError(
            f'the docstring of {name} begins with "{summary}", which is not a sentence. '
            "State in the first line what the skill achieves."
        )
    if isinstance(skill.reasons, str):
        raise TypeError(
            f'{name}.reasons is the string "{skill.reasons}". Write a tuple: ("{skill.reasons}",).'
        )
    unknown = [repr(skill.uses)] if isinstance(skill.uses, str) else sorted({*skill.uses} - {*DEVICES})
    if unknown:
        raise TypeError(f"{name} uses {', '.join(unknown)}. Write a tuple of {', '.join(DEVICES)}.")
    if skill.moves and "arm" not in skill.uses:
        raise TypeError(f'{name} moves the arm but does not use it. Add "arm" to uses, or remove moves.')
    state = skill.tool_state
    if not isinstance(state, tuple) or len(state) != 2 or not {*state} <= {*ToolState}:
        raise TypeError(f"{name}.tool_state is {state!r}. Write two of ANY, EMPTY and HOLDING.")
    allowed_keys = (*skill.reasons, HALT)
    if unknown := [key for key in skill.tool_state_after_failure if key not in allowed_keys]:
        raise TypeError(
            f'{name}.tool_state_after_failure has "{unknown[0]}", which is not a reason of the skill. '
            f"Allowed: {', '.join(allowed_keys)}."
        )
    if skill.is_condition and (effects := list_condition_violations(skill)):
        raise TypeError(f"{name} {effects[0]}, and declares is_condition. Remove one of the two.")
