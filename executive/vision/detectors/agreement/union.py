"""Several answers about one frame as one, where they do not contradict each other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from executive.errors import Unavailable
from executive.messages import Answer, Detection, Reliability
from executive.vision.detectors.views import iou

SAME = 0.5
"""Overlap from which two boxes of different detectors are one object."""
TOLD = 2
"""How many contested objects are told of."""


@dataclass(frozen=True)
class Sighting:
    """What one detector says about an object.

    Attributes:
        by: Name of the detector.
        detection: What it sees, at or above its threshold.
    """

    by: str
    detection: Detection


Seen = list[Sighting]
"""One object: at most one sighting by each detector."""


def unite(name: str, answers: Mapping[str, Answer]) -> Answer:
    """Return what several detectors say together about one frame, as the answer of the one called `name`.

    It has every object that any of them counts, as the first of them sees it, and the doubts of all: the
    boxes under every threshold. A box that does not count for the detector that drew it, but would by
    another one's threshold, is left out.

    Args:
        name: Detector whose answer it becomes.
        answers: What each detector says, by name.

    Raises:
        Unavailable: They give an object different classes.
    """
    objects = _objects(answers)
    contested = [seen for seen in objects if _against(seen)]
    if contested:
        raise Unavailable(_contradiction(list(answers), contested, len(objects)))
    reliability = together([answer.reliability for answer in answers.values()])
    found = [seen[0].detection for seen in objects]
    for answer in answers.values():
        found += [one for one in answer.found if one.confidence < reliability.threshold]
    found.sort(key=lambda detection: -detection.confidence)
    return Answer(name, tuple(found), reliability)


def together(members: Sequence[Reliability]) -> Reliability:
    """Return how the union of several detectors' answers errs, where they do not contradict each other.

    It overlooks at most what the best of them overlooks: the product of their misses would claim an
    independence that nobody has measured. It invents what each of them invents. Where only one of them sees
    an object, nobody confirms its class and its box, so that the worst figure holds for both.
    """
    return Reliability(
        threshold=min(one.threshold for one in members),
        misses=min(one.misses for one in members),
        confused=max(one.confused for one in members),
        invented=sum(one.invented for one in members),
        jitter=max(one.jitter for one in members),
    )


def _objects(answers: Mapping[str, Answer]) -> list[Seen]:
    objects: list[Seen] = []
    for name, answer in answers.items():
        counted = [one for one in answer.found if one.confidence >= answer.reliability.threshold]
        _enter(objects, [Sighting(name, one) for one in counted])
    return objects


def _enter(objects: list[Seen], sightings: Sequence[Sighting]) -> None:
    """Put every sighting of one detector to the object it overlaps most, one to one, or to a new object."""
    overlaps = [
        (_overlap(seen, sighting), place, index)
        for place, seen in enumerate(objects)
        for index, sighting in enumerate(sightings)
    ]
    taken: set[int] = set()
    placed: set[int] = set()
    for overlap, place, index in sorted(overlaps, key=lambda pair: -pair[0]):
        if overlap >= SAME and place not in taken and index not in placed:
            taken.add(place)
            placed.add(index)
            objects[place].append(sightings[index])
    objects += [[sighting] for index, sighting in enumerate(sightings) if index not in placed]


def _overlap(seen: Seen, sighting: Sighting) -> float:
    return max(iou(other.detection.box, sighting.detection.box) for other in seen)


def _against(seen: Seen) -> Sighting | None:
    """Return the first sighting that gives an object another class than the first one does."""
    return next((other for other in seen if other.detection.label != seen[0].detection.label), None)


def _contradiction(names: Sequence[str], contested: Sequence[Seen], objects: int) -> str:
    told = [_two_views(seen[0], other) for seen in contested if (other := _against(seen))]
    if len(told) > TOLD:
        told = [*told[:TOLD], f"and {len(told) - TOLD} more"]
    return f"{_listed(names)} disagree about {len(contested)} of {objects} objects: {', '.join(told)}"


def _two_views(one: Sighting, other: Sighting) -> str:
    return (
        f"{one.by} sees a {one.detection.label} where {other.by} sees a {other.detection.label} "
        f"({one.detection.confidence:.2f}, {other.detection.confidence:.2f})"
    )


def _listed(names: Iterable[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} and {last}"
