"""Checks of the types of variables: the written values must fit the inputs that read the variables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from executive.cell.objects import Item
from executive.mission.check.context import CheckContext
from executive.mission.check.skill_settings import find_unknown_names
from executive.mission.descriptions import describe_value
from executive.mission.findings import Finding, make_error, suggest_choice
from executive.mission.model.conversion import find_problem
from executive.mission.model.nodes import InnerNode, KeyValue, Node, SkillNode
from executive.mission.model.port_types import describe_type, find_element_type, find_fields, is_assignable
from executive.mission.model.values import Literal, Reference
from executive.mission.model.wiring import Wire, find_control_node_outputs, find_literals
from executive.mission.source import Span
from executive.skill import Direction, Param


@dataclass(frozen=True)
class Writer:
    """An output that writes a variable.

    Attributes:
        name: Name in messages: `Localize.targets`, or the keyword of a control node.
        span: Position of the node.
        type: Type of the written values.
        refers_to: Kind of the written names, for example `bin` or `item`; "" if the output writes no names.
        constants: Written constants; None if the values are unknown before the run.
    """

    name: str
    span: Span
    type: object
    refers_to: str
    constants: tuple[Literal, ...] | None = None

    def describe(self, span: Span) -> str:
        """Return name and position of the writer, for a message at `span`."""
        return f"{self.name} in {self.span.describe_place(span.source)}"


WritersByVariable = Mapping[str, Sequence[Writer]]
"""Outputs that write a variable, by the name of the variable."""


def check_port_types(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every input that does not accept all possible values of its variable."""
    skill_writers: dict[str, list[Writer]] = {}
    for node in context.tree.walk():
        for wire in context.find_wires(node, Direction.OUT):
            writer = Writer(str(wire), node.span, wire.port.type, wire.port.refers_to)
            skill_writers.setdefault(wire.variable, []).append(writer)

    def check_node_and_children(node: Node, loop_writers: WritersByVariable) -> Iterator[Finding]:
        for key, variable in find_control_node_outputs(node):
            all_writers = {**skill_writers, **loop_writers}
            elements = node.values.get(key.list_key, ()) if isinstance(node, InnerNode) else ()
            list_writers = _find_list_writers(node, elements, all_writers)
            if isinstance(elements, Reference):
                yield from _check_field(node.type_name, elements, all_writers.get(elements.name, ()))
                yield from _check_lists(f"{node.type_name}.{key.list_key}", elements, list_writers)
            loop_writers = {**loop_writers, variable.name: [*_make_element_writers(node, list_writers)]}
        for wire in context.find_wires(node, Direction.IN):
            writers = loop_writers.get(wire.variable, skill_writers.get(wire.variable, ()))
            yield from _check_field(str(wire), wire.reference, writers)
            for writer in _select_field(writers, wire.field):
                yield from _check_connection(context, wire, writer)
                yield from _check_compared_constants(context, node, wire, writer)
        for child in node.children:
            yield from check_node_and_children(child, loop_writers)

    yield from check_node_and_children(context.tree, {})


def _find_list_writers(node: Node, elements: KeyValue, writers: WritersByVariable) -> list[Writer]:
    """Return the writers of a list; a node with a constant list counts as the writer of the list."""
    if isinstance(elements, Reference):
        return list(_select_field(writers.get(elements.name, ()), elements.field))
    if not isinstance(elements, Literal):
        return []
    if elements.value == "items":
        return [Writer(node.type_name, node.span, list[Item], "item")]
    return [Writer(node.type_name, node.span, list[Any], "", (elements,))]


def _check_lists(name: str, reference: Reference, list_writers: Iterable[Writer]) -> Iterator[Finding]:
    """Yield an error for each writer of `reference` that writes no list, but the key `name` needs a list."""
    for writer in list_writers:
        for constant in writer.constants or ():
            if not isinstance(constant.value, list):
                message = f"{name} takes a list, but {reference} gets {describe_value(constant.value)} here"
                hint = f"{name} reads {reference} in {reference.span.describe_place(constant.span.source)}."
                yield make_error(constant.span, "port-type", message, hint)
        if writer.constants is None and find_element_type(writer.type) is None:
            message = f"{name} takes a list, but {reference} holds {describe_type(writer.type)}"
            hint = f"${reference.local_name} is written by {writer.describe(reference.span)}."
            yield make_error(reference.span, "port-type", message, hint)


def _make_element_writers(node: Node, list_writers: Iterable[Writer]) -> Iterator[Writer]:
    """Per writer of a list, yield `node`, which iterates over the list, as the writer of its elements."""
    for writer in list_writers:
        if writer.constants is not None:
            elements = [
                Literal(element, constant.get_element_span(index))
                for constant in writer.constants
                if isinstance(constant.value, list)
                for index, element in enumerate(constant.value)
            ]
            yield Writer(node.type_name, node.span, Any, "", tuple(elements))
        elif (element_type := find_element_type(writer.type)) is not None:
            yield Writer(node.type_name, node.span, element_type, writer.refers_to)


def _check_field(reader: str, reference: Reference, writers: Iterable[Writer]) -> Iterator[Finding]:
    """Yield an error for each writer whose values lack the field that `reader` reads."""
    for writer in writers if reference.field else ():
        fields = find_fields(writer.type, writer.refers_to)
        if reference.field not in fields:
            is_constant = writer.constants is not None
            values = "a constant" if is_constant else describe_values(writer.type, writer.refers_to)
            message = f"{reader} reads {reference}, but ${reference.local_name} holds {values}"
            fields_hint = (
                suggest_choice(reference.field, fields, "Fields") if fields else "This value has no fields."
            )
            hint = f"{fields_hint} ${reference.local_name} is written by {writer.describe(reference.span)}."
            yield make_error(reference.span, "unknown-field", message, hint)


def _select_field(writers: Iterable[Writer], field: str) -> Iterator[Writer]:
    """For each writer whose values have `field`, yield a writer of the field; "" yields all writers."""
    for writer in writers:
        if not field:
            yield writer
        elif found := find_fields(writer.type, writer.refers_to).get(field):
            field_type, refers_to = found
            yield replace(writer, type=field_type, refers_to=refers_to)


def _check_connection(context: CheckContext, wire: Wire, writer: Writer) -> Iterator[Finding]:
    """Yield an error for each value or type of a writer that does not fit the input `wire`."""
    port, choices = wire.port, (wire.port.choices or ()) if isinstance(wire.port, Param) else ()
    port_type = describe_values(port.type, port.refers_to)
    if choices and not port.refers_to:
        port_type = " or ".join(map(str, choices))
    for constant in writer.constants or ():
        if find_problem(constant.value, port):
            value = describe_value(constant.value)
            message = f"{wire} takes {port_type}, but ${wire.variable} gets {value} here"
            hint = f"{wire} reads ${wire.variable} in {wire.span.describe_place(constant.span.source)}."
            yield make_error(constant.span, "port-type", message, hint)
        else:
            yield from find_unknown_names(context, wire.skill, port, constant)
    if writer.constants is not None:
        return
    is_type_accepted = is_assignable(writer.type, port.type)
    if is_type_accepted and (writer.refers_to == port.refers_to if port.refers_to else not choices):
        return
    is_any_text = is_type_accepted and not writer.refers_to
    written_type = "any text" if is_any_text else describe_values(writer.type, writer.refers_to)
    message = f"{wire} takes {port_type}, but {wire.reference} holds {written_type}"
    hint = f"${wire.reference.local_name} is written by {writer.describe(wire.span)}."
    yield make_error(wire.span, "port-type", message, hint)


def _check_compared_constants(
    context: CheckContext, node: Node, wire: Wire, writer: Writer
) -> Iterator[Finding]:
    """Yield an error for each constant that is compared with `wire`, if `writer` can never write it."""
    literals = find_literals(node) if isinstance(node, SkillNode) and writer.constants is None else ()
    for name, value in literals:
        port = context.skills[wire.skill].ports.get(name)
        # `check_settings` reports a constant of the wrong type.
        if port is None or port.compared_with != wire.port.name or find_problem(value.value, port):
            continue
        # A field such as `$item.bin` is "" if it names no bin; `find_unknown_names` accepts the default.
        expected = replace(port, type=writer.type, refers_to=writer.refers_to, default="")
        yield from find_unknown_names(context, wire.skill, expected, value)
        if not is_assignable(type(value.value), expected.type):
            kind = describe_values(expected.type, expected.refers_to)
            message = f"{wire.reference} is {kind} and never equals {describe_value(value.value)}"
            hint = f"{wire.skill} compares {wire.reference} with this constant."
            yield make_error(value.span, "port-type", message, hint)


def describe_values(declared_type: object, refers_to: str) -> str:
    """Return a description of the values of a type; strings are names of the kind `refers_to`, if any."""
    if not refers_to:
        return describe_type(declared_type)
    is_list = not is_assignable(str, declared_type)
    article = "an" if refers_to[0] in "aeiou" else "a"
    return f"a list of names of {refers_to}s" if is_list else f"the name of {article} {refers_to}"
