"""Checks of variables: written before they are read, and of types that fit their readers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Union, cast

from executive.cell.objects import Item
from executive.mission.analysis import CheckContext
from executive.mission.check_expressions import ReadVariable, StaticValue, check_expression, make_static
from executive.mission.check_skills import find_unknown_names
from executive.mission.mission_file import MissionParam
from executive.mission.ports import (
    Wire,
    describe_type,
    find_element_type,
    find_fields,
    find_problem,
    find_written_variables,
    is_assignable,
)
from executive.skill import Direction, Param, Port
from executive.text.findings import Finding, Span, describe_value, make_error, make_warning, suggest_choice
from executive.tree.keys import AnyValue, Key
from executive.tree.node import ControlNode
from executive.tree.specification import (
    Constant,
    Expression,
    Node,
    Reference,
    SkillNode,
    SubtreeNode,
    Value,
)


def find_unwritten_inputs(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every input in the mission file that may read an unwritten variable."""
    for read in _find_unwritten_reads(context, in_libraries=False):
        # In the expanded tree, a local variable of a subtree has the prefix `subtree.`.
        name_in_file = read.variable.rpartition(".")[2]
        if read.variable in context.written_variables:
            problem = "is not written on every path to this node"
            hint = f"${name_in_file} is written by {_describe_writers(context, read.variable, read.span)}."
        else:
            problem = "no node writes"
            hint = _make_unwritten_hint(context, read)
        message = f"{read} reads ${name_in_file}, which {problem}"
        yield make_error(read.span, "unwritten", message, hint)


def find_unwritten_library_inputs(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every use of a library subtree in which an input may read an unwritten variable."""
    inputs_by_use: dict[SubtreeNode, dict[str, str]] = {}
    for read in _find_unwritten_reads(context, in_libraries=True):
        use = context.library_uses_by_path[read.node.path]
        inputs_by_use.setdefault(use, {}).setdefault(read.variable, str(read))
    for use, inputs in inputs_by_use.items():
        names = " and ".join(f"${name} (for {input_name})" for name, input_name in sorted(inputs.items()))
        message = f'the subtree "{use.name}" needs variables that may be unwritten at this node: {names}'
        writers = [(name, _describe_writers(context, name, use.span)) for name in sorted(inputs)]
        hint = " ".join(f"${name} is written by {skills}." for name, skills in writers)
        yield make_error(use.span, "unwritten", message, hint)


def _find_unwritten_reads(context: CheckContext, in_libraries: bool) -> Iterator[Wire]:
    """Yield the reads of possibly unwritten variables, either in libraries or in the mission file."""
    mission_source = context.tree.span.source
    uses = context.library_uses_by_path
    for read in context.list_wires(context.tree, Direction.IN):
        state = context.flow_analysis.entry_states.get(read.node.path)
        if state and state.may_be_unwritten(read.variable) and (read.is_explicit or read.is_required):
            is_in_library = read.node.path in uses and read.span.source is not mission_source
            if is_in_library is in_libraries:
                yield read


def find_unread_variables(context: CheckContext) -> Iterator[Finding]:
    """Yield a warning for every variable that the mission assigns to an output by name, but no node reads."""
    read_variables = {read.variable for read in context.list_wires(context.tree, Direction.IN)}
    for node in context.tree.walk():
        for wire in context.wires[node, Direction.OUT]:
            # A control node that overwrites a param is an error, which the expansion reports.
            is_declared = isinstance(wire.port, Key) and not _is_loop_wire(wire)
            if is_declared and getattr(node, "declaration", None) is None:
                continue
            if wire.is_explicit and wire.variable not in read_variables | set(context.mission.params):
                message = f"{wire} writes ${wire.variable}, which no node reads"
                hint = f"Write ${wire.variable} where a node needs the value." if _is_loop_wire(wire) else ""
                yield make_warning(wire.span, "unread", message, hint)
        if not isinstance(node, SubtreeNode):
            continue
        for value in node.returns.values():
            name = value.name if isinstance(value, Reference) else ""
            if name in node.written_variables and name not in read_variables:
                message = f"the subtree returns ${name}, which no node reads"
                yield make_warning(value.span, "unread", message)


def find_overwritten_loop_variables(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every loop variable that another node writes: the loop deletes it when it ends."""
    wires = context.list_wires(context.tree, Direction.OUT)
    other_wires = {wire.variable: wire for wire in wires if not _is_loop_wire(wire)}

    def check_node_and_children(node: Node, loop_wires: Mapping[str, Wire]) -> Iterator[Finding]:
        for wire in filter(_is_loop_wire, context.wires[node, Direction.OUT]):
            if other := other_wires.get(wire.variable, loop_wires.get(wire.variable)):
                name = f"another {other}" if _is_loop_wire(other) else str(other)
                place = other.span.describe_place(wire.span.source)
                message = f"{wire} writes ${wire.variable}, and so does {name} in {place}"
                yield make_error(wire.span, "shadowed-variable", message, "Rename the loop variable.")
            loop_wires = {**loop_wires, wire.variable: wire}
        for child in node.children:
            yield from check_node_and_children(child, loop_wires)

    yield from check_node_and_children(context.tree, {})


def _is_loop_wire(wire: Wire) -> bool:
    """Return True if a loop writes its variable."""
    return isinstance(wire.port, Key) and bool(wire.port.list_key)


def find_unwritten_returns(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every variable in `returns` that may be unwritten when the subtree succeeds."""
    for use in context.tree.walk():
        if not isinstance(use, SubtreeNode) or use.body is None:
            continue
        subtree = context.mission.subtrees[use.name]
        end_state = context.flow_analysis.body_end_states.get(use.path)
        if end_state is None or end_state.written_variables is None:
            continue
        written = find_written_variables(use.body, context.skills)
        for name, variable in zip(subtree.returns or (), use.written_variables, strict=True):
            if variable not in written:
                problem = "no node of the subtree writes"
                names = sorted(full_name.rpartition(".")[2] for full_name in written)
                hint = suggest_choice(name, names, "Variables that the subtree writes")
            elif variable not in end_state.written_variables:
                problem = "is not written on every path"
                hint = f"${name} is written by {_describe_writers(context, variable, name.span)}."
            else:
                continue
            message = f'the subtree "{use.name}" returns ${name}, which {problem}'
            yield make_error(name.span, "unwritten", message, hint)


def _describe_writers(context: CheckContext, variable: str, span: Span) -> str:
    """Return the skills that write a variable, for a message at `span`: `Grasp in line 3`."""
    wires = [wire for node in context.nodes for wire in context.wires[node, Direction.OUT]]
    nodes = [wire.node for wire in wires if wire.variable == variable and isinstance(wire.node, SkillNode)]
    nodes.sort(key=lambda node: node.span.line)
    writers = dict.fromkeys(f"{node.skill} in {node.span.describe_place(span.source)}" for node in nodes)
    return " and ".join(writers) or context.list_skills_with_output(variable) or "a loop, in its body only"


def _make_unwritten_hint(context: CheckContext, read: Wire) -> str:
    """Return a hint for the read of a variable that no node of the tree writes."""
    variable = read.variable
    local_names = [name for name in context.written_variables if name.endswith(f".{variable}")]
    if local_names:
        subtree = min(name.rpartition(".")[0] for name in local_names)
        return f'The subtree "{subtree}" writes a local variable {variable}: add {variable} to its returns.'
    if skills := context.list_skills_with_output(variable):
        return f"Skills that write ${variable}: {skills}."
    if not read.is_explicit:
        return f"Set {read}."
    global_names = sorted(f"${name}" for name in context.written_variables if "." not in name)
    return suggest_choice(f"${variable}", global_names, "Variables that are written")


@dataclass(frozen=True)
class Writer:
    """An output that writes a variable.

    Attributes:
        name: Name in messages: `Localize.targets`, or the keyword of a control node.
        span: Position of the node.
        type: Type of the written values.
        refers_to: Kind of the written names, for example `bin` or `item`; "" if the output writes no names.
        constants: Written constants; None if the values are unknown before the run.
        declaration: Declaration of a variable that `set` writes; None for other writers.
    """

    name: str
    span: Span
    type: object
    refers_to: str
    constants: tuple[Constant, ...] | None = None
    declaration: Param | None = None

    def describe(self, span: Span) -> str:
        """Return name and position of the writer, for a message at `span`."""
        return f"{self.name} in {self.span.describe_place(span.source)}"


WritersByVariable = Mapping[str, Sequence[Writer]]
"""Outputs that write a variable, by the name of the variable."""


def check_port_types(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every input that does not accept all possible values of its variable."""
    skill_writers: dict[str, list[Writer]] = {}
    for wire in context.list_wires(context.tree, Direction.OUT):
        declared = getattr(wire.node, "declaration", None)
        if not isinstance(wire.port, Key):
            writer = Writer(str(wire), wire.node.span, wire.port.type, wire.port.refers_to)
            skill_writers.setdefault(wire.variable, []).append(writer)
        elif isinstance(declared, MissionParam):
            declaration = declared.declaration
            writer = Writer("variables", wire.span, declaration.type, "", declaration=declaration)
            skill_writers[wire.variable] = [*skill_writers.get(wire.variable, ()), writer]

    def check_node_and_children(node: Node, loop_writers: WritersByVariable) -> Iterator[Finding]:
        all_writers = {**skill_writers, **loop_writers}
        yield from _check_expressions(context, node, all_writers)
        for wire in context.wires[node, Direction.IN]:
            writers = list(_select_field(all_writers.get(wire.variable, ()), wire.field))
            yield from _check_field(str(wire), wire.reference, all_writers.get(wire.variable, ()))
            if wire.is_operand:
                continue
            if isinstance(wire.port, Key):
                yield from _check_lists(wire, writers)
                continue
            for writer in writers:
                yield from _check_connection(context, wire, wire.port, writer)
        for wire in filter(_is_loop_wire, context.wires[node, Direction.OUT]):
            if isinstance(node, ControlNode) and isinstance(wire.port, Key):
                elements = node.settings.get(wire.port.list_key)
                list_writers = _find_list_writers(node, elements, all_writers)
                loop_writers = {**loop_writers, wire.variable: [*_make_element_writers(node, list_writers)]}
        for child in node.children:
            yield from check_node_and_children(child, loop_writers)

    yield from check_node_and_children(context.tree, {})


def _check_expressions(context: CheckContext, node: Node, writers: WritersByVariable) -> Iterator[Finding]:
    """Yield the mistakes in the expressions of a node, and in a value that it assigns to a variable."""

    def read(variable: str) -> list[StaticValue]:
        return [_make_static(writer) for writer in writers.get(variable, ())]

    if isinstance(node, SkillNode):
        skill = context.skills.get(node.skill)
        declarations: dict[str, Param | Port] = {**skill.params, **skill.ports} if skill else {}
        for name, value in node.settings.items():
            is_output = getattr(declarations.get(name), "direction", None) is Direction.OUT
            if isinstance(value, Expression) and name in declarations and not is_output:
                yield from check_expression(context, f"{node.skill}.{name}", declarations[name], value, read)
        return
    for wire in context.wires[node, Direction.OUT]:
        if isinstance(wire.port, Key) and not _is_loop_wire(wire):
            yield from _check_assignment(context, wire, writers, read)
    for key, items in node.list_values() if isinstance(node, ControlNode) else ():
        for item in items if isinstance(items, tuple) else (items,):
            if isinstance(item, Expression) and key.value_type != AnyValue:
                yield from check_expression(context, f"{node.type_name}.{key.name}", key, item, read)


def _check_assignment(
    context: CheckContext, wire: Wire, writers: WritersByVariable, read: ReadVariable
) -> Iterator[Finding]:
    """Yield an error if `set` names no declared variable, or its value does not fit the declaration."""
    node = cast("ControlNode", wire.node)
    name = wire.variable.rpartition(".")[2]
    declared = [one for one in writers.get(wire.variable, ()) if one.declaration]
    others = [one for one in writers.get(wire.variable, ()) if not one.declaration]
    if getattr(node, "declaration", None) is not None:
        for other in others:
            message = f"{other.describe(wire.span)} writes ${name}, so `variables` cannot use this name"
            yield make_error(wire.span, "shadowed-variable", message, "Rename the variable.")
        return
    if not declared:
        names = [
            known.rpartition(".")[2] for known, all_writers in writers.items() if all_writers[0].declaration
        ]
        hint = suggest_choice(name, names, "Variables") if names else "Declare it in variables: {NAME: 0}."
        yield make_error(wire.span, "unknown-variable", f"the mission declares no variable {name}", hint)
        return
    declaration = cast("Param", declared[0].declaration)
    value = node.settings.get("to")
    if isinstance(value, Reference):
        value = Expression("value", (value,), value.span)
    if isinstance(value, Expression):
        yield from check_expression(context, f"${name}", declaration, value, read)
    elif isinstance(value, Constant) and (problem := find_problem(value.value, declaration)):
        yield make_error(value.span, problem.code, f"${name} {problem}{value.origin_note}")


def _make_static(writer: Writer) -> StaticValue:
    """Return what is known about the values of a writer."""
    if writer.declaration is not None:
        return make_static(writer.declaration)
    if writer.constants is None:
        return StaticValue(writer.type, writer.refers_to)
    values = [constant.value for constant in writer.constants]
    types = tuple({type(value) for value in values})
    numbers = [float(value) for value in values if isinstance(value, int | float)]
    bounds = (min(numbers), max(numbers)) if len(numbers) == len(values) > 0 else (-math.inf, math.inf)
    return StaticValue(Union[types] if types else Any, "", None, *bounds)  # noqa: UP007


def _find_list_writers(node: Node, elements: Value | None, writers: WritersByVariable) -> list[Writer]:
    """Return the writers of a list; a node with a constant list counts as the writer of the list."""
    if isinstance(elements, Reference):
        return list(_select_field(writers.get(elements.name, ()), elements.field))
    if not isinstance(elements, Constant):
        return []
    if elements.value == "items":
        return [Writer(node.type_name, node.span, list[Item], "item")]
    return [Writer(node.type_name, node.span, list[Any], "", (elements,))]


def _check_lists(wire: Wire, list_writers: Iterable[Writer]) -> Iterator[Finding]:
    """Yield an error for each writer that writes no list, but a control node iterates over the variable."""
    name = f"{wire}.{wire.port.name}"
    reference = wire.reference
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
                Constant(element, constant.get_element_span(index))
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
            yield replace(writer, type=found.type, refers_to=found.refers_to)


def _check_connection(
    context: CheckContext, wire: Wire, port: Port | Param, writer: Writer
) -> Iterator[Finding]:
    """Yield an error for each value or type of a writer that does not fit the input `port` of `wire`."""
    choices = (port.choices or ()) if isinstance(port, Param) else ()
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
            yield from find_unknown_names(context, wire.node.type_name, port, constant)
    if writer.constants is not None:
        return
    is_type_accepted = is_assignable(writer.type, port.type)
    declared_choices = (writer.declaration.choices if writer.declaration else None) or ()
    if is_type_accepted and declared_choices and port.refers_to:
        for choice in declared_choices:
            yield from find_unknown_names(context, wire.node.type_name, port, Constant(choice, wire.span))
        return
    if is_type_accepted and declared_choices and {*declared_choices} <= {*choices}:
        return
    if is_type_accepted and (writer.refers_to == port.refers_to if port.refers_to else not choices):
        return
    is_any_text = is_type_accepted and not writer.refers_to
    written_type = "any text" if is_any_text else describe_values(writer.type, writer.refers_to)
    message = f"{wire} takes {port_type}, but {wire.reference} holds {written_type}"
    hint = f"${wire.reference.local_name} is written by {writer.describe(wire.span)}."
    yield make_error(wire.span, "port-type", message, hint)


def describe_values(declared_type: object, refers_to: str) -> str:
    """Return a description of the values of a type; strings are names of the kind `refers_to`, if any."""
    if not refers_to:
        return describe_type(declared_type)
    is_list = not is_assignable(str, declared_type)
    article = "an" if refers_to[0] in "aeiou" else "a"
    return f"a list of names of {refers_to}s" if is_list else f"the name of {article} {refers_to}"
