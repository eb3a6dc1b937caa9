"""Parser of the quotas of a mission."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from executive.mission.findings import suggest_choice
from executive.mission.model.conversion import WrongType, convert_constant
from executive.mission.model.mission import MissionParam, Quota
from executive.mission.model.values import Literal, LocatedName, Reference
from executive.mission.parse.mapping_reader import MappingReader, read_value
from executive.mission.text.yaml_text import YamlMapping, YamlNode
from executive.tree.keys import Key

_LIMIT = Key("Maximum number of objects.", ge=1, value_type=int)


def read_quotas(reader: MappingReader, params: Mapping[str, MissionParam]) -> Iterator[Quota]:
    """Yield the valid quotas below the key `quotas` of a mission; `$name` stands for the value of a param."""
    for bin_name, bin_span, node in reader.iterate_entries("quotas"):
        bin = LocatedName(bin_name, bin_span)
        if not isinstance(node, YamlMapping):
            if (limit := _read_limit(reader, f"the quota of {bin_name}", node, params)) is not None:
                yield Quota(bin, None, limit)
            continue
        if not node.entries:
            reader.add_error(node.span, "empty-list", f"the quota of {bin_name} names no class")
        for entry in node.entries:
            name = f"the quota of {bin_name} for {entry.key.text}"
            if (limit := _read_limit(reader, name, entry.value, params)) is not None:
                yield Quota(bin, LocatedName(entry.key.text, entry.key.span), limit)


def _read_limit(
    reader: MappingReader, name: str, node: YamlNode, params: Mapping[str, MissionParam]
) -> Literal | None:
    """Return a number of objects, or None after an error; `name` is the name of the quota in messages."""
    value = read_value(node, reader.findings)
    if isinstance(value, Reference):
        if value.name not in params:
            names = [f"${param}" for param in params]
            hint = suggest_choice(f"${value.name}", names, "Params of the mission")
            message = f"{name} must be a number, but ${value.name} is no param"
            reader.add_error(value.span, "unknown-param", message, hint)
            return None
        if value.field:
            reader.add_error(value.span, "unknown-field", f"{name} must be a number; params have no fields")
            return None
        origin = f"${value.name} in line {value.span.line}"
        value = replace(params[value.name].value, origin=origin)
    if value is None:
        return None
    try:
        convert_constant(_LIMIT, value.value)
    except WrongType as problem:
        reader.add_error(value.span, problem.code, f"{name} {problem}{value.origin_note}")
        return None
    return value
