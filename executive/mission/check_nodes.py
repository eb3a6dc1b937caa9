"""Checks of nodes: constants, conditions, labels, failures, unreachable and concurrent nodes, the tool."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations, permutations

from pydantic import TypeAdapter

from executive.mission import grammar
from executive.mission.analysis import CheckContext, FlowAnalysis
from executive.mission.ports import ValueProblem, Wire, convert_constant
from executive.skill import EMPTY, HOLDING, Direction, list_condition_violations
from executive.text.findings import (
    Finding,
    Span,
    describe_value,
    make_error,
    make_warning,
    suggest_choice,
    suggest_word,
)
from executive.tree.flow import UNKNOWN_NAME, Flow, FlowState, PossibleFailure, PossibleToolState
from executive.tree.keys import PREDEFINED_LISTS, AnyValue, Elements, KeySection, KeyValue, list_nodes
from executive.tree.node import ControlNode, NodeAnalysis
from executive.tree.specification import Constant, Expression, Node, Reason, Reference, SkillNode, SubtreeNode


def check_constants(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every constant of a control node that is invalid or a reference to a variable."""
    for node in context.control_nodes:
        yield from _check_keys(context, node, node.keyword)


def _check_keys(context: CheckContext, owner: ControlNode | KeySection, name: str) -> Iterator[Finding]:
    for key, value in owner.list_values():
        for item in value if isinstance(value, tuple) else (value,):
            if isinstance(item, KeySection):
                yield from _check_keys(context, item, key.name)
        if key.value_type == AnyValue:
            continue
        if key.accepts_expression and isinstance(value, Expression):
            continue
        if key.is_constant:
            validator = key.make_validator(owner.find_max(key, vars(owner)))
            yield from check_constant(context, f"{name}.{key.name}", validator, value)
        elif (
            key.value_type == Elements
            and isinstance(value, Constant)
            and not isinstance(value.value, list)
            and value.value not in PREDEFINED_LISTS
        ):
            suggestion = suggest_word(value.value, PREDEFINED_LISTS)
            description = f"{describe_value(value.value)}{suggestion}{value.origin_note}"
            names = ", ".join(PREDEFINED_LISTS)
            message = f"{name}.{key.name} must be a list, a variable, or one of {names}, not {description}"
            is_text_in_mission = isinstance(value.value, str) and not value.origin
            hint = f"Write a list: [{value.value}]." if is_text_in_mission else ""
            yield make_error(value.span, "wrong-type", message, hint)


def check_constant(
    context: CheckContext, name: str, validator: TypeAdapter[object], value: KeyValue
) -> Iterator[Finding]:
    """Yield an error if `value` is a variable or no valid constant; `name` is the subject of the message."""
    if isinstance(value, Expression):
        yield make_error(value.span, "wrong-type", f"{name} must be a constant, not an expression")
    elif isinstance(value, Reference):
        message = f"{name} must be a constant, but ${value.name} is neither a param nor an argument"
        yield make_error(value.span, "unknown-param", message, context.make_unknown_param_hint(value))
    elif isinstance(value, Constant):
        try:
            convert_constant(validator, value.value)
        except ValueProblem as problem:
            is_param_name = isinstance(value.value, str) and value.value in context.mission.params
            is_missing_dollar = is_param_name and problem.code == "wrong-type"
            hint = f"For the param, write ${value.value}." if is_missing_dollar else ""
            yield make_error(value.span, problem.code, f"{name} {problem}{value.origin_note}", hint)


def run_node_checks(context: CheckContext) -> Iterator[Finding]:
    """For every control node, yield an error per child that must be a condition, but is none.

    For a control node without such errors, yield the findings of its method `check`.
    """

    def compute_flow(child: Node, entry: FlowState, is_first_tick: bool) -> Flow:
        return FlowAnalysis(child, context.skills, entry, is_first_tick=is_first_tick).root_flow

    flows = context.flow_analysis.flows
    halted_paths = _find_paths_below(context, lambda node: node.children_halted_by_sibling)
    concurrent_paths = _find_paths_below(context, lambda node: node.concurrent_children)
    for node in context.control_nodes:
        if non_conditions := list(find_non_conditions(context, node)):
            yield from non_conditions
            continue
        is_halted = node.path in halted_paths
        is_concurrent = node.path in concurrent_paths
        yield from node.check(NodeAnalysis(flows, context.skills, compute_flow, is_halted, is_concurrent))


def _find_paths_below(
    context: CheckContext, select_children: Callable[[ControlNode], Sequence[Node]]
) -> set[str]:
    """Return the paths of all nodes in and below the selected children of all control nodes."""
    roots = [child for node in context.control_nodes for child in select_children(node)]
    return {node.path for root in roots for node in root.walk()}


def find_non_conditions(context: CheckContext, parent: ControlNode) -> Iterator[Finding]:
    """Yield an error for each child that is not a condition although its key allows only conditions."""
    for key, value in parent.list_values():
        for node in list_nodes(value) if key.requires_conditions else ():
            if problem := _find_problem(context, node):
                message = f"{problem}, but {parent.type_name}.{key.name} needs a condition"
                conditions = [name for name, skill in context.skills.items() if skill.is_condition]
                classes = context.node_classes.items()
                words = [word for word, one in classes if one.is_condition and "do" in one.keys]
                hint = (
                    f"Conditions: {', '.join(conditions)}, and expressions such as run.placed > 3; they are "
                    f"combined by {', '.join(words)}."
                )
                yield make_error(node.span, "no-condition", message, hint)


def _find_problem(context: CheckContext, node: Node) -> str:
    """Return the beginning of a message about a node that is no condition; "" for a condition."""
    match node:
        case SubtreeNode(body=Node() as body):
            problem = _find_problem(context, body)
            return problem and f'in the subtree "{node.name}", {problem}'
        case SkillNode() if node.skill in context.skills:
            skill = context.skills[node.skill]
            effects = [*list_condition_violations(skill), "is not declared as a condition (is_condition)"]
            return "" if skill.is_condition else f"{node.skill} {effects[0]}"
        case ControlNode() if not node.is_condition:
            return "a list runs as a sequence" if node.is_list else f"{node.type_name} is no condition"
    return ""


def check_labels(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every label that two nodes have, or that is a keyword or key of a control node."""
    first_spans: dict[str, Span] = {}
    # Paths contain keywords and keys, so a label must differ from all of them.
    reserved_words = {grammar.USE_KEYWORD, *context.node_classes}
    for node_class in context.node_classes.values():
        reserved_words |= {key.name for key in node_class.keys.values() if key.has_nodes}
    for node in context.nodes:
        if not node.label:
            continue
        span = node.label_span or node.span
        if node.label in reserved_words:
            message = f'"{node.label}" is a word of the mission language and cannot be a label'
            yield make_error(span, "bad-label", message)
        # Nodes with the same position are one node of a subtree that is used more than once.
        other_span = first_spans.setdefault(node.label, span)
        if other_span != span:
            place = other_span.describe_place(span.source)
            message = f'two nodes have the label "{node.label}"; the other node is in {place}'
            yield make_error(span, "duplicate-label", message)


def check_failure_names(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every failure name that is unknown, ambiguous, or impossible in the body."""
    analysis = context.flow_analysis
    nodes = [node for node in analysis.nodes.values() if isinstance(node, ControlNode)]
    for node, name in [(owner, name) for owner in nodes for name in _find_failure_names(owner)]:
        for body in node.list_children("do"):
            flow = analysis.flows.get(body.path)
            if flow is None:
                continue
            matching = [failure for failure in flow.failures if failure.may_match([name])]
            if unknown_reason := _find_unknown_reason(context, name, body):
                yield unknown_reason
            elif not matching:
                yield _make_impossible_error(context, name, node.keyword, body)
            elif len(sources := _find_named_nodes(analysis, name, matching)) > 1:
                spans = [source.span for source in sources]
                places = " and ".join(f"{one.describe_place(name.span.source)}:{one.col}" for one in spans)
                message = f"{name} is ambiguous: more than one node in the body can fail so, in {places}"
                hint = f"Give each node, or its use, a label with as:, and write label.{name.reason}."
                yield make_error(name.span, "ambiguous", message, hint)


def _find_failure_names(owner: ControlNode | KeySection) -> Iterator[Reason]:
    """Yield the names of failures in the keys of a node and of its sections."""
    for _, value in owner.list_values():
        for item in value if isinstance(value, tuple) else (value,):
            if isinstance(item, Reason):
                yield item
            elif isinstance(item, KeySection):
                yield from _find_failure_names(item)


def _make_impossible_error(context: CheckContext, name: Reason, keyword: str, body: Node) -> Finding:
    """Return the error if no failure of `body` has the name; `keyword` is the keyword of the parent."""
    reasons = _find_reasons(context.flow_analysis, body)
    if name.source in reasons:
        failures = context.flow_analysis.flows[body.path].failures
        names = ", ".join(sorted({str(failure) for failure in failures})) or "none"
        message = f"{name} never leaves the body of this {keyword}"
        hint = f"Failures that leave it: {names}. A loop fails like its body, a fallback like its last child."
        return make_error(name.span, "impossible-reason", message, hint)
    labels = {node.label for node in context.nodes if node.label}
    keywords = {word for word, node_class in context.node_classes.items() if node_class.reasons}
    if name.source in (*context.skills, *labels, *keywords):
        message = f"{name.source} is not in the body of this {keyword}, so the body cannot fail with {name}"
        hint = f"The body contains: {', '.join(reasons) or 'none'}."
        return make_error(name.span, "impossible-reason", message, hint)
    hint = suggest_choice(name.source, reasons, "The body contains")
    return make_error(name.span, "unknown-skill", f'there is no skill or label "{name.source}"', hint)


def _find_unknown_reason(context: CheckContext, name: Reason, body: Node) -> Finding | None:
    """Return an error if the skill or label exists, but never fails with the reason; otherwise None."""
    skill = context.skills.get(name.source)
    reasons = skill.reasons if skill else _find_reasons(context.flow_analysis, body).get(name.source)
    if reasons is None or name.reason in reasons or UNKNOWN_NAME in reasons:
        return None
    hint = suggest_choice(name.reason, reasons, f"{name.source} may fail with")
    return make_error(name.span, "unknown-reason", f'{name.source} never fails with "{name.reason}"', hint)


def _find_reasons(flow: FlowAnalysis, body: Node) -> dict[str, list[str]]:
    """Return all reasons in `body`, also of handled failures, by the failing skill, keyword or label."""
    reasons: dict[str, list[str]] = {}
    for node in body.walk():
        if isinstance(node, SkillNode):
            skill = flow.find_skill_or_most_similar(node.skill)
            reasons.setdefault(node.skill, []).extend(skill.reasons if skill else ())
        elif isinstance(node, ControlNode) and node.own_reasons:
            reasons.setdefault(node.keyword, []).extend(node.own_reasons)
        if node.label and node.path in flow.flows:
            failures = flow.flows[node.path].failures
            reasons.setdefault(node.label, []).extend(failure.reason for failure in failures)
    return {source: list(dict.fromkeys(duplicates)) for source, duplicates in reasons.items()}


def _find_named_nodes(flow: FlowAnalysis, name: Reason, matching: list[PossibleFailure]) -> list[Node]:
    """Return the nodes whose failures `name` denotes; none for a label, because labels are unambiguous."""
    if any(name.source in failure.labels for failure in matching):
        return []
    denoted = [flow.nodes[failure.path] for failure in matching if failure.matches([name])]
    nodes_by_span = {node.span: node for node in denoted}
    return sorted(nodes_by_span.values(), key=lambda node: (node.span.line, node.span.col))


def find_unreachable(context: CheckContext) -> Iterator[Finding]:
    """For each node that can run, yield a warning for the first child that can never run."""
    entry_states = context.flow_analysis.entry_states
    for node in context.control_nodes:
        unreachable = [child for child in node.children if child.path not in entry_states]
        if node.path in entry_states and unreachable and (reason := node.explain_unreachable()):
            child = unreachable[0]
            name = "this list" if child.is_list and not child.label else child.path_name
            yield make_warning(child.span, "unreachable", f"{name} can never run: {reason}")


def check_tool_states(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every skill that may start with the opposite of the required tool state."""
    flow = context.flow_analysis
    for node, skill in context.find_installed_skills(flow.nodes[path] for path in flow.entry_states):
        required_state = skill.tool_state[0]
        entry_state = flow.entry_states[node.path]
        name, span = context.locate_skill(node)
        if required_state is EMPTY and (tool := entry_state.find_tool_state(HOLDING)):
            message = f"{name} needs an empty tool, but the tool may hold an object here"
            explanation = _explain_tool_state(flow, tool, span)
            hint = f"{explanation} Put it down on every path from there to this node."
            yield make_error(span, "tool-state", message, hint)
        if required_state is HOLDING and (tool := entry_state.find_tool_state(EMPTY)):
            message = f"{name} needs an object in the tool, but the tool may be empty here"
            yield make_error(span, "tool-state", message, _explain_tool_state(flow, tool, span))


def check_tool_at_end(context: CheckContext) -> Iterator[Finding]:
    """Yield a warning if the mission may succeed with an object in the tool."""
    flow = context.flow_analysis
    finishes = [node for node in context.control_nodes if node.ends_mission]
    ends = [(context.tree.span, flow.root_flow.success)]
    ends += [(node.span, flow.entry_states.get(node.path)) for node in finishes]
    for span, state in ends:
        if state and (tool := state.find_tool_state(HOLDING)):
            message = "the mission may succeed with an object in the tool"
            yield make_warning(span, "tool-state", message, _explain_tool_state(flow, tool, span))


def _explain_tool_state(flow: FlowAnalysis, tool: PossibleToolState, span: Span) -> str:
    """Return a sentence about the node that may have caused a state of the tool, for a message at `span`."""
    cause = flow.nodes.get(tool.cause)
    after = f", when {tool.handled_failure} is handled" if tool.handled_failure else ""
    if cause is None:
        return f"No object has been grasped before{after}."
    name = cause.skill if isinstance(cause, SkillNode) else "the node"
    state = "may hold an object" if tool.state is HOLDING else "may be empty"
    return f"The tool {state} since {name} in {cause.span.describe_place(span.source)}{after}."


def find_shared_resources(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every two concurrent branches that use the same part of the cell."""
    for branches in (node.concurrent_children for node in context.control_nodes):
        users_by_branch = [_find_resource_users(context, branch) for branch in branches]
        for users, later_users in combinations(users_by_branch, 2):
            # One error reports all parts of the cell that the same two skills share.
            shared_resources = [resource for resource in later_users if resource in users]
            conflicts = {(users[name].span, later_users[name].span): name for name in shared_resources}
            for resource in conflicts.values():
                user = users[resource]
                later_user = later_users[resource]
                name, span = context.locate_skill(later_user)
                message = (
                    f"{name} uses the {resource}, and {user.skill} in "
                    f"{user.span.describe_place(span.source)} "
                    "may use it at the same time in another branch of this parallel"
                )
                hint = "Write a sequence, or put both into one branch."
                yield make_error(span, "shared-resource", message, hint)


def find_shared_variables(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every two concurrent branches that write the same variable."""
    for branches in (node.concurrent_children for node in context.control_nodes):
        writes_by_branch = [_find_first_writes(context, branch) for branch in branches]
        for writes, later_writes in combinations(writes_by_branch, 2):
            for variable, later_wire in later_writes.items():
                if wire := writes.get(variable):
                    place = wire.span.describe_place(later_wire.span.source)
                    message = (
                        f"{later_wire.node.type_name} writes ${variable}, and so does {wire.node.type_name} "
                        f"in {place}, in another branch of the same parallel"
                    )
                    yield make_error(later_wire.span, "shared-variable", message, later_wire.rename_hint)


def find_read_races(context: CheckContext) -> Iterator[Finding]:
    """Yield an error for every input whose variable a concurrent branch may write."""
    for branches in (node.concurrent_children for node in context.control_nodes):
        reads = [list(_find_reads(context, branch)) for branch in branches]
        writes = [_find_first_writes(context, branch) for branch in branches]
        for reading_index, writing_index in permutations(range(len(branches)), 2):
            # Branches start in order: the first skill of a branch reads before a later branch writes.
            is_read_first = reading_index < writing_index
            safe_node = _find_first_leaf(branches[reading_index]) if is_read_first else None
            # `find_shared_variables` reports a variable that both branches write.
            racing_variables = writes[writing_index].keys() - writes[reading_index].keys()
            for read in reads[reading_index]:
                if read.node is not safe_node and read.variable in racing_variables:
                    write = writes[writing_index][read.variable]
                    place = write.span.describe_place(read.span.source)
                    message = (
                        f"{read} reads ${read.variable}, while {write.node.type_name} in {place} "
                        "may write it, in another branch of the same parallel"
                    )
                    yield make_error(read.span, "shared-variable", message, write.rename_hint)


def _find_first_leaf(node: Node) -> Node:
    """Return the first node without children, usually a skill, that the execution of a node reaches."""
    if isinstance(node, SubtreeNode):
        return _find_first_leaf(node.body) if node.body else node
    first_child = node.first_child if isinstance(node, ControlNode) else None
    return _find_first_leaf(first_child) if first_child else node


def _find_reads(context: CheckContext, branch: Node) -> Iterator[Wire]:
    """Yield the reads below `branch`, except those that `find_unwritten_inputs` reports."""
    for read in context.list_wires(branch, Direction.IN):
        state = context.flow_analysis.entry_states.get(read.node.path)
        if state and not (read.is_required and state.may_be_unwritten(read.variable)):
            yield read


def _find_resource_users(context: CheckContext, branch: Node) -> dict[str, SkillNode]:
    """Return the first user of each part of the cell below `branch`, by the name of the part."""
    users: dict[str, SkillNode] = {}
    cameras = context.cell.cameras.values() if context.cell else ()
    is_camera_on_wrist = any(camera.mount == "wrist" for camera in cameras)
    for node, skill in context.find_installed_skills(branch.walk()):
        for resource in skill.uses:
            if resource == "camera" and is_camera_on_wrist:
                # The arm must not move while a camera on the wrist takes an image.
                users.setdefault("arm", node)
            users.setdefault(resource, node)
    return users


def _find_first_writes(context: CheckContext, branch: Node) -> dict[str, Wire]:
    """Return the first write of each variable below `branch`, by variable."""
    writes: dict[str, Wire] = {}
    for wire in context.list_wires(branch, Direction.OUT):
        writes.setdefault(wire.variable, wire)
    return writes
