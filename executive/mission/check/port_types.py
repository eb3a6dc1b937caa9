"""Checks of what the variables hold: does what one writes fit what the other reads?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from executive.mission.check.case import Case
from executive.mission.findings import Finding, error
from executive.mission.model.nodes import ForEachNode
from executive.mission.model.port_types import called, element_of, fits
from executive.mission.model.typed import WrongType, convert, takes_values
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


def port_types(case: Case) -> Iterator[Finding]:
    """Find every input wired to a variable that may hold something else than it takes."""
    if case.tree is None:
        return
    writers = _writers(case)
    for node in case.tree.walk():
        if isinstance(node, ForEachNode) and isinstance(node.source, Reference):
            for writer in writers.get(node.source.name, ()):
                if element_of(writer.type) is None:
                    message = f"for_each.in takes a list, but ${node.source.name} holds {called(writer.type)}"
                    hint = f"It is written by {writer.seen_from(node.source.mark)}."
                    yield error(node.source.mark, "port-type", message, hint)
        for wire in case.wires(node, Direction.IN):
            for writer in writers.get(wire.variable, ()):
                yield from _misfits(wire, writer)


def element_names(case: Case) -> Iterator[Finding]:
    """Find every element of a list in the file that names something the cell does not have."""
    if case.tree is None or case.cell is None:
        return
    known = {"bin": list(case.cell.bins), "class": list(case.cell.objects)}
    readers = _readers(case)
    for node in case.tree.walk():
        if not isinstance(node, ForEachNode) or not isinstance(node.source, Literal):
            continue
        for port, reader, _ in readers.get(node.each.name, ()):
            for index, value in enumerate(node.source.value if isinstance(node.source.value, list) else ()):
                names = known.get(port.refers)
                if names is not None and isinstance(value, str) and value not in names:
                    message = f'the cell has no {port.refers} "{value}" for {reader}'
                    hint = f"{reader} takes: {', '.join(names)}."
                    yield error(node.source.element_mark(index), f"unknown-{port.refers}", message, hint)


def _misfits(wire: Wire, writer: Writer) -> Iterator[Finding]:
    """Find what is wrong with wiring an input to what a writer writes."""
    port, wanted = wire.port, f"{wire} takes {_wanted(wire.port)}"
    for value, mark in writer.values or ():
        if not _is_taken(value, port):
            message = f"{wanted}, but for ${wire.variable} stands {describe(value)} here"
            yield error(mark, "port-type", message, f"It is read in {wire.mark.place(mark.source)}.")
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


def _is_taken(value: Any, port: Port) -> bool:
    try:
        return takes_values(port) and convert(value, port.type) is not ...
    except WrongType:
        return False


def _wanted(port: Port) -> str:
    return f"the name of {_a(port.refers)}" if port.refers else called(port.type)


def _a(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"


def _writers(case: Case) -> dict[str, list[Writer]]:
    writers: dict[str, list[Writer]] = {}
    loops = []
    for node in case.tree.walk() if case.tree else ():
        if isinstance(node, ForEachNode):
            loops.append(node)
        for wire in case.wires(node, Direction.OUT):
            writer = Writer(str(wire), node.mark, wire.port.type, wire.port.refers)
            writers.setdefault(wire.variable, []).append(writer)
    for loop in loops:
        writers.setdefault(loop.each.name, []).extend(_elements(loop, writers))
    return writers


def _elements(loop: ForEachNode, writers: dict[str, list[Writer]]) -> list[Writer]:
    """Return what a loop writes to its variable."""
    if isinstance(loop.source, Literal):
        values = loop.source.value
        if not isinstance(values, list):
            return []
        marked = [(value, loop.source.element_mark(index)) for index, value in enumerate(values)]
        return [Writer("for_each", loop.mark, Any, "", tuple(marked))]
    return [
        Writer("for_each", loop.mark, element_of(writer.type), writer.refers)
        for writer in writers.get(loop.source.name, ())
        if element_of(writer.type) is not None
    ]


def _readers(case: Case) -> dict[str, list[tuple[Port, str, Mark]]]:
    readers: dict[str, list[tuple[Port, str, Mark]]] = {}
    for node in case.tree.walk() if case.tree else ():
        for wire in case.wires(node, Direction.IN):
            readers.setdefault(wire.variable, []).append((wire.port, str(wire), wire.mark))
    return readers
