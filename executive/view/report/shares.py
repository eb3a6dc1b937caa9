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
"""Activities besides the skills: search for the next object; failed attempts and the preparation of the next
attempt; all other time."""

Interval = tuple[float, float, list[Activation]]
"""Start and end of an interval [s], and its running skills in the order of their start."""

NO_OBJECT = ""
"""Row of the time that led to no object, such as the last look at an empty table."""


@dataclass(frozen=True)
class Shares:
    """Time of a run by object and activity [s].

    Attributes:
        activities: Activities that took time, in the order of a pick.
        rows: Time by object, then by activity; `NO_OBJECT` is last. The sum is the duration of the run.
    """

    activities: tuple[str, ...]
    rows: Mapping[str, Mapping[str, float]]


def compute_shares(timeline: Timeline, nodes: Sequence[OutlineNode]) -> Shares:
    """Return the shares of the time from the start of a run to the last event of its timeline.

    Time of concurrent skills belongs to the skill that started first among those with an object.

    Args:
        timeline: Timeline of the run, with its history.
        nodes: The tree.
    """
    skills = {node.path: node for node in nodes if node.kind == "skill"}
    activations = [activation for activation in timeline.activations if activation.node in skills]
    decisions = timeline.selections
    times: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    skill_activities: dict[str, None] = {}
    retries = _find_retries(activations, skills, decisions)
    for start, end, running in _split_time(activations, timeline.clock):
        main = next((activation for activation in running if activation.item), None)
        if main is not None:
            item, activity = main.item, skills[main.node].skill.lower()
        else:
            item, activity = _find_next_item(decisions, end), _classify_pause(running, skills)
        first, last = retries.get(item, (0.0, 0.0))
        if first <= start and end <= last:
            activity = RETRY
        elif main is not None:
            skill_activities[activity] = None
        times[item][activity] += end - start
    # A skill may have the name of another activity.
    names = dict.fromkeys([LOOK, *skill_activities, RETRY, WAITING])
    used = {activity for row in times.values() for activity in row}
    order = sorted(times, key=lambda item: item == NO_OBJECT)
    return Shares(tuple(name for name in names if name in used), {item: dict(times[item]) for item in order})


def _split_time(activations: Sequence[Activation], end: float) -> Iterator[Interval]:
    """Yield the intervals between successive starts and ends of skills, until the end of the run [s]."""
    lasting = [activation for activation in activations if activation.end > activation.start]
    waiting = deque(sorted(lasting, key=lambda activation: activation.start))
    times = sorted({0.0, end, *(time for each in activations for time in (each.start, each.end))})
    running: list[Activation] = []
    for start, stop in pairwise(times):
        running = [activation for activation in running if activation.end > start]
        while waiting and waiting[0].start <= start:
            running.append(waiting.popleft())
        yield start, stop, running


def _classify_pause(running: Sequence[Activation], skills: Mapping[str, OutlineNode]) -> str:
    """Return the activity of running skills without an object."""
    nodes = [skills[activation.node] for activation in running]
    return LOOK if any(node.senses or "arm" in node.uses for node in nodes) else WAITING


def _find_next_item(decisions: Sequence[tuple[float, str]], time: float) -> str:
    """Return the object of the first decision from a time [s] on, or `NO_OBJECT`."""
    index = bisect_left(decisions, (time, ""))
    return decisions[index][1] if index < len(decisions) else NO_OBJECT


def _find_retries(
    activations: Sequence[Activation],
    skills: Mapping[str, OutlineNode],
    decisions: Sequence[tuple[float, str]],
) -> dict[str, tuple[float, float]]:
    """Return start and end of the failed attempts [s] of each object with a failed attempt."""
    last_failures = {
        activation.item: activation.end
        for activation in activations
        if activation.item and activation.status == "FAILURE"
        if skills[activation.node].uses and not skills[activation.node].senses
    }
    retries = {}
    for item, last in last_failures.items():
        decided = [time for time, name in decisions if name == item]
        first = min(decided, default=min(each.start for each in activations if each.item == item))
        # Looks before the next attempt count as part of the failed attempt.
        retries[item] = first, next((time for time in decided if time > last), last)
    return retries
