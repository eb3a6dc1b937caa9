"""Time of a run by object: every instant belongs to one object and one activity."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict, deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from executive.mission.outline import OutlineNode
from executive.record.timeline.activation import Activation
from executive.record.timeline.timeline import Timeline

LOOK, RETRY, WAITING = "look", "retry", "waiting"
"""Activities that are no skill's: to find out what to do next; attempts that failed, and what it took to try
again; and what else passed between."""

NOBODY = ""
"""Stands for the time that led to no object, such as the last look at an empty table."""


@dataclass(frozen=True)
class Shares:
    """The time of a run [s].

    Attributes:
        activities: In the order in which a pick has them; each was something's at some time.
        rows: Time by object, then by activity; what led to no object last, under `NOBODY`. All of it
            together is the time of the run.
    """

    activities: tuple[str, ...]
    rows: Mapping[str, Mapping[str, float]]


def shares(timeline: Timeline, nodes: Sequence[OutlineNode]) -> Shares:
    """Return the shares of the time from the start of a run to the last event of its timeline.

    Where skills ran at the same time, it is that of the one that began first and was about an object.

    Args:
        timeline: Timeline of the run, with its history.
        nodes: The tree.
    """
    skills = {node.path: node for node in nodes if node.kind == "skill"}
    ran = [one for one in timeline.activations if one.node in skills]
    decisions = timeline.selections
    spent: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    seen: dict[str, None] = {}
    retried = _retried(ran, skills, decisions)
    for began, ended, running in _slices(ran, timeline.clock):
        about = next((one for one in running if one.item), None)
        if about is not None:
            item, activity = about.item, skills[about.node].skill.lower()
        else:
            item, activity = _next_item(decisions, ended), _between(running, skills)
        first, last = retried.get(item, (0.0, 0.0))
        if first <= began and ended <= last:
            activity = RETRY
        elif about is not None:
            seen[activity] = None
        spent[item][activity] += ended - began
    # A skill may be called like one of the others.
    known = dict.fromkeys([LOOK, *seen, RETRY, WAITING])
    used = {activity for row in spent.values() for activity in row}
    order = sorted(spent, key=lambda item: item == NOBODY)
    return Shares(tuple(name for name in known if name in used), {item: dict(spent[item]) for item in order})


def _slices(ran: Sequence[Activation], end: float) -> Iterator[tuple[float, float, list[Activation]]]:
    """Yield the time between any two changes, with the skills that run then, in the order they began."""
    to_come = deque(sorted((one for one in ran if one.end > one.start), key=lambda one: one.start))
    times = sorted({0.0, end, *(time for one in ran for time in (one.start, one.end))})
    running: list[Activation] = []
    for began, ended in pairwise(times):
        running = [one for one in running if one.end > began]
        while to_come and to_come[0].start <= began:
            running.append(to_come.popleft())
        yield began, ended, running


def _between(running: Sequence[Activation], skills: Mapping[str, OutlineNode]) -> str:
    """Return what is done while no skill is about an object."""
    nodes = [skills[one.node] for one in running]
    return LOOK if any(node.senses or "arm" in node.uses for node in nodes) else WAITING


def _next_item(decisions: Sequence[tuple[float, str]], now: float) -> str:
    """Return the object that is decided for next."""
    place = bisect_left(decisions, (now, ""))
    return decisions[place][1] if place < len(decisions) else NOBODY


def _retried(
    ran: Sequence[Activation], skills: Mapping[str, OutlineNode], decisions: Sequence[tuple[float, str]]
) -> dict[str, tuple[float, float]]:
    """Return from when to when each object with a failed attempt was tried without success."""
    failed = {
        one.item: one.end
        for one in ran
        if one.item and one.status == "FAILURE"
        if skills[one.node].uses and not skills[one.node].senses
    }
    retried = {}
    for item, last in failed.items():
        decided = [time for time, name in decisions if name == item]
        first = min(decided, default=min(one.start for one in ran if one.item == item))
        # Looks that led to the next attempt are the price of the failed one.
        retried[item] = first, next((time for time in decided if time > last), last)
    return retried
