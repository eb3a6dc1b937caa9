"""Checks of what the variables hold: does what one writes fit what the other reads?"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from executive.mission.check.case import Case
from executive.mission.findings import Finding, alternatives, error
from executive.mission.model.nodes import ForEachNode, Node
from executive.mission.model.port_types import called, element_of, fits
from executive.mission.model.typed import input_fault
from executive.mission.model.values import Literal, Reference
from executive.mission.model.wiring import Wire
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
    type: Any
    refers: str
    values: tuple[tuple[Any, Mark], ...] | None = None

    def seen_from(self, mark: Mark) -> str:
        """Return what it is and where, for who reads the file of `mark`."""
        return f"{self.name} in {self.mark.place(mark.source)}"


Loops = Mapping[str, Sequence[Writer]]
"""What the loops around a node write to their variables."""


def port_types(case: Case) -> Iterator[Finding]:
    """Find every input wired to a variable that may hold something else than it takes."""
    written: dict[str, list[Writer]] = {}
    for node in case.tree.walk():
        for wire in case.wires(node, Direction.OUT):
            writer = Writer(str(wire), node.mark, wire.port.type, wire.port.refers)
            written.setdefault(wire.variable, []).append(writer)

    def walk(node: Node, loops: Loops) -> Iterator[Finding]:
        if isinstance(node, ForEachNode):
            sources = _sources(node, {**written, **loops})
            yield from _no_lists(node, sources)
            loops = {**loops, node.each.name: [element for s in sources for element in _elements(node, s)]}
        for wire in case.wires(node, Direction.IN):
            for writer in loops.get(wire.variable, written.get(wire.variable, ())):
                yield from _misfits(case, wire, writer)
        for child in node.children:
            yield from walk(child, loops)

    yield from walk(case.tree, {})


def _sources(loop: ForEachNode, writers: Loops) -> Sequence[Writer]:
    """Return what a loop's list may be: the one in the file, or what writes its variable."""
    if isinstance(loop.source, Literal):
        listed = loop.source.value, loop.source.mark
        return [Writer("for_each", loop.mark, list[Any], "", (listed,))]
    return writers.get(loop.source.name, ())


def _no_lists(loop: ForEachNode, sources: Iterable[Writer]) -> Iterator[Finding]:
    """Find whatever a loop goes through and is no list; one in the file has a check of its own."""
    if not isinstance(loop.source, Reference):
        return
    name, mark = loop.source.name, loop.source.mark
    for source in sources:
        for value, place in source.values or ():
            if not isinstance(value, list):
                message = f"for_each.in takes a list, but for ${name} stands {describe(value)} here"
                yield error(place, "port-type", message, f"It is read in {mark.place(place.source)}.")
        if source.values is None and element_of(source.type) is None:
            message = f"for_each.in takes a list, but ${name} holds {called(source.type)}"
            yield error(mark, "port-type", message, f"It is written by {source.seen_from(mark)}.")


def _elements(loop: ForEachNode, source: Writer) -> Iterator[Writer]:
    """Yield what a loop writes to its variable when it goes through such a list."""
    if source.values is not None:
        literal = loop.source if isinstance(loop.source, Literal) else None
        values = [
            (element, literal.element_mark(index) if literal else mark)
            for value, mark in source.values
            if isinstance(value, list)
            for index, element in enumerate(value)
        ]
        yield Writer("for_each", loop.mark, Any, "", tuple(values))
    elif (element := element_of(source.type)) is not None:
        yield Writer("for_each", loop.mark, element, source.refers)


def _misfits(case: Case, wire: Wire, writer: Writer) -> Iterator[Finding]:
    """Find what is wrong with wiring an input to what a writer writes."""
    port, wanted = wire.port, f"{wire} takes {_wanted(wire.port)}"
    for value, mark in writer.values or ():
        known = case.names.get(port.refers)
        if input_fault(value, port):
            message = f"{wanted}, but for ${wire.variable} stands {describe(value)} here"
            yield error(mark, "port-type", message, f"It is read in {wire.mark.place(mark.source)}.")
        elif known is not None and isinstance(value, str) and value not in known:
            message = f'the cell has no {port.refers} "{value}" for {wire}'
            yield error(mark, f"unknown-{port.refers}", message, alternatives(value, known, f"{wire} takes"))
    if writer.values is not None:
        return
    holds = ""
    if not fits(writer.type, port.type):
        holds = called(writer.type)
    elif port.refers and writer.refers != port.refers:
        holds = f"the name of {_a(writer.refers)}" if writer.refers else "any text"
    if holds:
        message = f"{wanted}, but ${wire.variable} holds {holds}"
        yield error(wire.mark, "port-type", message, f"It is written by {writer.seen_from(wire.mark)}.")


def _wanted(port: Port) -> str:
    return f"the name of {_a(port.refers)}" if port.refers else called(port.type)


def _a(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"
