"""Checks that each variable is written before it is read, and read after it is written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from executive.mission.check.context import CheckContext, VariableRead
from executive.mission.findings import Finding, make_error, make_warning, suggest_choice
from executive.mission.model.nodes import Node, SubtreeNode
from executive.mission.model.values import Reference
from executive.mission.model.wiring import find_control_node_outputs, find_written_variables
from executive.mission.source import Span
from executive.skill import Direction


def find_unwritten_inputs(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every input in the mission file that may read an unwritten variable."""
    for read in _find_unwritten_reads(context, in_libraries=False):
        # In the expanded tree, a local variable of a subtree has the prefix `subtree.`.
        name_in_file = read.variable.rpartition(".")[2]
        if read.variable in context.written_variables:
            problem = "is not written on every path to this node"
            hint = f"${name_in_file} is written by {_describe_writers(context, read.variable, read.span)}."
        else:
            problem, hint = "no node writes", _make_unwritten_hint(context, read)
        message = f"{read.input_name} reads ${name_in_file}, which {problem}"
        yield make_error(read.span, "unwritten", message, hint)


def find_unwritten_library_inputs(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every use of a library subtree in which an input may read an unwritten variable."""
    inputs_by_use: dict[str, dict[str, str]] = {}
    for read in _find_unwritten_reads(context, in_libraries=True):
        path = context.library_uses_by_path[read.node.path].path
        inputs_by_use.setdefault(path, {}).setdefault(read.variable, read.input_name)
    uses = {use.path: use for use in context.library_uses_by_path.values()}
    for path, inputs in inputs_by_use.items():
        use = uses[path]
        names = " and ".join(f"${name} (for {input_name})" for name, input_name in sorted(inputs.items()))
        message = f'the subtree "{use.name}" needs variables that may be unwritten at this node: {names}'
        hints = [
            f"${name} is written by {_describe_writers(context, name, use.span)}." for name in sorted(inputs)
        ]
        yield make_error(use.span, "unwritten", message, " ".join(hints))


def _find_unwritten_reads(context: CheckContext, in_libraries: bool) -> Iterator[VariableRead]:
    """Yield the reads of possibly unwritten variables, either in libraries or in the mission file."""
    mission_source, uses = context.tree.span.source, context.library_uses_by_path
    for read in context.iterate_reads(context.tree):
        state = context.flow_analysis.entry_states.get(read.node.path)
        if state and state.may_be_unwritten(read.variable) and (read.is_explicit or read.is_required):
            is_in_library = read.node.path in uses and read.span.source is not mission_source
            if is_in_library is in_libraries:
                yield read


def find_unread_variables(context: CheckContext) -> Iterator[Finding]:
    """Yield a warning for every variable that the mission assigns to an output by name, but no node reads."""
    read_variables = {read.variable for read in context.iterate_reads(context.tree)}
    for node in context.tree.walk():
        for _, variable in find_control_node_outputs(node):
            if variable.name not in read_variables | set(context.mission.params):
                message = f"no node in this {node.type_name} reads ${variable.name}"
                hint = f"Write ${variable.name} where a node needs the value."
                yield make_warning(variable.span, "unread", message, hint)
        for wire in context.find_wires(node, Direction.OUT):
            if wire.is_explicit and wire.variable not in read_variables:
                message = f"{wire} writes ${wire.variable}, which no node reads"
                yield make_warning(wire.span, "unread", message)
        if not isinstance(node, SubtreeNode):
            continue
        for setting in node.returns.values():
            name = setting.value.name if isinstance(setting.value, Reference) else ""
            if name in node.written_variables and name not in read_variables:
                message = f"the subtree returns ${name}, which no node reads"
                yield make_warning(setting.value.span, "unread", message)


def find_overwritten_loop_variables(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every loop variable that another node writes: the loop deletes it when it ends."""
    wires = [wire for node in context.tree.walk() for wire in context.find_wires(node, Direction.OUT)]
    skill_writes = {wire.variable: (str(wire), wire.span) for wire in wires}

    def check_node_and_children(node: Node, loop_writes: Mapping[str, tuple[str, Span]]) -> Iterator[Finding]:
        for _, variable in find_control_node_outputs(node):
            if write := skill_writes.get(variable.name, loop_writes.get(variable.name)):
                name, span = write
                place = span.describe_place(variable.span.source)
                message = f"{node.type_name} writes ${variable.name}, and so does {name} in {place}"
                yield make_error(variable.span, "shadowed-variable", message, "Rename the loop variable.")
            loop_writes = {**loop_writes, variable.name: (f"another {node.type_name}", variable.span)}
        for child in node.children:
            yield from check_node_and_children(child, loop_writes)

    yield from check_node_and_children(context.tree, {})


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
        returns = (subtree.returns or {}).items()
        for (name, span), variable in zip(returns, use.written_variables, strict=True):
            if variable not in written:
                problem = "no node of the subtree writes"
                names = sorted(full_name.rpartition(".")[2] for full_name in written)
                hint = suggest_choice(name, names, "Variables that the subtree writes")
            elif variable not in end_state.written_variables:
                problem = "is not written on every path"
                hint = f"${name} is written by {_describe_writers(context, variable, span)}."
            else:
                continue
            message = f'the subtree "{use.name}" returns ${name}, which {problem}'
            yield make_error(span, "unwritten", message, hint)


def _describe_writers(context: CheckContext, variable: str, span: Span) -> str:
    """Return the skills that write a variable, for a message at `span`: `Grasp in line 3`."""
    wires = [
        (node, wire) for node in context.iterate_nodes() for wire in context.find_wires(node, Direction.OUT)
    ]
    nodes = [(node.span, wire.skill) for node, wire in wires if wire.variable == variable]
    nodes.sort(key=lambda node: node[0].line)
    writers = dict.fromkeys(f"{skill} in {place.describe_place(span.source)}" for place, skill in nodes)
    return " and ".join(writers) or list_skills_with_output(context, variable) or "a loop, in its body only"


def _make_unwritten_hint(context: CheckContext, read: VariableRead) -> str:
    """Return a hint for the read of a variable that no node of the tree writes."""
    variable = read.variable
    local_names = [name for name in context.written_variables if name.endswith(f".{variable}")]
    if local_names:
        subtree = min(name.rpartition(".")[0] for name in local_names)
        return f'The subtree "{subtree}" writes a local variable {variable}: add {variable} to its returns.'
    if skills := list_skills_with_output(context, variable):
        return f"Skills that write ${variable}: {skills}."
    if not read.is_explicit:
        return f"Set {read.input_name}."
    global_names = sorted(f"${name}" for name in context.written_variables if "." not in name)
    return suggest_choice(f"${variable}", global_names, "Variables that are written")


def list_skills_with_output(context: CheckContext, name: str) -> str:
    """Return the names of the skills that have an output `name`, separated by commas."""
    outputs = {skill: context.skills[skill].ports.get(name) for skill in context.skills}
    return ", ".join(skill for skill, port in outputs.items() if port and port.direction is Direction.OUT)
