"""What a skill is: typed ports and params, declared reasons, and one generator.

A skill reads top to bottom. `run` is a generator: every `yield` hands back the tick (RUNNING),
returning is SUCCESS, raising `self.failed(reason, sentence)` is FAILURE, and `finally` runs on every
end, pre-emption included; a `run` that never waits may be a plain function. The declarations are made
once, in the class body, and feed the mission checker, the JSON Schema, the documentation and the runtime
alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar, get_args, get_origin, get_type_hints

from executive.errors import Fault, InputError

if TYPE_CHECKING:
    from executive.cell.protocols import Cell, LeastTimes

T = TypeVar("T")


class Direction(Enum):
    """Which way a port's value flows."""

    IN = "in"
    OUT = "out"


In = Annotated[T, Direction.IN]
"""An input: read from the variable it is wired to when the skill starts."""

Out = Annotated[T, Direction.OUT]
"""An output: written to the variable it is wired to when the skill succeeds."""

Seconds = Annotated[float, "s"]
Metres = Annotated[float, "m"]
MetresPerSecond = Annotated[float, "m/s"]


class ToolState(Enum):
    """What a skill needs of the tool, or leaves it as."""

    ANY = "any"
    EMPTY = "empty"
    HOLDING = "holding"


ANY, EMPTY, HOLDING = ToolState.ANY, ToolState.EMPTY, ToolState.HOLDING


@dataclass(frozen=True)
class Param:
    """A typed constant of a skill, set in the mission.

    Attributes:
        name: Key in the mission file.
        type: Python type of the value.
        unit: SI unit, or "".
        default: Value used where the mission says nothing; `...` where it must say something.
        ge, le: Bounds, inclusive, or None.
        choices: Allowed values, or None for any.
        refers: What the value names (`bin`, `detector`, `pose`, `class`), or "" for a plain value.
        doc: One sentence.
    """

    name: str
    type: Any
    unit: str
    default: Any
    ge: float | None
    le: float | None
    choices: tuple[Any, ...] | None
    refers: str
    doc: str

    @property
    def required(self) -> bool:
        """True where the mission must give a value."""
        return self.default is ...


@dataclass(frozen=True)
class Port:
    """A typed input or output of a skill.

    Attributes:
        name: Attribute of the skill, and the variable it is wired to unless the mission says otherwise.
        type: Python type of the value.
        direction: IN or OUT.
        default: Value of an unwired input; `...` where it must be wired to a written variable.
        refers: What a text names (`item`, `bin`, `class`), or "" for a plain value.
        doc: One sentence.
    """

    name: str
    type: Any
    direction: Direction
    default: Any
    refers: str
    doc: str

    @property
    def required(self) -> bool:
        """True for an input that needs a value."""
        return self.direction is Direction.IN and self.default is ...


def param(
    default: Any = ...,
    *,
    ge: float | None = None,
    le: float | None = None,
    choices: tuple[Any, ...] | None = None,
    refers: str = "",
    doc: str = "",
) -> Any:
    """Declare a param of a skill; see `Param` for what the arguments mean."""
    # Name, type and unit are known when the class is complete.
    return Param("", None, "", default, ge, le, choices, refers, doc)


def port(*, default: Any = ..., refers: str = "", doc: str = "") -> Any:
    """Give an input port a default for when it is not wired, or a port what it names and its sentence."""
    return param(default, refers=refers, doc=doc)


class SkillFailed(Exception):
    """A declared failure: a reason from the skill's list and a sentence with numbers."""

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason
        self.message = message


class Skill:
    """Base of every skill; subclasses declare, and write `run`.

    Attributes:
        params: The declared params by name.
        ports: The declared ports by name.
        reasons: Why it may fail; a closed list.
        uses: What no sibling may use at the same time: `arm`, `tool`, `camera`.
        senses: True if it takes in something new: an image, a person's wish.
        moves: True if it moves the arm.
        tool_state: What the tool must hold before (ANY: no matter), and holds after success (ANY: as before).
        tool_left: What it holds after a failure, by reason, or after a `halt`, where that is not what it
            held before; ANY where it may be either.
        waits: Param whose time [s] passes before every success; "" for none.
    """

    params: ClassVar[Mapping[str, Param]] = {}
    ports: ClassVar[Mapping[str, Port]] = {}
    reasons: ClassVar[tuple[str, ...]] = ()
    uses: ClassVar[tuple[str, ...]] = ()
    senses: ClassVar[bool] = False
    moves: ClassVar[bool] = False
    tool_state: ClassVar[tuple[ToolState, ToolState]] = (ANY, ANY)
    tool_left: ClassVar[Mapping[str, ToolState]] = {}
    waits: ClassVar[str] = ""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        _require_annotations(cls)
        params, ports = dict(cls.params), dict(cls.ports)
        for name, hint in list(cls.__annotations__.items()):
            if hint is ClassVar or str(hint).endswith("ClassVar"):
                # Python 3.10 does not evaluate a ClassVar without a type.
                del cls.__annotations__[name]
        hints = get_type_hints(cls, include_extras=True)
        for name in cls.__annotations__:
            hint = hints[name]
            if get_origin(hint) is ClassVar:
                continue
            base, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
            declared = cls.__dict__.get(name)
            direction = next((mark for mark in marks if isinstance(mark, Direction)), None)
            if direction is not None:
                given = declared if isinstance(declared, Param) else port()
                ports[name] = Port(name, base, direction, given.default, given.refers, given.doc)
            elif isinstance(declared, Param):
                unit = next((mark for mark in marks if isinstance(mark, str)), "")
                params[name] = replace(declared, name=name, type=base, unit=unit)
            else:
                raise TypeError(
                    f"{cls.__qualname__}.{name}: a skill's attribute is an In[...], Out[...] or param(...)"
                )
            if isinstance(declared, Param):
                delattr(cls, name)
        cls.params, cls.ports = params, ports

    def __init__(self, **values: Any) -> None:
        """Set params and inputs by name; what is not given takes its default."""
        inputs = {name: port for name, port in self.ports.items() if port.direction is Direction.IN}
        known: dict[str, Param | Port] = {**self.params, **inputs}
        for name in values:
            if name not in known:
                raise InputError(
                    f'{type(self).__name__} has no param or input "{name}"; '
                    f"it has: {', '.join(known) or 'none'}"
                )
        for name, declared in known.items():
            value = values.get(name, declared.default)
            if value is ...:
                raise InputError(f'{type(self).__name__} needs a value for "{name}"')
            setattr(self, name, value)

    def run(self, cell: Cell) -> Iterator[None] | None:
        """Do the work; see the module's docstring for what yielding, returning and raising mean."""
        raise NotImplementedError

    @classmethod
    def shortest(cls, least: LeastTimes, given: Mapping[str, Any]) -> float:
        """Return the least time in which this skill can succeed [s]; by default the one that it `waits`.

        `given` are the params, and the inputs whose value stands in the mission.
        """
        del least
        return float(given.get(cls.waits, 0.0))

    def failed(self, reason: str, message: str) -> SkillFailed:
        """Return the failure to raise.

        Raises:
            Fault: `reason` is not in the declared list.
        """
        if reason not in self.reasons:
            raise Fault(
                f'{type(self).__name__} raised the undeclared reason "{reason}"; '
                f"it declares: {', '.join(self.reasons) or 'none'}"
            )
        return SkillFailed(reason, message)


def _require_annotations(skill: type[Skill]) -> None:
    """Return if everything that a class body declares by `param` or `port` says of what type it is.

    Raises:
        TypeError: A declaration has no annotation.
    """
    for name, declared in vars(skill).items():
        if isinstance(declared, Param) and name not in skill.__annotations__:
            plain = isinstance(declared.default, bool | int | float | str)
            kind = type(declared.default).__name__ if plain else "int"
            raise TypeError(
                f"{skill.__qualname__}.{name} has no annotation, so nobody knows its type; "
                f'write, for instance, "{name}: {kind} = param(...)" for a param, '
                f'"{name}: In[...] = port(...)" for an input, "{name}: Out[...] = port(...)" for an output'
            )
