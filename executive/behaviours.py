"""Installed skills, and behaviours of py_trees as skills, with a blackboard of py_trees for each run."""

from __future__ import annotations

import difflib
import inspect
import re
import threading
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import replace
from enum import Enum
from functools import cache, partial
from importlib import import_module
from types import NoneType, UnionType
from typing import (
    Any,
    ClassVar,
    Literal,
    TypeAlias,
    TypeGuard,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)
from weakref import WeakKeyDictionary

from py_trees.behaviour import Behaviour
from py_trees.behaviours import ProbabilisticBehaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Status
from py_trees.ports import PortInformation, PortsMixin

from executive.cell.protocols import BehaviourStep, Cell, Clock, Steps
from executive.errors import Fault, InputError, Interrupted, to_text
from executive.plugins import CLASS_PATH, PluginEntry, list_entries
from executive.skill import Direction, Param, Port, Skill, get_attribute_name, param

_PLAIN_TYPES = (str, int, float, bool, NoneType, list, tuple, dict, set, frozenset, Any)
"""Types of values in a mission if the declaration has no type arguments: `list`, not `list[int]`."""
_CONTAINERS = {
    list: list, tuple: tuple, dict: dict, set: set, frozenset: frozenset, Sequence: list, Mapping: dict,
}  # fmt: skip
"""Type of the value in missions, by the origin of the declared type: `Sequence[int]` takes a list."""
_MAPPINGS = (dict, Mapping)
"""Origins of the declared types of mappings."""


def list_arguments(behaviour: type[Behaviour]) -> dict[str, Param]:
    """Return the arguments of a constructor by name, with the types and defaults of their declarations.

    The arguments include those of base classes that the constructor accepts as `**kwargs`.
    """
    arguments: dict[str, Param] = {}
    for owner in behaviour.__mro__:
        if "__init__" not in vars(owner) or owner is PortsMixin:
            continue
        constructor = vars(owner)["__init__"]
        _, *parameters = inspect.signature(constructor).parameters.values()
        try:
            hints = get_type_hints(constructor)
        except (AttributeError, NameError, TypeError):
            hints = {}  # A type is imported for type checkers only; every value is accepted.
        for parameter in parameters:
            if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY):
                default = ... if parameter.default is parameter.empty else parameter.default
                argument = param(default, doc=_find_description(owner, parameter.name))
                argument = replace(argument, name=parameter.name, type=hints.get(parameter.name, Any))
                arguments.setdefault(parameter.name, argument)
        if all(parameter.kind is not parameter.VAR_KEYWORD for parameter in parameters):
            break
    return arguments


def find_mission_type(declared_type: object) -> object:
    """Return the type that a mission uses for a declared type, or None if missions cannot contain the values.

    An enumeration becomes a Literal of the names of its members. A union keeps the types that a mission can
    contain.
    """
    origin = get_origin(declared_type)
    parts = get_args(declared_type)
    if _is_enumeration(declared_type):
        return cast("Any", Literal)[tuple(declared_type.__members__)]
    if origin in (Union, UnionType):
        parts = tuple(part for part in map(find_mission_type, parts) if part is not None)
        return Union[parts] if parts else None  # noqa: UP007 - the number of types varies
    if origin in _CONTAINERS:
        parts = tuple(part if part is ... else find_mission_type(part) for part in parts)
        return None if None in parts else cast("Any", _CONTAINERS[origin])[parts]
    return declared_type if declared_type in _PLAIN_TYPES or origin is Literal else None


def to_argument(value: object, declared_type: object) -> object:
    """Convert a value from a mission to the declared type: names of enumeration members become members."""
    origin = get_origin(declared_type)
    parts = get_args(declared_type)
    if _is_enumeration(declared_type) and isinstance(value, str):
        return declared_type.__members__.get(value, value)
    if origin in (Union, UnionType):
        candidates = (to_argument(value, part) for part in parts)
        return next((candidate for candidate in candidates if candidate != value), value)
    if isinstance(value, dict) and origin in _MAPPINGS:
        return {to_argument(key, parts[0]): to_argument(item, parts[1]) for key, item in value.items()}
    if isinstance(value, list | tuple) and origin in _CONTAINERS and origin not in _MAPPINGS:
        has_one_type = len(parts) == 1 or ... in parts
        item_types = [parts[0]] * len(value) if has_one_type else parts
        if len(item_types) == len(value):
            return type(value)(map(to_argument, value, item_types))
    return value


def _is_enumeration(declared_type: object) -> TypeGuard[type[Enum]]:
    return isinstance(declared_type, type) and issubclass(declared_type, Enum)


def _find_description(owner: type, name: str) -> str:
    """Return the description of an argument in the Google-style docstring of its class or constructor."""
    for documented in (owner, vars(owner)["__init__"]):
        pattern = rf"^ *{name}(?: \(.*\))?: (.*(?:\n {{6,}}\S.*)*)"
        if match := re.search(pattern, inspect.getdoc(documented) or "", re.MULTILINE):
            return " ".join(match[1].split())
    return ""


PORT_PREFIX = "/ports of behaviours/"
"""Start of the keys of ports on the blackboard."""
NAME_ARGUMENT = "name"
"""Constructor argument for the name of the behaviour; missions cannot set this argument."""
_LOCK = threading.RLock()
"""Lock on the class attributes of `Blackboard`, because another thread may execute another run."""
_STORAGE_BY_CLOCK: WeakKeyDictionary[Clock, dict[str, object]] = WeakKeyDictionary()
"""Values of the blackboard of each run, by the clock of the run: every run has exactly one clock."""


class RunBlackboard:
    """Context manager; in the `with` block, the blackboard of py_trees contains the data of one run.

    The values belong to the run. The clients and the metadata of keys belong to this object and are discarded
    with it, so that no client of a discarded behaviour remains.

    Args:
        clock: Clock of the run.

    Attributes:
        storage: Values by key.
    """

    def __init__(self, clock: Clock) -> None:
        self.storage = _STORAGE_BY_CLOCK.setdefault(clock, {})
        self._attributes = {"storage": self.storage, "metadata": {}, "clients": {}, "activity_stream": None}

    @property
    def shared_values(self) -> dict[str, object]:
        """Copy of the values by key, without the ports, each of which belongs to one behaviour."""
        return {key: value for key, value in self.storage.items() if not key.startswith(PORT_PREFIX)}

    def restore(self, step: BehaviourStep) -> BehaviourStep:
        """Replace the shared values by those of a step, which a replay did not execute; return the step."""
        for key in self.shared_values:
            del self.storage[key]
        self.storage.update({key: value for key, value in step.values.items() if key.startswith("/")})
        return step

    def __enter__(self) -> None:
        _LOCK.acquire()
        self._swap_attributes()

    def __exit__(self, *_: object) -> None:
        self._swap_attributes()
        _LOCK.release()

    def _swap_attributes(self) -> None:
        """Exchange the class attributes of `Blackboard` with the attributes of this object."""
        for name, value in self._attributes.items():
            self._attributes[name] = getattr(Blackboard, name)
            setattr(Blackboard, name, value)


class BehaviourSkill(Skill):
    """Base class of skills that run a behaviour; `make_behaviour_skill` returns a subclass.

    Each start creates the behaviour, connects its ports, and calls its `setup`. Each control step ticks the
    behaviour once. A halt calls `stop(INVALID)`. When the run ends, with any result, `shutdown` is called.

    Attributes:
        behaviour_type: Class of the behaviour.
        arguments: Arguments of its constructor by name.
    """

    behaviour_type: ClassVar[type[Behaviour]]
    arguments: ClassVar[Mapping[str, Param]]
    reasons: ClassVar = ("failed",)

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        self._values = values

    def run(self, cell: Cell) -> Steps:
        """Tick a new instance of the behaviour until it ends; its feedback message explains a failure."""
        blackboard = RunBlackboard(cell.clock)
        ticks = self._tick_until_end(blackboard)
        execute = partial(cell.behaviours.execute, type(self).__name__)

        def stop() -> BehaviourStep:
            ticks.close()
            return BehaviourStep(Status.INVALID.name, "", blackboard.shared_values)

        try:
            while (step := blackboard.restore(execute(partial(next, ticks)))).status == Status.RUNNING.name:
                yield
        except GeneratorExit:
            blackboard.restore(execute(stop))
            raise
        if step.status == Status.FAILURE.name:
            raise self.failure("failed", step.message)
        if step.status != Status.SUCCESS.name:
            raise Fault("its status is INVALID after a tick; update must return RUNNING, SUCCESS or FAILURE")
        for name, port in self.ports.items():
            value = step.values.get(name)
            # A required output without a value remains unset: the caller then reports a fault of the skill.
            if port.direction is Direction.OUT and (value is not None or port.default is None):
                setattr(self, get_attribute_name(name), value)

    def _tick_until_end(self, blackboard: RunBlackboard) -> Generator[BehaviourStep, None, None]:
        """Create the behaviour, and yield the result of each tick until the behaviour has ended."""
        with blackboard:
            behaviour = self.behaviour_type(**self._make_arguments())
        keys = {port: f"{PORT_PREFIX}{behaviour.id.hex}/{port}" for port in self.ports}
        try:
            with blackboard:
                if isinstance(behaviour, PortsMixin):
                    behaviour.setup_ports(keys)
                    blackboard.storage.update(self._list_inputs(keys))
                behaviour.setup_with_descendants()
                behaviour.tick_once()
            while behaviour.status is Status.RUNNING:
                yield BehaviourStep(behaviour.status.name, "", blackboard.shared_values)
                with blackboard:
                    behaviour.tick_once()
        finally:
            with blackboard:
                _stop_and_shut_down(behaviour)
            values = {port: blackboard.storage.pop(key, None) for port, key in keys.items()}
        outputs = {name: values[name] for name in values if self.ports[name].direction is Direction.OUT}
        message = _explain_failure(behaviour) if behaviour.status is Status.FAILURE else ""
        yield BehaviourStep(behaviour.status.name, message, blackboard.shared_values | outputs)

    def _make_arguments(self) -> dict[str, Any]:
        values = {name: self._values[name] for name in self.params if name in self._values}
        name = {NAME_ARGUMENT: type(self).__name__} if NAME_ARGUMENT in self.arguments else {}
        return name | {name: to_argument(value, self.arguments[name].type) for name, value in values.items()}

    def _list_inputs(self, keys: Mapping[str, str]) -> Iterator[tuple[str, object]]:
        """Yield the key on the blackboard and the value of each input that has a value other than None."""
        for name in keys:
            if (value := self._values.get(name)) is not None:
                # py_trees accepts no integer where a float is declared.
                is_float = self.ports[name].type is float and type(value) is int
                yield keys[name], float(value) if is_float else value


@cache
def make_behaviour_skill(name: str, behaviour_type: type[Behaviour]) -> type[BehaviourSkill]:
    """Return a skill class called `name` that runs a behaviour.

    The arguments of the constructor become params of the skill, and the ports of the behaviour become ports
    of the skill.

    Raises:
        InputError: A mission cannot use the behaviour. The message has no subject; the caller puts the name
            of the behaviour before the message.
    """
    port_tables = ("INPUT_PORTS", "OUTPUT_PORTS") if issubclass(behaviour_type, PortsMixin) else ()
    if inspect.isabstract(behaviour_type) or not all(hasattr(behaviour_type, table) for table in port_tables):
        raise InputError("is abstract: it has no method update, or does not declare its ports")
    ports = {
        port: _make_port(port, direction, declared)
        for direction, table in zip(Direction, port_tables, strict=False)
        for port, declared in getattr(behaviour_type, table).items()
    }
    arguments = list_arguments(behaviour_type)
    params = dict(_make_params(arguments))
    for each in (*params, *ports):
        if hasattr(Skill, each):
            raise InputError(f'has an argument or port with the reserved name "{each}"; rename it')
        if each in params and each in ports:
            raise InputError(f'has an argument and a port with the same name "{each}"; rename one of them')
    # The other behaviours of this module depend only on their arguments and the blackboard.
    senses = behaviour_type.__module__ != "py_trees.behaviours" or behaviour_type is ProbabilisticBehaviour
    members = {
        "__doc__": inspect.getdoc(behaviour_type), "__module__": behaviour_type.__module__,
        "behaviour_type": behaviour_type, "arguments": arguments, "params": params, "ports": ports,
        "is_condition": getattr(behaviour_type, "is_condition", False),
        "senses": getattr(behaviour_type, "senses", senses),
    }  # fmt: skip
    try:
        return cast("type[BehaviourSkill]", type(name, (BehaviourSkill,), members))
    except TypeError as error:
        raise InputError(f"cannot be a skill: {error}") from None


def _make_params(arguments: Mapping[str, Param]) -> Iterator[tuple[str, Param]]:
    """Yield name and declaration of the param for each argument that a mission can set."""
    for name, argument in arguments.items():
        mission_type = find_mission_type(argument.type)
        default = argument.default
        if name != NAME_ARGUMENT and mission_type is not None:
            # The default is only shown to authors; without a value, the constructor applies its own default.
            default = default.name if isinstance(default, Enum) else default
            default = default if default is ... or isinstance(default, str | int | float) else None
            yield name, replace(argument, type=mission_type, default=default)
        elif name != NAME_ARGUMENT and default is ...:
            raise InputError(
                f'needs the argument "{name}", and no mission can contain a value of its type; '
                "register a subclass whose constructor sets it"
            )


def _make_port(name: str, direction: Direction, declared: PortInformation) -> Port:
    """Convert a port declaration of py_trees; an optional port without a default has the default None."""
    default: object = ... if declared.required else None
    if direction is Direction.IN and declared.has_default:
        default = declared.default_value
    port_type = Union[declared.data_type, None] if default is None else declared.data_type  # noqa: UP007
    return Port(name, port_type, direction, default, "", declared.description)


def _explain_failure(behaviour: Behaviour) -> str:
    """Return the feedback message of a failed behaviour; if empty, the message of the failed descendant."""
    failed_node = behaviour.tip()
    if behaviour.feedback_message or failed_node in (None, behaviour):
        return to_text(behaviour.feedback_message or "it has no feedback message")
    return to_text(f"{failed_node.name}: {failed_node.feedback_message or 'no feedback message'}")


def _stop_and_shut_down(behaviour: Behaviour) -> None:
    """Stop the running nodes of a behaviour, and shut all nodes down, also after an exception of a node."""
    errors: list[BaseException] = []
    actions: list[Callable[[], None]] = [partial(_stop, node) for node in (behaviour, *behaviour.iterate())]
    actions += [node.shutdown for node in behaviour.iterate()]
    for action in actions:
        try:
            action()
        except Interrupted:
            raise
        except BaseException as error:
            errors.append(error)
    if errors:
        # The halted generator would take a `GeneratorExit` for its own.
        raise Fault("GeneratorExit") if isinstance(errors[0], GeneratorExit) else errors[0]


def _stop(node: Behaviour) -> None:
    if node.status is Status.RUNNING:
        try:
            node.stop(Status.INVALID)
        finally:
            node.status = Status.INVALID


SKILL_GROUP = "executive.skills"
"""Entry-point group of skills."""
Skills: TypeAlias = Mapping[str, type[Skill]]
"""Installed skills by name."""
PY_TREES_MODULES = ("py_trees.behaviours", "py_trees.timers")
"""Modules of py_trees whose behaviours a mission may use."""


class _InstalledSkills(Mapping[str, type[Skill]]):
    """Installed skills by name, each of which is imported at its first use."""

    def __init__(self, entries: Mapping[str, PluginEntry]) -> None:
        self._entries = entries
        self._skills: dict[str, type[Skill]] = {}

    def __getitem__(self, name: str) -> type[Skill]:
        if name not in self._skills:
            entry = self._entries[name]
            self._skills[name] = _convert_to_skill(name, entry.value, entry.load())
        return self._skills[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, name: object) -> bool:
        return name in self._entries


def load_skills() -> Skills:
    """Return the classes of all registered skills, by name; a behaviour of py_trees becomes a skill.

    A class is imported at the first access to its name, which raises an InputError if the entry is not a
    skill or cannot be loaded.

    Raises:
        InputError: Two packages register the same name, or the pyproject.toml of the project in the working
            directory is invalid.
    """
    return _InstalledSkills(list_entries(SKILL_GROUP, "skill"))


def load_behaviour(path: str) -> type[Skill]:
    """Return the behaviour of py_trees at `module:Class` as a skill with the name of the class.

    A mission cannot execute code: the module must belong to py_trees, or contain a registered skill, which a
    mission may import anyway.

    Raises:
        InputError: The path is malformed, the module is not permitted, or the class cannot be used.
    """
    if CLASS_PATH.fullmatch(path) is None:
        raise InputError(f'"{path}" is no import path; write, for example, py_trees.behaviours:TickCounter')
    module, _, name = path.partition(":")
    entries = list_entries(SKILL_GROUP, "skill").values()
    if module not in {*PY_TREES_MODULES, *(entry.value.partition(":")[0] for entry in entries)}:
        raise InputError(
            f'a mission may not import "{module}"; it may name classes of {" and ".join(PY_TREES_MODULES)}, '
            "and of modules that register a skill"
        )
    members = vars(import_module(module))
    behaviour = members.get(name)
    if getattr(behaviour, "__module__", "") != module:
        similar = "".join(difflib.get_close_matches(name, members, n=1))
        suggestion = f' (did you mean "{similar}"?)' if similar else ""
        raise InputError(f'the module "{module}" defines no class "{name}"{suggestion}')
    if not (isinstance(behaviour, type) and issubclass(behaviour, Behaviour)):
        problem = "is not a behaviour of py_trees, a subclass of py_trees.behaviour.Behaviour"
        raise InputError(f'"{path}" {problem}')
    return _convert_to_skill(name, path, behaviour)


def _convert_to_skill(name: str, path: str, loaded: object) -> type[Skill]:
    """Return a loaded class if it is a skill, or the skill for a behaviour of py_trees."""
    if isinstance(loaded, type) and issubclass(loaded, Skill):
        return loaded
    if isinstance(loaded, type) and issubclass(loaded, Behaviour):
        try:
            return make_behaviour_skill(name, loaded)
        except InputError as error:
            raise InputError(f'the behaviour "{name}" ({path}) {error}') from None
    raise InputError(f'the entry point "{name}" ({path}) is neither a subclass of Skill nor of Behaviour')
