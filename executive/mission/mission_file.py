"""Content of mission and library files as typed values, and their parsers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, cast, get_origin

from pydantic import JsonValue

from executive.mission.grammar import (
    NAME_PATTERN,
    LibraryKeys,
    MappingReader,
    MissionKeys,
    ParamKeys,
    SubtreeKeys,
    VariableKeys,
    is_empty,
    make_literal,
    read_settings,
    read_value,
)
from executive.mission.node_parser import NodeParser
from executive.mission.ports import ValueProblem, convert_setting, convert_value
from executive.skill import Param, param
from executive.text.findings import suggest_choice
from executive.text.validate import CELL_PREFIX, make_override_source, parse_override
from executive.text.yaml_files import YamlEntry, YamlMapping, YamlNode, YamlScalar, YamlSequence
from executive.tree.specification import (
    Constant,
    Expression,
    InvalidValue,
    LocatedName,
    Node,
    Reference,
    Value,
)


@dataclass(frozen=True)
class Subtree:
    """A named tree under `trees`.

    Attributes:
        doc: Purpose of the subtree, or "".
        arguments: Defaults of the arguments by name; None for a mandatory argument.
        returns: Variables that are not local; None: no variable is local.
        body: Root node of the subtree.
        variables: Local variables with their initial values.
        library: Name of the library that defines the subtree; "" if the mission file defines it.
    """

    name: LocatedName
    doc: str
    arguments: Mapping[LocatedName, Value | None]
    returns: tuple[LocatedName, ...] | None
    body: Node
    variables: Mapping[LocatedName, MissionParam] = field(default_factory=dict)
    library: str = ""


@dataclass(frozen=True)
class MissionParam:
    """A constant of the mission, or a variable that `set` changes.

    Attributes:
        value: Value in this run: the value of `--set`, otherwise the default; or an invalid value. Of a
            variable, the initial value.
        declaration: Type, bounds and choices; the type is `Any` if it is unknown.
    """

    value: Constant | InvalidValue
    declaration: Param


QuotaKey = tuple[LocatedName, LocatedName | None]
"""Bin and class of a quota; None for all classes."""


@dataclass(frozen=True)
class Mission:
    """Content of a mission file.

    Attributes:
        name, description: Values of the keys `mission` and `description`.
        cell: Path of the cell file, relative to the folder of the mission.
        libraries: Paths of the library files, relative to the folder of the mission.
        params: Constants by name, with the values of `--set`.
        routes: Bins that may receive the objects of a class, by class.
        quotas: Maximum numbers of objects in a bin, of one class or of all.
        variables: Variables of the mission with their initial values.
        tree: Root node of the tree; None if the key is missing.
        subtrees: Subtrees of the mission and of its libraries, by name.
        is_complete: False if a library could not be read, so that `subtrees` may lack subtrees.
    """

    name: str
    description: str
    cell: LocatedName
    libraries: tuple[LocatedName, ...] = ()
    params: Mapping[LocatedName, MissionParam] = field(default_factory=dict)
    routes: Mapping[LocatedName, tuple[LocatedName, ...]] = field(default_factory=dict)
    quotas: Mapping[QuotaKey, Value] = field(default_factory=dict)
    variables: Mapping[LocatedName, MissionParam] = field(default_factory=dict)
    tree: Node | None = None
    subtrees: Mapping[str, Subtree] = field(default_factory=dict)
    is_complete: bool = True


UNITS = ("s", "m", "m/s", "N")
"""Units of variables."""
PARAM_TYPES = {"text": str, "integer": int, "number": float, "boolean": bool, "list": list[Any]}
"""Python types of params, by their names in a mission."""


def parse_params(reader: MappingReader, overrides: Mapping[str, str]) -> dict[LocatedName, MissionParam]:
    """Return the params of a mission file by name, with the values of the overrides."""
    params: dict[LocatedName, MissionParam] = {}
    for name, node in reader.iterate_entries("params"):
        reader.check_name(name, "a param")
        if isinstance(node, YamlMapping):
            keys = ParamKeys.get_keys()
            param_reader = MappingReader(f'the param "{name}"', name.span, node, keys, reader.findings)
            params[name] = _read_declaration(name, param_reader, name in overrides)
        else:
            value = make_literal(node)
            params[name] = MissionParam(value, replace(param(), type=_infer_type(value.value)))
    for name, mission_param in params.items():
        if name in overrides:
            is_text = mission_param.declaration.type is str
            override, findings = parse_override(name, overrides[name], is_text)
            reader.findings += findings
            if override:
                params[name] = _replace_value(name, mission_param, make_literal(override), reader)
    for key, text in overrides.items():
        if key not in params and not key.startswith(CELL_PREFIX):
            span = make_override_source(key, text).make_span(1, 1, max(1, len(key)))
            hint = suggest_choice(key, params, "Params of the mission")
            reader.add_error(span, "unknown-param", f'the mission has no param "{key}"', hint)
    return params


def parse_variables(reader: MappingReader) -> dict[LocatedName, MissionParam]:
    """Return the variables below `variables` by name, with their initial values."""
    variables: dict[LocatedName, MissionParam] = {}
    for name, node in reader.iterate_entries("variables"):
        reader.check_name(name, "a variable")
        keys = VariableKeys.get_keys()
        if not isinstance(node, YamlMapping):
            node = YamlMapping(
                node.span, {"default": YamlEntry(YamlScalar(name.span, "default", "default"), node)}
            )
        declaration_reader = MappingReader(f'the variable "{name}"', name.span, node, keys, reader.findings)
        variable = _read_declaration(name, declaration_reader, is_overridden=False)
        unit = declaration_reader.read_text("unit")
        if unit not in ("", *UNITS):
            hint = suggest_choice(unit, UNITS, "Units")
            message = f'there is no unit "{unit}"'
            reader.add_error(declaration_reader.get_value_span("unit"), "wrong-value", message, hint)
        variables[name] = replace(variable, declaration=replace(variable.declaration, unit=unit))
    return variables


def _read_declaration(name: str, reader: MappingReader, is_overridden: bool) -> MissionParam:
    """Return the param that a mapping with keys such as `default` and `min` declares."""
    default = reader.get("default")
    value = None if default is None else read_value(default, reader.findings)
    if isinstance(value, Reference | Expression):
        message = f"the default of {reader.owner} must be a constant"
        reader.add_error(value.span, "wrong-type", message, "For a text that begins so, write $$.")
        value = InvalidValue(value.span)
    items = reader.list_items("choices")
    reader.read_text("doc")
    declaration = param(
        ge=_read_bound(reader, "min"),
        le=_read_bound(reader, "max"),
        choices=tuple(item.python_value for item in items) if reader.get("choices") else None,
    )
    type_name = reader.read_text("type")
    if type_name and type_name not in PARAM_TYPES:
        hint = suggest_choice(type_name, PARAM_TYPES, "Types")
        message = f'there is no type "{type_name}"'
        reader.add_error(reader.get_value_span("type"), "wrong-value", message, hint)
    default_type = _infer_type(value.value if isinstance(value, Constant) else None)
    declaration = replace(declaration, type=PARAM_TYPES.get(type_name, default_type))
    without_value = MissionParam(InvalidValue(reader.span), declaration)
    problem = f"{name} cannot have any value"
    if declaration.choices == ():
        reader.add_error(reader.get_value_span("choices"), "empty-list", f"{problem}: choices is empty")
    elif declaration.ge is not None and declaration.le is not None and declaration.ge > declaration.le:
        problem = f"{problem}: min {declaration.ge:g} is greater than max {declaration.le:g}"
        reader.add_error(reader.get_value_span("min"), "out-of-range", problem)
    elif isinstance(value, Constant):
        return _replace_value(name, without_value, value, reader)
    elif default is None and not is_overridden:
        message = f"{reader.owner} has neither a default nor a value"
        hint = f"Set it with --set {name}=..." if reader.owner.startswith("the param") else ""
        reader.add_error(reader.span, "missing-param", message, hint)
    return without_value


def _infer_type(value: object) -> object:
    """Return the param type of a value, or `Any` if no param type fits."""
    types = PARAM_TYPES.values()
    return next((declared for declared in types if type(value) is (get_origin(declared) or declared)), Any)


def _read_bound(reader: MappingReader, key: str) -> float | None:
    """Return the number below `key`, or None; add an error for a value of another type."""
    if (node := reader.get(key)) is None:
        return None
    try:
        return cast("float", convert_value(node.python_value, float))
    except ValueProblem as problem:
        reader.add_error(node.span, "wrong-type", f"{key} of {reader.owner} {problem}")
    return None


def _replace_value(name: str, param: MissionParam, value: Constant, reader: MappingReader) -> MissionParam:
    """Return the param with a value; if the value is not allowed, add an error and return the old param."""
    try:
        converted = cast("JsonValue", convert_setting(value.value, param.declaration))
    except ValueProblem as problem:
        reader.add_error(value.span, problem.code, f"{name} {problem}")
        return param
    return replace(param, value=replace(value, value=converted))


_MISSION_NAME_PATTERN = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")
"""Matches the names of missions; the names of run directories contain the name of the mission."""


def parse_mission(root: YamlNode, overrides: Mapping[str, str], parser: NodeParser) -> Mission:
    """Return the valid content of a mission file; add errors to the findings of `parser`."""
    span = replace(root.span, length=1)
    reader = MappingReader("the mission", span, root, MissionKeys.get_keys(), parser.findings)
    tree = reader.get("tree")
    library_rule = "library must be the path of a file or a list of paths"
    return Mission(
        name=_read_name(reader),
        description=reader.read_text("description"),
        cell=_read_cell(reader),
        libraries=_read_names(reader, reader.list_items("library"), library_rule),
        params=parse_params(reader, overrides),
        routes=_read_routes(reader),
        quotas=_read_quotas(reader),
        variables=parse_variables(reader),
        tree=None if tree is None else parser.read_node(tree, reader.get_key_span("tree")),
        subtrees=_read_subtrees(reader, parser),
    )


def _read_name(reader: MappingReader) -> str:
    name = reader.read_text("mission")
    if isinstance(reader.get("mission"), YamlScalar) and not _MISSION_NAME_PATTERN.fullmatch(name):
        message = f'"{name}" is no valid name of a mission'
        hint = 'Use at most 64 letters, digits, "_" and "-", and begin with a letter.'
        reader.add_error(reader.get_value_span("mission"), "bad-name", message, hint)
    return name


def _read_cell(reader: MappingReader) -> LocatedName:
    cell = LocatedName(reader.read_text("cell"), reader.get_value_span("cell"))
    if isinstance(reader.get("cell"), YamlScalar) and not cell:
        reader.add_error(cell.span, "bad-name", "cell must be the path of a cell file")
    return cell


def _read_routes(reader: MappingReader) -> dict[LocatedName, tuple[LocatedName, ...]]:
    routes = {}
    for label, node in reader.iterate_entries("routes"):
        items = node.items if isinstance(node, YamlSequence) else (node,)
        if not items:
            reader.add_error(node.span, "empty-list", "a route needs at least one bin")
        routes[label] = _read_names(reader, items, "a route must be a bin or a list of bins")
    return routes


def _read_quotas(reader: MappingReader) -> dict[QuotaKey, Value]:
    """Return the quotas below `quotas`: a limit for each bin, or a mapping of classes to limits."""
    quotas: dict[QuotaKey, Value] = {}
    for bin, node in reader.iterate_entries("quotas"):
        if not isinstance(node, YamlMapping):
            quotas[bin, None] = read_value(node, reader.findings)
        elif not node.entries:
            reader.add_error(node.span, "empty-list", f"the quota of {bin} names no class")
        else:
            labels = read_settings(node, "quotas", reader.findings).items()
            quotas |= {(bin, label): limit for label, limit in labels}
    return quotas


def _read_names(reader: MappingReader, items: Iterable[YamlNode], rule: str) -> tuple[LocatedName, ...]:
    """Return the texts in a list; for each item of another type, add an error that begins with `rule`."""
    names = []
    for item in items:
        if isinstance(item, YamlScalar) and isinstance(item.value, str):
            names.append(LocatedName(item.text, item.span))
        else:
            reader.add_error(item.span, "wrong-type", f"{rule}, not {item.description}")
    return tuple(names)


def parse_library(root: YamlNode, parser: NodeParser) -> dict[str, Subtree]:
    """Return the valid subtrees of a library file by name; add errors to the findings of `parser`."""
    span = replace(root.span, length=1)
    reader = MappingReader("the library", span, root, LibraryKeys.get_keys(), parser.findings)
    return _read_subtrees(reader, parser, reader.read_text("library") or "library")


def _read_subtrees(reader: MappingReader, parser: NodeParser, library: str = "") -> dict[str, Subtree]:
    """Return the subtrees below `trees`; `library` is the name of their library, "" for the mission file."""
    subtrees: dict[str, Subtree] = {}
    for name, node in reader.iterate_entries("trees"):
        reader.check_name(name, "a subtree")
        if isinstance(node, YamlMapping) and SubtreeKeys.get_keys().keys() & node.entries.keys():
            subtrees[name] = _parse_subtree(name, node, parser, library)
        else:
            body = parser.read_node(node, name.span)
            subtrees[name] = Subtree(name, "", {}, None, body, library=library)
    return subtrees


def _parse_subtree(name: LocatedName, node: YamlMapping, parser: NodeParser, library: str) -> Subtree:
    """Return the subtree of a mapping with subtree keys."""
    if node.get("do") is None:
        parser.add_error(name.span, "missing-key", f'the subtree "{name}" needs the key "do"')
        parser = parser.make_silent_parser()
    keys = SubtreeKeys.get_keys()
    reader = MappingReader(f'the subtree "{name}"', name.span, node, keys, parser.findings)
    return Subtree(
        name,
        doc=reader.read_text("doc"),
        arguments=_read_arguments(reader),
        returns=_read_returns(reader),
        body=parser.read_node(reader.get("do"), reader.get_key_span("do")),
        variables=parse_variables(reader),
        library=library,
    )


def _read_arguments(reader: MappingReader) -> dict[LocatedName, Value | None]:
    """Return the arguments below `args`, which is a list of names, or a mapping of names to defaults."""
    arguments: dict[LocatedName, Value | None] = {}
    hint = "Write the name without $; in the subtree, $name is the value."
    for written_name, value in _iterate_arguments(reader):
        reader.check_name(written_name, "an argument", hint)
        name = LocatedName(written_name.removeprefix("$"), written_name.span)
        if name in arguments:
            first_line = next(argument for argument in arguments if argument == name).span.line
            message = f'the argument "{name}" occurs twice; the first is in line {first_line}'
            reader.add_error(name.span, "duplicate-key", message)
        arguments[name] = None if is_empty(value) else read_value(value, reader.findings)
    return arguments


def _iterate_arguments(reader: MappingReader) -> Iterator[tuple[LocatedName, YamlNode]]:
    """Yield name and default of each argument; without a default, an empty scalar."""
    if not isinstance(reader.get("args"), YamlSequence):
        yield from reader.iterate_entries("args")
        return
    for item in reader.list_items("args"):
        if isinstance(item, YamlScalar):
            yield LocatedName(item.text, item.span), YamlScalar(item.span, None, "")
        else:
            message = "a list of arguments contains names only; for defaults, write a mapping"
            reader.add_error(item.span, "wrong-type", message)


def _read_returns(reader: MappingReader) -> tuple[LocatedName, ...] | None:
    """Return the names below `returns`, or None if the key is missing."""
    if reader.get("returns") is None:
        return None
    names = []
    for item in reader.list_items("returns"):
        name = item.text.removeprefix("$") if isinstance(item, YamlScalar) else ""
        if NAME_PATTERN.fullmatch(name):
            names.append(LocatedName(name, item.span))
        else:
            message = "returns must be a list of names of variables, for example [targets]"
            reader.add_error(item.span, "bad-name", message)
    return tuple(dict.fromkeys(names))
