"""Checks of what can never happen, never end, or never change."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.case import Case
from executive.mission.findings import Finding, error, warning
from executive.mission.flow.analysis import Analysis
from executive.mission.model import nodes
from executive.mission.model.nodes import Node
from executive.mission.model.paths import name_of
from executive.mission.model.values import Literal, Match


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
        skills = [case.skills.get(inner.skill) for inner in node.walk() if isinstance(inner, nodes.SkillNode)]
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
            yield warning(child.mark, "unreachable", f"{_called(child)} can never run: {why}")
            if isinstance(node, nodes.SequenceNode | nodes.FallbackNode):
                return


def _called(node: Node) -> str:
    bare = isinstance(node, nodes.SequenceNode) and node.listed
    return "this list" if bare and not node.label else name_of(node)


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
