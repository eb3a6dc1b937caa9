"""Checks of the types of variables: the written values must fit the inputs that read the variables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from executive.mission.check.context import CheckContext
from executive.mission.descriptions import describe_value
from executive.mission.findings import Finding, make_error, suggest_choice
from executive.mission.model.conversion import find_input_problem
from executive.mission.model.node_paths import get_type_name
from executive.mission.model.nodes import InnerNode, Node
from executive.mission.model.port_types import describe_type, find_element_type, is_assignable
from executive.mission.model.values import Literal, Reference
from executive.mission.model.wiring import Wire, find_control_node_outputs
from executive.mission.source import Span
from executive.skill import Direction


@dataclass(frozen=True)
class Writer:
    """An output that writes a variable.

    Attributes:
        name: Name in messages: `Localize.targets`, or the keyword of a control node.
        span: Position of the node.
        type: Type of the written values.
        refers_to: Kind of the written names, for example `bin` or `item`; "" if the output writes no names.
        values: Written constants with their positions; None if the values are unknown before the run.
    """

    name: str
    span: Span
    type: object
    refers_to: str
    values: tuple[tuple[object, Span], ...] | None = None

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

    def check_below(node: Node, loop_writers: WritersByVariable) -> Iterator[Finding]:
        for loop in _find_element_loops(node):
            list_writers = loop.find_list_writers({**skill_writers, **loop_writers})
            yield from loop.check_lists(list_writers)
            writers = [element for writer in list_writers for element in loop.make_element_writers(writer)]
            loop_writers = {**loop_writers, loop.variable: writers}
        for wire in context.find_wires(node, Direction.IN):
            for writer in loop_writers.get(wire.variable, skill_writers.get(wire.variable, ())):
                yield from _check_connection(context, wire, writer)
        for child in node.children:
            yield from check_below(child, loop_writers)

    yield from check_below(context.tree, {})


@dataclass(frozen=True)
class ElementLoop:
    """A control node that writes the elements of a list, one per iteration, to a variable.

    Attributes:
        keyword: Keyword of the control node.
        span: Position of the control node.
        variable: Name of the variable.
        key: Key of the control node for the list.
        elements: The list, or the variable that contains the list.
    """

    keyword: str
    span: Span
    variable: str
    key: str
    elements: Literal | Reference

    def find_list_writers(self, writers: WritersByVariable) -> Sequence[Writer]:
        """Return the writers of the list; the control node itself counts as the writer of a constant list."""
        if isinstance(self.elements, Literal):
            values = ((self.elements.value, self.elements.span),)
            return [Writer(self.keyword, self.span, list[Any], "", values)]
        return writers.get(self.elements.name, ())

    def check_lists(self, list_writers: Iterable[Writer]) -> Iterator[Finding]:
        """Yield an error for each writer that writes another value than a list to the variable `elements`."""
        if not isinstance(self.elements, Reference):
            return
        variable, span, key = self.elements.name, self.elements.span, f"{self.keyword}.{self.key}"
        for writer in list_writers:
            for value, value_span in writer.values or ():
                if not isinstance(value, list):
                    message = f"{key} takes a list, but ${variable} gets {describe_value(value)} here"
                    hint = f"{key} reads ${variable} in {span.describe_place(value_span.source)}."
                    yield make_error(value_span, "port-type", message, hint)
            if writer.values is None and find_element_type(writer.type) is None:
                message = f"{key} takes a list, but ${variable} holds {describe_type(writer.type)}"
                yield make_error(span, "port-type", message, f"It is written by {writer.describe(span)}.")

    def make_element_writers(self, list_writer: Writer) -> Iterator[Writer]:
        """Yield a writer of the elements of the list that `list_writer` writes: the control node."""
        if list_writer.values is not None:
            literal = self.elements if isinstance(self.elements, Literal) else None
            values = [
                (element, literal.get_element_span(index) if literal else span)
                for value, span in list_writer.values
                if isinstance(value, list)
                for index, element in enumerate(value)
            ]
            yield Writer(self.keyword, self.span, Any, "", tuple(values))
        elif (element_type := find_element_type(list_writer.type)) is not None:
            yield Writer(self.keyword, self.span, element_type, list_writer.refers_to)


def _find_element_loops(node: Node) -> Iterator[ElementLoop]:
    for key, variable in find_control_node_outputs(node):
        elements = node.values.get(key.list_key) if isinstance(node, InnerNode) else None
        if isinstance(elements, Literal | Reference):
            yield ElementLoop(get_type_name(node), node.span, variable.name, key.list_key, elements)


def _check_connection(context: CheckContext, wire: Wire, writer: Writer) -> Iterator[Finding]:
    """Yield an error for each value or type of a writer that does not fit the input `wire`."""
    port = wire.port
    port_type = f"the name of {_add_article(port.refers_to)}" if port.refers_to else describe_type(port.type)
    for value, span in writer.values or ():
        names = context.names_in_cell_by_kind.get(port.refers_to)
        if find_input_problem(value, port):
            message = f"{wire} takes {port_type}, but ${wire.variable} gets {describe_value(value)} here"
            hint = f"{wire} reads ${wire.variable} in {wire.span.describe_place(span.source)}."
            yield make_error(span, "port-type", message, hint)
        elif names is not None and isinstance(value, str) and value not in names:
            message = f'the cell has no {port.refers_to} "{value}" for {wire}'
            hint = suggest_choice(value, names, "Allowed names")
            yield make_error(span, f"unknown-{port.refers_to}", message, hint)
    if writer.values is not None:
        return
    if not is_assignable(writer.type, port.type):
        written_type = describe_type(writer.type)
    elif port.refers_to and writer.refers_to != port.refers_to:
        written_type = f"the name of {_add_article(writer.refers_to)}" if writer.refers_to else "any text"
    else:
        return
    message = f"{wire} takes {port_type}, but ${wire.variable} holds {written_type}"
    yield make_error(wire.span, "port-type", message, f"It is written by {writer.describe(wire.span)}.")


def _add_article(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"
