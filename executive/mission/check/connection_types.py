"""Checks that the types of the values of variables fit the inputs that read the variables."""

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
from executive.skill import Direction, Port


@dataclass(frozen=True)
class Writer:
    """An output that writes a variable.

    Attributes:
        name: Name in messages: `Localize.targets`, or the keyword of a control node.
        span: Position of the node.
        type: Type of the written values.
        refers: What the written texts name, as `bin` or `item`; "" if they are no names.
        values: Written values with their positions, if they are constants in the file; otherwise None.
    """

    name: str
    span: Span
    type: object
    refers: str
    values: tuple[tuple[object, Span], ...] | None = None

    def describe_for(self, span: Span) -> str:
        """Return name and position of the writer, for a message at `span`."""
        return f"{self.name} in {self.span.describe_place(span.source)}"


WritersByVariable = Mapping[str, Sequence[Writer]]


def check_port_types(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every input whose variable may have a value that does not fit the input."""
    skill_writers: dict[str, list[Writer]] = {}
    for node in context.tree.walk():
        for wire in context.find_wires(node, Direction.OUT):
            writer = Writer(str(wire), node.span, wire.port.type, wire.port.refers)
            skill_writers.setdefault(wire.variable, []).append(writer)

    def walk(node: Node, loop_writers: WritersByVariable) -> Iterator[Finding]:
        for loop in _find_element_loops(node):
            list_writers = loop.find_list_writers({**skill_writers, **loop_writers})
            yield from loop.check_lists(list_writers)
            elements = [element for writer in list_writers for element in loop.make_element_writers(writer)]
            loop_writers = {**loop_writers, loop.variable: elements}
        for wire in context.find_wires(node, Direction.IN):
            for writer in loop_writers.get(wire.variable, skill_writers.get(wire.variable, ())):
                yield from _check_connection(context, wire, writer)
        for child in node.children:
            yield from walk(child, loop_writers)

    yield from walk(context.tree, {})


@dataclass(frozen=True)
class ElementLoop:
    """A control node that writes the elements of a list, one per iteration, to a variable.

    Attributes:
        keyword: Keyword of the control node.
        span: Position of the control node.
        variable: Name of the variable.
        key: Key that gives the list.
        source: The list, or the variable that contains the list.
    """

    keyword: str
    span: Span
    variable: str
    key: str
    source: Literal | Reference

    def find_list_writers(self, writers: WritersByVariable) -> Sequence[Writer]:
        """Return the writers of the list; a list in the file has the control node itself as writer."""
        if isinstance(self.source, Literal):
            located_list = self.source.value, self.source.span
            return [Writer(self.keyword, self.span, list[Any], "", (located_list,))]
        return writers.get(self.source.name, ())

    def check_lists(self, list_writers: Iterable[Writer]) -> Iterator[Finding]:
        """Yield an error for each writer that does not write a list to the variable `source`."""
        if not isinstance(self.source, Reference):
            return
        variable, span, key = self.source.name, self.source.span, f"{self.keyword}.{self.key}"
        for writer in list_writers:
            for value, value_span in writer.values or ():
                if not isinstance(value, list):
                    message = f"{key} takes a list, but ${variable} gets {describe_value(value)} here"
                    hint = f"{key} reads ${variable} in {span.describe_place(value_span.source)}."
                    yield make_error(value_span, "port-type", message, hint)
            if writer.values is None and find_element_type(writer.type) is None:
                message = f"{key} takes a list, but ${variable} holds {describe_type(writer.type)}"
                yield make_error(span, "port-type", message, f"It is written by {writer.describe_for(span)}.")

    def make_element_writers(self, list_writer: Writer) -> Iterator[Writer]:
        """Yield the loop as the writer of the elements of a list."""
        if list_writer.values is not None:
            literal = self.source if isinstance(self.source, Literal) else None
            values = [
                (element, literal.get_element_span(index) if literal else span)
                for value, span in list_writer.values
                if isinstance(value, list)
                for index, element in enumerate(value)
            ]
            yield Writer(self.keyword, self.span, Any, "", tuple(values))
        elif (element_type := find_element_type(list_writer.type)) is not None:
            yield Writer(self.keyword, self.span, element_type, list_writer.refers)


def _find_element_loops(node: Node) -> Iterator[ElementLoop]:
    for key, variable in find_control_node_outputs(node):
        source = node.values.get(key.list_key) if isinstance(node, InnerNode) else None
        if isinstance(source, Literal | Reference):
            yield ElementLoop(get_type_name(node), node.span, variable.name, key.list_key, source)


def _check_connection(context: CheckContext, wire: Wire, writer: Writer) -> Iterator[Finding]:
    """Yield an error for each value or type of a writer that does not fit the input `wire`."""
    port, accepted = wire.port, f"{wire} takes {_describe_accepted_type(wire.port)}"
    for value, span in writer.values or ():
        names = context.cell_names_by_kind.get(port.refers)
        if find_input_problem(value, port):
            message = f"{accepted}, but ${wire.variable} gets {describe_value(value)} here"
            hint = f"{wire} reads ${wire.variable} in {wire.span.describe_place(span.source)}."
            yield make_error(span, "port-type", message, hint)
        elif names is not None and isinstance(value, str) and value not in names:
            message = f'the cell has no {port.refers} "{value}" for {wire}'
            hint = suggest_choice(value, names, "Allowed names")
            yield make_error(span, f"unknown-{port.refers}", message, hint)
    if writer.values is not None:
        return
    actual = ""
    if not is_assignable(writer.type, port.type):
        actual = describe_type(writer.type)
    elif port.refers and writer.refers != port.refers:
        actual = f"the name of {_add_article(writer.refers)}" if writer.refers else "any text"
    if actual:
        message = f"{accepted}, but ${wire.variable} holds {actual}"
        hint = f"It is written by {writer.describe_for(wire.span)}."
        yield make_error(wire.span, "port-type", message, hint)


def _describe_accepted_type(port: Port) -> str:
    return f"the name of {_add_article(port.refers)}" if port.refers else describe_type(port.type)


def _add_article(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"
