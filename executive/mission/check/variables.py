"""Checks that each variable is written before it is read, and read after it is written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from executive.mission.check.context import CheckContext
from executive.mission.findings import Finding, find_similar_word, make_error, make_warning, suggest_choice
from executive.mission.model.node_paths import get_type_name
from executive.mission.model.nodes import Node, UseNode
from executive.mission.model.values import LocatedName, Reference
from executive.mission.model.wiring import (
    find_control_node_inputs,
    find_control_node_outputs,
    find_wires,
    find_written_variables,
)
from executive.mission.source import Span
from executive.skill import Direction, Skill

Input = tuple[Node, str, str, Span]
"""Node that reads, name of the input (`Approach.target`), name of the variable, and its position."""


def find_unwritten_inputs(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every input in the mission file that may read an unwritten variable."""
    for _, input_name, variable, span in _find_unwritten(context, in_libraries=False):
        # In the expanded tree, a local variable of a subtree has the prefix `subtree.`.
        name_in_file = variable.rpartition(".")[2]
        message = f"{input_name} reads ${name_in_file}, which"
        if variable in context.written_variables:
            hint = f"It is written by {_describe_writers(context, variable, span)}."
            yield make_error(span, "unwritten", f"{message} is not written on every path to this node", hint)
        else:
            hint = _make_unwritten_hint(context, variable)
            yield make_error(span, "unwritten", f"{message} no node writes", hint)


def find_unwritten_library_inputs(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every use of a library in which inputs may read unwritten variables."""
    inputs_by_use: dict[str, dict[str, str]] = {}
    for node, input_name, variable, _ in _find_unwritten(context, in_libraries=True):
        path = context.library_uses_by_path[node.path].path
        inputs_by_use.setdefault(path, {}).setdefault(variable, input_name)
    uses = {use.path: use for use in context.library_uses_by_path.values()}
    for path, inputs in inputs_by_use.items():
        use = uses[path]
        names = " and ".join(f"${name} (for {reader})" for name, reader in sorted(inputs.items()))
        message = f'the subtree "{use.name}" needs variables that may be unwritten at this node: {names}'
        hints = [
            f"${name} is written by {_suggest_writers(context, name, use.span)}." for name in sorted(inputs)
        ]
        yield make_error(use.span, "unwritten", message, " ".join(hints))


def _find_unwritten(context: CheckContext, in_libraries: bool) -> Iterator[Input]:
    """Yield the inputs that may read an unwritten variable, either in libraries or in the mission file."""
    mission_source = context.tree.span.source
    for node, input_name, variable, span in _iterate_inputs(context, context.tree):
        state = context.flow_analysis.entry_states.get(node.path)
        if state is None or state.written_variables is None or variable in state.written_variables:
            continue
        is_in_library = node.path in context.library_uses_by_path and span.source is not mission_source
        if is_in_library is in_libraries:
            yield node, input_name, variable, span


def find_unread_variables(context: CheckContext) -> Iterator[Finding]:
    """Yield a warning for every variable that the mission names for an output and no node reads."""
    read = {variable for _, _, variable, _ in _iterate_inputs(context, context.tree, with_optional=True)}
    for node in context.tree.walk():
        for _, variable in find_control_node_outputs(node):
            if variable.name not in read | set(context.mission.params):
                message = f"no node in this {get_type_name(node)} reads ${variable.name}"
                hint = f"Write ${variable.name} where a node needs the value."
                yield make_warning(variable.span, "unread", message, hint)
        for wire in context.find_wires(node, Direction.OUT):
            if wire.is_explicit and wire.variable not in read:
                message = f"{wire} writes ${wire.variable}, which no node reads"
                yield make_warning(wire.span, "unread", message)
        if not isinstance(node, UseNode):
            continue
        for setting in node.returns.values():
            name = setting.value.name if isinstance(setting.value, Reference) else ""
            if name in node.returned_variables and name not in read:
                message = f"the subtree returns ${name}, which no node reads"
                yield make_warning(setting.value.span, "unread", message)


def find_overwritten_loop_variables(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every loop variable that another node writes; the loop deletes it at its end."""
    wires = [wire for node in context.tree.walk() for wire in context.find_wires(node, Direction.OUT)]
    writers = {wire.variable: wire for wire in wires}

    def walk(node: Node, outer_variables: Mapping[str, LocatedName]) -> Iterator[Finding]:
        for _, loop_variable in find_control_node_outputs(node):
            name = loop_variable.name
            skill_writer, outer = writers.get(name), outer_variables.get(name)
            other_span = skill_writer.span if skill_writer else outer.span if outer else None
            if other_span is not None:
                keyword = get_type_name(node)
                place = other_span.describe_place(loop_variable.span.source)
                other = f"{skill_writer or f'another {keyword}'} in {place}"
                message, hint = f"{keyword} writes ${name}, and so does {other}", "Rename the loop variable."
                yield make_error(loop_variable.span, "shadowed-variable", message, hint)
            outer_variables = {**outer_variables, name: loop_variable}
        for child in node.children:
            yield from walk(child, outer_variables)

    yield from walk(context.tree, {})


def find_unwritten_returns(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every variable below `returns` that the subtree may not write before it succeeds."""
    for use in context.tree.walk():
        if not isinstance(use, UseNode) or use.body is None:
            continue
        subtree = context.mission.subtrees[use.name]
        end_state = context.flow_analysis.body_end_states.get(use.path)
        if end_state is None or end_state.written_variables is None:
            continue
        written = find_written_variables(use.body, context.skills)
        returns = (subtree.returns or {}).items()
        for (name, span), variable in zip(returns, use.returned_variables, strict=True):
            message = f'the subtree "{use.name}" returns ${name}, which'
            if variable not in written:
                names = sorted(each.rpartition(".")[2] for each in written)
                hint = suggest_choice(name, names, "Variables that it writes")
                yield make_error(span, "unwritten", f"{message} no node in it writes", hint)
            elif variable not in end_state.written_variables:
                hint = f"It is written by {_describe_writers(context, variable, span)}."
                yield make_error(span, "unwritten", f"{message} it does not write on every path", hint)


def _iterate_inputs(context: CheckContext, tree: Node, with_optional: bool = False) -> Iterator[Input]:
    """Yield every input that is required or names its variable; `with_optional`: also the other inputs."""
    for node in tree.walk():
        for reference in find_control_node_inputs(node):
            yield node, get_type_name(node), reference.name, reference.span
        for wire in context.find_wires(node, Direction.IN):
            if with_optional or wire.port.is_required or wire.is_explicit:
                yield node, str(wire), wire.variable, wire.span


def _describe_writers(context: CheckContext, variable: str, span: Span) -> str:
    """Return the skills that write a variable, with positions: `Grasp in line 3 and Grasp in line 9`."""
    writers: dict[str, None] = {}
    for node, skill in sorted(context.iterate_installed_skills(), key=lambda pair: pair[0].span.line):
        if any(wire.variable == variable for wire in find_wires(node, skill, Direction.OUT)):
            writers[f"{node.skill} in {node.span.describe_place(span.source)}"] = None
    return " and ".join(writers) or "a loop, for the nodes in its body only"


def _suggest_writers(context: CheckContext, variable: str, span: Span) -> str:
    """Return the skills in the file of `span` that write a variable; without any, the installed ones."""
    all_writers = _describe_writers(context, variable, span).split(" and ")
    writers_in_file = [writer for writer in all_writers if " in line " in writer]
    skills = [name for name, skill in context.skills.items() if _has_output(skill, variable)]
    return " and ".join(writers_in_file) or ", ".join(skills) or "no skill"


def _make_unwritten_hint(context: CheckContext, variable: str) -> str:
    """Return a hint for a variable that no node of the tree writes."""
    local_names = [name for name in context.written_variables if name.endswith(f".{variable}")]
    if local_names:
        subtree = min(name.rpartition(".")[0] for name in local_names)
        return f'The subtree "{subtree}" writes a local variable {variable}: add {variable} to its returns.'
    skills = [name for name, skill in context.skills.items() if _has_output(skill, variable)]
    if skills:
        return f"It is written by: {', '.join(skills)}."
    # Local variables of subtrees contain a dot.
    global_names = sorted(name for name in context.written_variables if "." not in name)
    similar = find_similar_word(variable, global_names)
    listed = ", ".join(f"${name}" for name in global_names) or "none"
    return (f'Did you mean "${similar}"? ' if similar else "") + f"Variables that are written: {listed}."


def _has_output(skill: type[Skill], name: str) -> bool:
    return name in skill.ports and skill.ports[name].direction is Direction.OUT
