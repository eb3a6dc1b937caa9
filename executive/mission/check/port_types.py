"""Checks of what the variables hold: does what one writes fit what the other reads?"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from executive.mission.check.case import Case
from executive.mission.findings import Finding, alternatives, error
from executive.mission.model.nodes import InnerNode, Node
from executive.mission.model.paths import word_of
from executive.mission.model.port_types import describe_type, find_element_type, is_assignable
from executive.mission.model.typed import find_input_problem
from executive.mission.model.values import Literal, Reference
from executive.mission.model.wiring import Wire, find_written_variables
from executive.mission.source import Mark
from executive.mission.words import describe
from executive.skill import Direction, Port


@dataclass(frozen=True)
class Writer:
    """Something that writes a variable.

    Attributes:
        name: What it is called in a sentence, for instance `Localize.targets`.
        mark: Where it stands.
        type: Type of what it writes.
        refers: What a text names, or "".
        values: The values themselves, each with its place, where they stand in the file; else None.
    """

    name: str
    mark: Mark
    type: object
    refers: str
    values: tuple[tuple[object, Mark], ...] | None = None

    def describe_for(self, mark: Mark) -> str:
        """Return what it is and where, for who reads the file of `mark`."""
        return f"{self.name} in {self.mark.place(mark.source)}"


Loops = Mapping[str, Sequence[Writer]]
"""What the loops around a node write to their variables."""


def check_port_types(case: Case) -> Iterator[Finding]:
    """Find every input wired to a variable that may hold something else than it takes."""
    written: dict[str, list[Writer]] = {}
    for node in case.tree.walk():
        for wire in case.find_wires(node, Direction.OUT):
            writer = Writer(str(wire), node.mark, wire.port.type, wire.port.refers)
            written.setdefault(wire.variable, []).append(writer)

    def walk(node: Node, loops: Loops) -> Iterator[Finding]:
        for loop in _loops(node):
            sources = loop.sources({**written, **loops})
            yield from loop.no_lists(sources)
            loops = {**loops, loop.variable: [element for s in sources for element in loop.elements(s)]}
        for wire in case.find_wires(node, Direction.IN):
            for writer in loops.get(wire.variable, written.get(wire.variable, ())):
                yield from _misfits(case, wire, writer)
        for child in node.children:
            yield from walk(child, loops)

    yield from walk(case.tree, {})


@dataclass(frozen=True)
class ElementType:
    """A control node that writes the elements of a list to a variable.

    Attributes:
        keyword: Its keyword.
        key: Key of the list.
        source: The list, or the variable that holds it.
    """

    keyword: str
    mark: Mark
    variable: str
    key: str
    source: Literal | Reference

    def sources(self, writers: Loops) -> Sequence[Writer]:
        """Return the possible lists: the one in the file, or those written to the variable."""
        if isinstance(self.source, Literal):
            listed = self.source.value, self.source.mark
            return [Writer(self.keyword, self.mark, list[Any], "", (listed,))]
        return writers.get(self.source.name, ())

    def no_lists(self, sources: Iterable[Writer]) -> Iterator[Finding]:
        """Find every source that is no list; one in the file has a check of its own."""
        if not isinstance(self.source, Reference):
            return
        name, mark, what = self.source.name, self.source.mark, f"{self.keyword}.{self.key}"
        for source in sources:
            for value, place in source.values or ():
                if not isinstance(value, list):
                    message = f"{what} takes a list, but for ${name} stands {describe(value)} here"
                    yield error(place, "port-type", message, f"It is read in {mark.place(place.source)}.")
            if source.values is None and find_element_type(source.type) is None:
                message = f"{what} takes a list, but ${name} holds {describe_type(source.type)}"
                yield error(mark, "port-type", message, f"It is written by {source.describe_for(mark)}.")

    def elements(self, source: Writer) -> Iterator[Writer]:
        """Yield the writers of the variable for a list."""
        if source.values is not None:
            literal = self.source if isinstance(self.source, Literal) else None
            values = [
                (element, literal.element_mark(index) if literal else mark)
                for value, mark in source.values
                if isinstance(value, list)
                for index, element in enumerate(value)
            ]
            yield Writer(self.keyword, self.mark, Any, "", tuple(values))
        elif (element := find_element_type(source.type)) is not None:
            yield Writer(self.keyword, self.mark, element, source.refers)


def _loops(node: Node) -> Iterator[ElementType]:
    for key, variable in find_written_variables(node):
        source = node.values.get(key.list_key) if isinstance(node, InnerNode) else None
        if isinstance(source, Literal | Reference):
            yield ElementType(word_of(node), node.mark, variable.name, key.list_key, source)


def _misfits(case: Case, wire: Wire, writer: Writer) -> Iterator[Finding]:
    """Find what is wrong with wiring an input to what a writer writes."""
    port, wanted = wire.port, f"{wire} takes {_describe_accepted(wire.port)}"
    for value, mark in writer.values or ():
        known = case.names.get(port.refers)
        if find_input_problem(value, port):
            message = f"{wanted}, but for ${wire.variable} stands {describe(value)} here"
            yield error(mark, "port-type", message, f"It is read in {wire.mark.place(mark.source)}.")
        elif known is not None and isinstance(value, str) and value not in known:
            message = f'the cell has no {port.refers} "{value}" for {wire}'
            yield error(mark, f"unknown-{port.refers}", message, alternatives(value, known, f"{wire} takes"))
    if writer.values is not None:
        return
    holds = ""
    if not is_assignable(writer.type, port.type):
        holds = describe_type(writer.type)
    elif port.refers and writer.refers != port.refers:
        holds = f"the name of {_a(writer.refers)}" if writer.refers else "any text"
    if holds:
        message = f"{wanted}, but ${wire.variable} holds {holds}"
        yield error(wire.mark, "port-type", message, f"It is written by {writer.describe_for(wire.mark)}.")


def _describe_accepted(port: Port) -> str:
    return f"the name of {_a(port.refers)}" if port.refers else describe_type(port.type)


def _a(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"
