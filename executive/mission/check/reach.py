"""Checks of the flow: what can never happen, end or change, and what the tool may hold where."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.case import Case
from executive.mission.findings import Finding, error, warning
from executive.mission.flow.analysis import Analysis
from executive.mission.flow.state import Grip
from executive.mission.model import nodes
from executive.mission.model.nodes import Node, SkillNode
from executive.mission.model.paths import name_of
from executive.mission.model.values import Literal, Match
from executive.mission.source import Mark
from executive.skill import EMPTY, HOLDING


def unreachable(case: Case) -> Iterator[Finding]:
    """Find the first node of every part of the tree that can never run."""
    yield from _unreachable(case.tree, case.flow)


def shadowed_catches(case: Case) -> Iterator[Finding]:
    """Find every failure named in a `catch` that earlier ones take already, by this name or another."""
    for node in case.nodes():
        body = case.flow.flows.get(node.do.path) if isinstance(node, nodes.TryNode) else None
        if body is None or not isinstance(node, nodes.TryNode):
            continue
        earlier: list[Match] = []
        for catch in node.catches:
            for match in catch.on:
                meant = [failure for failure in body.failures if failure.may_match([match])]
                if meant and all(failure.must_match(earlier) for failure in meant):
                    taker = next(e for e in earlier if meant[0].must_match([e]))
                    message = (
                        f"{match} is caught already, as {taker} in {taker.mark.place(match.mark.source)}"
                    )
                    yield warning(match.mark, "unreachable", message)
                earlier.append(match)


def endless_loops(case: Case) -> Iterator[Finding]:
    """Find every loop that cannot end but by a failure, nor is stopped when another branch has ended."""
    stopped = {node.path for node in _beside_a_lead(case)}
    for node in case.flow.nodes.values():
        if not isinstance(node, nodes.WhileNode) or node.path in stopped:
            continue
        condition = case.flow.flows.get(node.condition.path)
        if condition is not None and not condition.failures:
            message = f"this loop never ends: its condition, {name_of(node.condition)}, cannot fail"
            yield error(node.mark, "endless", message, "Use repeat with times or until.")


def _beside_a_lead(case: Case) -> Iterator[Node]:
    """Yield every node that is halted, whatever it does, once the first branch of a parallel has ended."""
    for node in case.nodes():
        if isinstance(node, nodes.ParallelNode) and getattr(node.wait_for, "value", None) == "lead":
            for branch in node.branches[1:]:
                yield from branch.walk()


def unchanging_retries(case: Case) -> Iterator[Finding]:
    """Find every retry that would meet the same again: nothing in it looks, moves or waits."""
    for node in case.nodes():
        if not isinstance(node, nodes.RetryNode) or node.backoff is not None:
            continue
        skills = [case.skills.get(inner.skill) for inner in node.walk() if isinstance(inner, SkillNode)]
        if skills and not any(skill is None or skill.senses or skill.moves for skill in skills):
            message = "this retry changes nothing between its attempts: nothing in it looks, moves or waits"
            hint = "Put a look or a motion into do or recover, or wait with backoff."
            yield warning(node.mark, "unchanging-retry", message, hint)


def single_attempts(case: Case) -> Iterator[Finding]:
    """Find every retry written with one attempt only."""
    for node in case.nodes():
        if isinstance(node, nodes.RetryNode):
            attempts = node.attempts
            # A param may be 1 in one run and 3 in the next.
            fixed = isinstance(attempts, Literal) and not attempts.origin and attempts.mark != node.mark
            if fixed and isinstance(attempts, Literal) and attempts.value == 1:
                yield warning(attempts.mark, "unchanging-retry", "a retry with 1 attempt never tries again")


def _unreachable(node: Node, flow: Analysis) -> Iterator[Finding]:
    for child in node.children:
        if child.path in flow.entry:
            yield from _unreachable(child, flow)
        elif why := _why(node, child):
            bare = isinstance(child, nodes.SequenceNode) and child.listed and not child.label
            called = "this list" if bare else name_of(child)
            yield warning(child.mark, "unreachable", f"{called} can never run: {why}")
            if isinstance(node, nodes.SequenceNode | nodes.FallbackNode):
                return


def _why(parent: Node, child: Node) -> str:
    """Return why a child cannot be reached, or "" where another finding says so."""
    if isinstance(parent, nodes.SequenceNode):
        return "what stands before it never succeeds"
    if isinstance(parent, nodes.FallbackNode):
        return "what stands before it never fails"
    if isinstance(parent, nodes.RetryNode) and child is parent.recover:
        single = isinstance(parent.attempts, Literal) and parent.attempts.value == 1
        if single:
            return "there is one attempt only"
        return "" if parent.on else "the body never fails"
    if isinstance(parent, nodes.WhileNode):
        return "the condition never succeeds"
    if isinstance(parent, nodes.RepeatNode | nodes.ForEachNode):
        return "it is done 0 times"
    return ""


def tool_states(case: Case) -> Iterator[Finding]:
    """Find every skill that needs an empty tool where it may hold something, or the other way round."""
    flow = case.flow
    for path, entry in flow.entry.items():
        node = flow.nodes[path]
        if not isinstance(node, SkillNode) or node.skill not in case.skills:
            continue
        before, door = case.skills[node.skill].tool_state[0], case.doors.get(path)
        mark = door.mark if door else node.mark
        who = f'{node.skill} in the subtree "{door.name}"' if door else node.skill
        if before is EMPTY and (grip := entry.may_be(HOLDING)):
            message = f"{who} needs an empty tool, but something may still be held here"
            hint = f"{_since(flow, grip, mark)} Put it down on every way from there to here."
            yield error(mark, "tool-state", message, hint)
        if before is HOLDING and (grip := entry.may_be(EMPTY)):
            message = f"{who} needs something in the tool, but it may be empty here"
            yield error(mark, "tool-state", message, _since(flow, grip, mark))


def held_at_the_end(case: Case) -> Iterator[Finding]:
    """Find out whether the mission may succeed with something in the tool."""
    flow = case.flow
    if flow.result.success and (grip := flow.result.success.may_be(HOLDING)):
        message = "the mission may end well with something still in the tool"
        yield warning(case.tree.mark, "tool-state", message, _since(flow, grip, case.tree.mark))


def _since(flow: Analysis, grip: Grip, mark: Mark) -> str:
    """Return since when the tool may be so, and which failure led on from there."""
    node = flow.nodes.get(grip.since)
    after = f", when {grip.after} is dealt with" if grip.after else ""
    if node is None:
        return f"Nothing has been grasped before{after}."
    name = node.skill if isinstance(node, SkillNode) else "the node"
    verb = "may hold something" if grip.tool is HOLDING else "may be empty"
    return f"It {verb} since {name} in {node.mark.place(mark.source)}{after}."
