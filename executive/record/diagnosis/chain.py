"""The way of a failure from the root of the tree to the node that decided, and why nothing stopped it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from executive.mission.model import nodes
from executive.mission.model.nodes import Node
from executive.mission.model.paths import name_of
from executive.mission.model.values import Literal, Match, Value
from executive.record.timeline.activation import Activation
from executive.record.timeline.timeline import Timeline

_NEVER = Activation("", 0, "", "", "INVALID", 0, 0.0, 0, 0.0)
"""Stands for the activation of a node that never started."""


@dataclass(frozen=True)
class Link:
    """One node on the way.

    Attributes:
        node: What the mission says.
        below: The next node on the way; None for the one that decided.
        subtree: Name of the subtree it stands in, or "".
        ran: Its last activation.
        names: The failure as `on`, `until` and `catch` may name it here: skill or label, and reason.
        gave_up: True for a retry whose recovery failed.
    """

    node: Node
    below: Node | None
    subtree: str
    ran: Activation
    names: frozenset[tuple[str, str]]
    gave_up: bool

    @property
    def name(self) -> str:
        """What a person calls it: `look: retry`."""
        name = name_of(self.node)
        return f"{self.subtree}: {name}" if self.subtree else name

    def catches(self, matches: Sequence[Match]) -> bool:
        """Tell whether one of these names means the failure."""
        return any((match.source, match.reason) in self.names for match in matches)


def chain(tree: Node, timeline: Timeline, origin: str, failure: str) -> tuple[Link, ...]:
    """Return the nodes that a failure passed, from the root to the one at the path `origin`.

    Args:
        tree: The mission's tree.
        timeline: Timeline of the run.
        origin: Where it began.
        failure: What it is: `Grasp.missed`.
    """
    passed = way(tree, origin)
    source, _, reason = failure.rpartition(".")
    names = {source}
    links: list[Link] = []
    for index in reversed(range(len(passed))):
        node = passed[index]
        ran = timeline.nodes.get(node.path) or _NEVER
        below = passed[index + 1] if index + 1 < len(passed) else None
        inside = next((one.name for one in reversed(passed[:index]) if isinstance(one, nodes.UseNode)), "")
        named = frozenset((name, reason) for name in names)
        links.append(Link(node, below, inside, ran, named, _recovery_failed(node, ran, timeline)))
        names |= {node.label} if node.label else set()
    return tuple(reversed(links))


def way(tree: Node, path: str) -> list[Node]:
    """Return the nodes from the root down to the innermost one at a path; none where there is none."""
    return next(_ways(tree, path), [])


def why(link: Link) -> str:
    """Return why a control node did not stop the failure; "" for one that never could, and for its origin."""
    explain = _REASONS.get(type(link.node))
    return explain(link.node, link) if explain and link.below is not None else ""


def attempts(link: Link) -> tuple[int, int]:
    """Return the how manieth attempt of a `retry` failed, and of how many."""
    assert isinstance(link.node, nodes.RetryNode)
    # Every failure but the last one was passed over, and so was that of a recovery.
    return link.ran.handled.total() + (-1 if link.gave_up else 1), constant(link.node.attempts)


def constant(value: Value | None) -> Any:
    """Return what stands where a checked mission has a constant: its params and arguments are put in."""
    assert isinstance(value, Literal)
    return value.value


def _ways(node: Node, path: str) -> Iterator[list[Node]]:
    """Yield the way down to the innermost node at a path."""
    for child in node.children:
        for way in _ways(child, path):
            yield [node, *way]
    if node.path == path:
        yield [node]


def _retry(node: nodes.RetryNode, link: Link) -> str:
    passed = dict(link.ran.handled)
    attempt, most = attempts(link)
    if link.gave_up:
        last = f"{link.ran.last_handled}: {link.ran.messages[link.ran.last_handled]}"
        return f"gave up after attempt {attempt} of {most}: its recovery failed with {last}"
    if node.on and not link.catches(node.on):
        before = f"; before: {_counted(passed)}" if passed else ""
        return f"tries again only after {_listed(node.on)}{before}"
    passed[link.ran.reason] = passed.get(link.ran.reason, 0) + 1
    return f"all {most} attempts failed: {_counted(passed)}" if most > 1 else "has no second attempt"


def _try(node: nodes.TryNode, link: Link) -> str:
    if link.below is node.finish:
        return "its finally failed"
    if link.below is not node.do:
        last = link.ran.last_handled
        return f"caught {last} ({link.ran.messages.get(last, '')}), but what it did instead failed"
    named = [match for catch in node.catches for match in catch.on]
    return f"catches only {_listed(named)}" if named else "has no catch"


def _repeat(node: nodes.RepeatNode, link: Link) -> str:
    del link
    if node.until:
        return f"ends well only with {_listed(node.until)}"
    return f"a failure ends it before its {constant(node.times)} times are over"


def _for_each(node: nodes.ForEachNode, link: Link) -> str:
    del node
    return f"failed at {link.ran.choice}"


def _timeout(node: nodes.TimeoutNode, link: Link) -> str:
    took = link.ran.end - link.ran.start
    return f"limits only the time: {took:.2f} of {constant(node.seconds):g} s had passed"


def _fallback(node: nodes.FallbackNode, link: Link) -> str:
    others = ", ".join(f"{reason} ({said})" for reason, said in link.ran.messages.items())
    return f"all {len(node.choices)} choices failed" + (f"; the others with {others}" if others else "")


def _parallel(node: nodes.ParallelNode, link: Link) -> str:
    wanted, count = constant(node.wait_for), len(node.branches)
    if wanted == "lead":
        return "ends as its lead does"
    needs = {"all": f"all {count}", "any": f"one of its {count}"}.get(wanted, f"{wanted} of its {count}")
    # The failure that it passes on may be among those it told of while the others went on.
    others = [reason for reason in link.ran.handled if reason != link.ran.reason]
    return f"needs {needs} branches" + (f"; also failed: {', '.join(others)}" if others else "")


def _recovery_failed(node: Node, ran: Activation, timeline: Timeline) -> bool:
    """Tell whether a retry's recovery ran in its last activation, and failed there."""
    recover = getattr(node, "recover", None)
    recovery = None if recover is None else timeline.nodes.get(recover.path)
    return recovery is not None and recovery.number > ran.number and recovery.status == "FAILURE"


def _listed(matches: Sequence[Match]) -> str:
    return ", ".join(map(str, matches))


def _counted(passed: Mapping[str, int]) -> str:
    return ", ".join(f"{count} x {reason}" for reason, count in passed.items())


_REASONS: Mapping[type[Node], Callable[[Any, Link], str]] = {
    nodes.RetryNode: _retry,
    nodes.TryNode: _try,
    nodes.RepeatNode: _repeat,
    nodes.WhileNode: lambda *_: "a failure of its body ends it",
    nodes.ForEachNode: _for_each,
    nodes.TimeoutNode: _timeout,
    nodes.FallbackNode: _fallback,
    nodes.ParallelNode: _parallel,
}
