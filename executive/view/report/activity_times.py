"""Time of a run by item and activity: every instant belongs to one item or none, and to one activity."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict, deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from executive.mission.outline import OutlineNode
from executive.record.timeline.activation import Activation
from executive.record.timeline.timeline import Timeline

LOOK = "look"
"""Activity: search for the next item with an empty tool."""
RETRY = "retry"
"""Activity: failed attempts, and the looks before the next attempt."""
WAITING = "waiting"
"""Activity: time that belongs neither to a skill nor to another activity."""

Interval = tuple[float, float, list[Activation]]
"""Start and end of an interval [s], and the skills that run in it, in the order of their starts."""

NO_OBJECT = ""
"""Key of the time that belongs to no item, such as the time of the last look at an empty table."""


@dataclass(frozen=True)
class ActivityTimes:
    """Time of a run by item and activity [s].

    Attributes:
        activities: Activities that took time: look, skills in the order of their first use, retry, waiting.
        times_by_item: Time by item, then by activity; `NO_OBJECT` is last. The sum of all times is the
            duration of the run.
    """

    activities: tuple[str, ...]
    times_by_item: Mapping[str, Mapping[str, float]]


def compute_activity_times(timeline: Timeline, nodes: Sequence[OutlineNode]) -> ActivityTimes:
    """Return the time by item and activity, from the start of a run to the last event of its timeline.

    If several skills run, the time belongs to the first started skill among those with an item.

    Args:
        timeline: Timeline of the run, with its history.
        nodes: Nodes of the tree.
    """
    skills = {node.path: node for node in nodes if node.kind == "skill"}
    activations = [activation for activation in timeline.activations if activation.node in skills]
    selections = timeline.selections
    times: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    skill_activities: dict[str, None] = {}
    retries = _find_retries(activations, skills, selections)
    for start, end, running in _split_time(activations, timeline.clock):
        main = next((activation for activation in running if activation.item), None)
        if main is not None:
            item, activity = main.item, skills[main.node].skill.lower()
        else:
            item, activity = _find_next_item(selections, end), _classify_pause(running, skills)
        retry_start, retry_end = retries.get(item, (0.0, 0.0))
        if retry_start <= start and end <= retry_end:
            activity = RETRY
        elif main is not None:
            skill_activities[activity] = None
        times[item][activity] += end - start
    # A skill may have the name of another activity; `dict.fromkeys` removes duplicates.
    names = dict.fromkeys([LOOK, *skill_activities, RETRY, WAITING])
    used_names = {activity for row in times.values() for activity in row}
    items = sorted(times, key=lambda item: item == NO_OBJECT)
    activities = tuple(name for name in names if name in used_names)
    return ActivityTimes(activities, {item: dict(times[item]) for item in items})


def _split_time(activations: Sequence[Activation], end_time: float) -> Iterator[Interval]:
    """Yield the intervals between successive starts and ends of skills, from 0 to `end_time` [s]."""
    lasting = [activation for activation in activations if activation.end > activation.start]
    upcoming = deque(sorted(lasting, key=lambda activation: activation.start))
    times = sorted({0.0, end_time, *(time for each in activations for time in (each.start, each.end))})
    running: list[Activation] = []
    for start, end in pairwise(times):
        running = [activation for activation in running if activation.end > start]
        while upcoming and upcoming[0].start <= start:
            running.append(upcoming.popleft())
        yield start, end, running


def _classify_pause(running: Sequence[Activation], skills: Mapping[str, OutlineNode]) -> str:
    """Return the activity, LOOK or WAITING, of an interval whose running skills have no item."""
    nodes = [skills[activation.node] for activation in running]
    return LOOK if any(node.senses or "arm" in node.uses for node in nodes) else WAITING


def _find_next_item(selections: Sequence[tuple[float, str]], time: float) -> str:
    """Return the item of the first selection at or after a time [s], or `NO_OBJECT`."""
    index = bisect_left(selections, (time, ""))
    return selections[index][1] if index < len(selections) else NO_OBJECT


def _find_retries(
    activations: Sequence[Activation],
    skills: Mapping[str, OutlineNode],
    selections: Sequence[tuple[float, str]],
) -> dict[str, tuple[float, float]]:
    """Return, for each item with a failed attempt, the start and the end of its failed attempts [s]."""
    last_failures = {
        activation.item: activation.end
        for activation in activations
        if activation.item and activation.status == "FAILURE"
        if skills[activation.node].uses and not skills[activation.node].senses
    }
    retries = {}
    for item, last_failure in last_failures.items():
        selection_times = [time for time, name in selections if name == item]
        start = min(selection_times, default=min(each.start for each in activations if each.item == item))
        # Looks before the next attempt count as part of the failed attempt.
        retries[item] = start, next((time for time in selection_times if time > last_failure), last_failure)
    return retries
