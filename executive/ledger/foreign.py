"""Objects that no item stands for: detections with ignored or undeclared labels, and obstacles."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from executive.cell.config import LedgerConfig
from executive.cell.frame import Detections, Observation
from executive.cell.objects import Bin, ObjectClass, Target
from executive.geometry import Array
from executive.ledger.coverage import Coverage
from executive.ledger.item import ItemRecord
from executive.ledger.look import AMBIGUITY_FACTOR

BODY_LOOK_COUNT = 5
"""Number of looks after which an object of no item that was not detected again is forgotten. It is less than
the attempts of the library, so that an obstacle that is no longer there costs no object."""
MAX_BODY_WIDTH = 0.5
"""Maximum width of the box of an ignored object, as a fraction of the searched region's width; a wider box
shows the table or a tray, on which the objects lie."""
MIN_LOOKS_WITHOUT_CLASS = 3
"""Minimum number of looks that show an item of no class before the table counts as searched."""


@dataclass(eq=False)
class ForeignObjects:
    """Records detections whose labels the cell file ignores or does not declare, and other obstacles.

    Attributes:
        config: Thresholds of the ledger.
        bins, classes: The bins by name, and the classes by label.
        coverage: Knows the workspace.
        ignored_labels: Labels that are not in the cell file, of objects that may lie on the table.
        ignored_positions: Positions `(3,)` [m] of all detections with an ignored label so far.
        unknown_labels: Other labels that are not in the cell file, each with its maximum number of boxes per
            frame.
        bodies: Objects of no item: position `(3,)` [m], and number of further looks until it is forgotten.
    """

    config: LedgerConfig
    bins: Mapping[str, Bin]
    classes: Mapping[str, ObjectClass]
    coverage: Coverage
    ignored_labels: Collection[str]
    ignored_positions: list[Array] = field(default_factory=list)
    unknown_labels: Counter[str] = field(default_factory=Counter)
    bodies: list[tuple[Array, int]] = field(default_factory=list)

    @property
    def positions(self) -> list[Array]:
        """Position `(3,)` [m] of each object of no item, the last one first."""
        return [position for position, _ in reversed(self.bodies)]

    def forget_old(self) -> None:
        """Count a look, and forget objects that too many looks did not show again."""
        self.bodies = [(position, count - 1) for position, count in self.bodies if count > 1]

    def record_unknown_labels(self, detections: Detections) -> None:
        """Count the boxes of a frame with labels that are neither declared nor ignored."""
        labels = (detection.label for detection in detections.unknown)
        self.unknown_labels |= Counter(label for label in labels if label not in self.ignored_labels)

    def record_ignored(
        self, detections: Detections, observations: Sequence[Observation], targets: Collection[Target]
    ) -> None:
        """Record the observations with an ignored label; `targets` are the known objects on the table."""
        for entry in (each for each in observations if each.detection.label in self.ignored_labels):
            self.ignored_positions.append(entry.position)
            box = entry.detection.box
            is_object = box[2] - box[0] < MAX_BODY_WIDTH * (detections.area[2] - detections.area[0])
            if is_object and self.coverage.is_in_workspace(entry.position):
                self.add(entry.position, targets)

    def add(self, position: Array, targets: Collection[Target]) -> None:
        """Record an object of no item at `position` `(3,)` [m], unless an item or a bin is there."""
        if self.is_separate(position, [target for target in targets if target.label]):
            self.bodies.append((position, BODY_LOOK_COUNT))

    def omit_ignored(self, observations: Sequence[Observation]) -> list[Observation]:
        """Return the observations without those with an ignored label."""
        return [entry for entry in observations if entry.detection.label not in self.ignored_labels]

    def omit_redundant(
        self, observations: Sequence[Observation], targets: Collection[Target]
    ) -> list[Observation]:
        """Return the observations without those of undeclared labels that show no further object to sort.

        Such an observation is near another observation or one of `targets`, the known objects on the table,
        or it is outside of the workspace.
        """
        kept = [entry for entry in observations if entry.detection.label not in self.unknown_labels]
        items = [each for each in targets if each.label not in ("", *self.unknown_labels)]
        for entry in (entry for entry in observations if entry.detection.label in self.unknown_labels):
            is_separate = self.is_separate(entry.position, (*items, *kept))
            if is_separate and self.coverage.is_in_workspace(entry.position):
                kept.append(entry)
        return kept

    def is_separate(self, position: Array, targets: Collection[Target | Observation]) -> bool:
        """Return True if `position` `(3,)` [m] is neither in a bin nor at one of `targets`.

        Positions higher than the tallest class above the centre of a target show another, taller object.
        """
        radii = [each.radius for each in self.classes.values()]
        margin = max([AMBIGUITY_FACTOR * self.config.gate, *radii])
        is_in_bin = any(bin.contains(position, margin) for bin in self.bins.values())
        height = max((each.height for each in self.classes.values()), default=math.inf)
        near = [each for each in targets if math.dist(position[:2], each.position[:2]) <= margin]
        return not is_in_bin and all(position[2] > each.position[2] + height for each in near)

    def needs_look(self, record: ItemRecord) -> bool:
        """Return True if too few looks showed an item; no touch proves an item of no class."""
        if record.label not in self.unknown_labels:
            return not record.belief.look_count
        return record.belief.look_count < MIN_LOOKS_WITHOUT_CLASS or record.belief.miss_probability < 1.0
