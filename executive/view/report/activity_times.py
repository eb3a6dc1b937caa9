"""Duration of the activities in a run, for each item."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict, deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from executive.mission.outline import OutlineNode
from executive.record.timeline import Activation, Timeline

LOOK = "look"
"""Activity: detection of the next item while the tool is empty."""
FAILED_ATTEMPTS = "failed attempts"
"""Activity: failed attempts to pick or place an item, and the looks before the next attempt."""
WAITING = "waiting"
"""Activity: no skill works on an item, moves the arm or senses the scene."""

Interval = tuple[float, float, list[Activation]]
"""Start and end of an interval [s], and the running skills in the order of their starts."""

NO_ITEM = ""
"""Key of the time that belongs to no item, such as the time of the last look at an empty table."""


@dataclass(frozen=True)
class ActivityTimes:
    """Time of a run by item and activity [s].

    Attributes:
        activities: Activities that took time: look, skills by their first use, failed attempts, waiting.
        times_by_item: Time by item and activity; `NO_ITEM` is the last key. The sum of all times is the
            duration of the run.
    """

    activities: tuple[str, ...]
    times_by_item: Mapping[str, Mapping[str, float]]


def compute_activity_times(timeline: Timeline, nodes: Sequence[OutlineNode]) -> ActivityTimes:
    """Return the time by item and activity, from the start of a run to the last event of its timeline.

    If several skills run, the time belongs to the first started skill that works on an item. Time without
    such a skill belongs to the item that is selected next. `timeline.has_history` must be true.
    """
    skills = {node.path: node for node in nodes if node.kind == "skill"}
    activations = [activation for activation in timeline.activations if activation.node in skills]
    selections = timeline.selection_times
    times: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    # The dictionary without values is used as an ordered set.
    skill_activities: dict[str, None] = {}
    failed_attempts = _find_failed_attempts(activations, skills, timeline)
    for start, end, running in _split_time(activations, timeline.clock):
        item_activation = next((activation for activation in running if activation.item), None)
        if item_activation is not None:
            item, activity = item_activation.item, skills[item_activation.node].skill.lower()
        else:
            nodes_without_item = [skills[activation.node] for activation in running]
            is_look = any(node.senses or "arm" in node.uses for node in nodes_without_item)
            item, activity = _find_next_item(selections, end), LOOK if is_look else WAITING
        failed_start, failed_end = failed_attempts.get(item, (0.0, 0.0))
        if failed_start <= start and end <= failed_end:
            activity = FAILED_ATTEMPTS
        elif item_activation is not None:
            skill_activities[activity] = None
        times[item][activity] += end - start
    # A skill may have the name of another activity, so duplicates are removed.
    all_activities = dict.fromkeys([LOOK, *skill_activities, FAILED_ATTEMPTS, WAITING])
    activities = tuple(name for name in all_activities if any(name in row for row in times.values()))
    items = sorted(times, key=lambda item: item == NO_ITEM)
    return ActivityTimes(activities, {item: dict(times[item]) for item in items})


def _split_time(activations: Sequence[Activation], end_time: float) -> Iterator[Interval]:
    """Yield the intervals between successive starts and ends of skills, from 0 to `end_time` [s]."""
    times = {0.0, end_time, *(activation.start for activation in activations)}
    times |= {activation.end for activation in activations}
    later_activations = deque(sorted(activations, key=lambda activation: activation.start))
    running: list[Activation] = []
    for start, end in pairwise(sorted(times)):
        while later_activations and later_activations[0].start <= start:
            running.append(later_activations.popleft())
        running = [activation for activation in running if activation.end > start]
        yield start, end, running


def _find_next_item(selections: Sequence[tuple[float, str]], time: float) -> str:
    """Return the item of the first selection at or after a time [s], or `NO_ITEM`."""
    index = bisect_left(selections, (time, ""))
    return selections[index][1] if index < len(selections) else NO_ITEM


def _find_failed_attempts(
    activations: Sequence[Activation], skills: Mapping[str, OutlineNode], timeline: Timeline
) -> dict[str, tuple[float, float]]:
    """Return, for each item with a failed attempt, the start and the end of its failed attempts [s]."""
    failed_attempts = {}
    for activation in activations:
        skill, item = skills[activation.node], activation.item
        # An attempt fails if a skill that acts on the item fails, not if a look fails.
        if item and activation.status == "FAILURE" and skill.uses and not skill.senses:
            selection_times = [time for time, selected in timeline.selection_times if selected == item]
            first_start = min(other.start for other in activations if other.item == item)
            # Looks before the next attempt count as part of the failed attempt.
            end = next((time for time in selection_times if time > activation.end), activation.end)
            failed_attempts[item] = min(selection_times, default=first_start), end
    return failed_attempts
