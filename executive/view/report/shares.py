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
"""Activities without a skill: search for the next object, failed attempts with recovery, and other time."""

NO_ITEM = ""
"""Item of the time that led to no object, such as the last look at an empty table."""


@dataclass(frozen=True)
class Shares:
    """Time of a run by item and activity [s].

    Attributes:
        activities: Activities with a share of the time, in the order of a pick.
        rows: Time by object, then by activity; `NO_ITEM` is last. The sum is the time of the run.
    """

    activities: tuple[str, ...]
    rows: Mapping[str, Mapping[str, float]]


def shares(timeline: Timeline, nodes: Sequence[OutlineNode]) -> Shares:
    """Return the shares of the time from the start of a run to the last event of its timeline.

    Time of parallel skills counts for the skill that started first among those with an object.

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
    for start, end, running in _slice_time(activations, timeline.clock):
        item_skill = next((activation for activation in running if activation.item), None)
        if item_skill is not None:
            item, activity = item_skill.item, skills[item_skill.node].skill.lower()
        else:
            item, activity = _find_next_item(decisions, end), _classify(running, skills)
        first, last = retries.get(item, (0.0, 0.0))
        if first <= start and end <= last:
            activity = RETRY
        elif item_skill is not None:
            skill_activities[activity] = None
        times[item][activity] += end - start
    # A skill may have the name of another activity.
    known = dict.fromkeys([LOOK, *skill_activities, RETRY, WAITING])
    used = {activity for row in times.values() for activity in row}
    order = sorted(times, key=lambda item: item == NO_ITEM)
    return Shares(tuple(name for name in known if name in used), {item: dict(times[item]) for item in order})


def _slice_time(
    activations: Sequence[Activation], run_end: float
) -> Iterator[tuple[float, float, list[Activation]]]:
    """Yield start and end of each interval between changes, and its skills in order of their start."""
    upcoming = deque(
        sorted(
            (activation for activation in activations if activation.end > activation.start),
            key=lambda activation: activation.start,
        )
    )
    times = sorted(
        {0.0, run_end, *(time for activation in activations for time in (activation.start, activation.end))}
    )
    running: list[Activation] = []
    for start, end in pairwise(times):
        running = [activation for activation in running if activation.end > start]
        while upcoming and upcoming[0].start <= start:
            running.append(upcoming.popleft())
        yield start, end, running


def _classify(running: Sequence[Activation], skills: Mapping[str, OutlineNode]) -> str:
    """Return the activity while no running skill has an object."""
    nodes = [skills[activation.node] for activation in running]
    return LOOK if any(node.senses or "arm" in node.uses for node in nodes) else WAITING


def _find_next_item(decisions: Sequence[tuple[float, str]], now: float) -> str:
    """Return the object of the first decision at or after a time [s]."""
    place = bisect_left(decisions, (now, ""))
    return decisions[place][1] if place < len(decisions) else NO_ITEM


def _find_retries(
    activations: Sequence[Activation],
    skills: Mapping[str, OutlineNode],
    decisions: Sequence[tuple[float, str]],
) -> dict[str, tuple[float, float]]:
    """Return start and end of the failed attempts [s], by item."""
    failed = {
        activation.item: activation.end
        for activation in activations
        if activation.item and activation.status == "FAILURE"
        if skills[activation.node].uses and not skills[activation.node].senses
    }
    retries = {}
    for item, last in failed.items():
        decided = [time for time, name in decisions if name == item]
        first = min(
            decided, default=min(activation.start for activation in activations if activation.item == item)
        )
        # Looks that led to the next attempt are the price of the failed one.
        retries[item] = first, next((time for time in decided if time > last), last)
    return retries
