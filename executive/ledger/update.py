"""What a look adds to the books: who was seen, who was not, and who turned up elsewhere."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from executive.cell.config import LedgerConfig
from executive.cell.detection import Detections, Observation
from executive.cell.frame import Frame
from executive.cell.objects import Item
from executive.geometry import Array
from executive.ledger.coverage import Coverage
from executive.ledger.independence import viewpoint_of
from executive.ledger.item import LIKELY, LYING, NEARBY, NOTHING, UNSURE, Record, State
from executive.ledger.staleness import Freshness

SURE = 3.5
"""Standard deviations within which two measurements of one place lie, all but one in a thousand times."""
EXPECTED = 3.0
"""Objects on a table before anybody has looked: the order of magnitude is what counts."""
FAR_OFF = 1.5
"""How many times as far as it may be for certain an item may still be off, now and then."""
NUDGED = 0.12
"""How far from its place somebody may push an item, for what turns up there to be taken for it [m]."""
GONE = 0.05
"""Chance of having been overlooked under which an item that may have been pushed is sought elsewhere."""

Items = dict[Item, Record]
"""All items by name."""


class Looks:
    """Binds detections to items and weighs what they and their absence say.

    Args:
        config: When what is believed.
        coverage: Where something may still be overlooked.
        freshness: Where something may have moved.
    """

    def __init__(self, config: LedgerConfig, coverage: Coverage, freshness: Freshness) -> None:
        self._config = config
        self._coverage = coverage
        self._freshness = freshness
        self._counts: Counter[str] = Counter()

    def settled(self, record: Record) -> bool:
        """Tell whether nothing has put an item's place in doubt since it was seen."""
        return self._freshness.holds(record.position, record.epoch)

    def take(
        self, records: Items, detections: Detections, observations: Sequence[Observation]
    ) -> list[Record]:
        """Take a look into the books and return the items that changed by it.

        Args:
            records: All items by name; new ones are entered.
            detections: The look.
            observations: Its detections on the table.
        """
        frame, by, viewpoint = detections.frame, detections.error_rates, viewpoint_of(detections)
        current = [one for one in observations if self._freshness.holds(one.position, frame.epoch)]
        found = [one for one in current if one.confident]
        known = [record for record in records.values() if record.state in LYING]
        # What may have been an invention all along, and pushed since, is not what lies there now.
        trusted = [record for record in known if self.settled(record) or record.probability >= 0.5]
        bound = _bind(
            trusted, found, gate=self._config.gate, settled=self.settled,
        )  # fmt: skip
        absent = [record for record in trusted if record not in bound.values()]
        seen: list[Record] = []
        for index, one in enumerate(found):
            detection, place = one.detection, one.position
            record = bound.get(index)
            if record is None:
                # The less likely an object was overlooked there, the likelier it is invented.
                odds = EXPECTED * self._coverage.find_miss_probability(place) / by.invented
                record = self._enter(records, detection.label, place, odds)
            if record.why.startswith(UNSURE) and not record.attempts:
                record.state, record.why = State.SEEN, ""
            if not self.settled(record):
                record.forget_answers()
            alone = not self._may_be_of(absent, one)
            record.vote(detection.label, by, viewpoint, alone=alone)
            record.locate(place, one.std, settled=self.settled(record))
            record.shown(frame, detection)
            seen.append(record)
        unsure = [one for one in current if not one.confident]
        glimpsed = self._glimpsed(records, seen, frame, unsure)
        missed = self._missed(known, [*seen, *glimpsed], detections)
        # Once it is given up, what lies there is known as well as it will ever be.
        self._coverage.update(detections, [r.position for r in glimpsed if r.state is State.SEEN])
        recognized = self._recognize(records, seen)
        changed = [*seen, *glimpsed, *missed, *recognized, *self._one_of_two(records, seen)]
        return list({id(record): record for record in changed}.values())

    def _may_be_of(self, records: Sequence[Record], one: Observation) -> bool:
        """Tell whether what seems to be at a place may be one of these items, seen a little off."""
        return any(
            float(np.linalg.norm(record.position - one.position))
            <= FAR_OFF * reach(record, one.std, self._config.gate)
            for record in records
        )

    def _enter(self, records: Items, label: str, place: Array, odds: float) -> Record:
        """Enter something new, with the odds that it is an object."""
        self._counts[label] += 1
        appeared = self._coverage.find_miss_probability(place) <= self._config.overlooked
        record = Record(f"{label}-{self._counts[label]}", label, place, math.log(odds), appeared=appeared)
        records[record.item] = record
        return record

    def _glimpsed(
        self, records: Items, seen: Sequence[Record], frame: Frame, unsure: Sequence[Observation]
    ) -> list[Record]:
        """Count what the detector is not sure of, and return the items that it may be.

        It may be any item at that place, which the look did not miss then, or a new one, if something may
        have been overlooked there. A second, weaker box on what was seen for sure is nothing.
        """
        counted: list[Record] = []
        for glimpse in unsure:
            place = glimpse.position
            if self._may_be_of(seen, glimpse):
                continue
            lying = [
                record
                for record in records.values()
                if record.state in LYING and record.overlooked > self._config.overlooked
            ]
            there = [record for record in lying if self._may_be_of([record], glimpse)]
            record = min(there, key=lambda r: float(np.linalg.norm(r.position - place)), default=None)
            if record is None:
                odds = EXPECTED * NEARBY * self._coverage.find_miss_probability(place)
                if odds <= self._config.overlooked:
                    continue
                record = self._enter(records, glimpse.detection.label, place, odds)
                record.locate(place, glimpse.std, settled=True)
                record.shown(frame, glimpse.detection)
            if record not in counted:
                # Evidence against another class says nothing against this one.
                is_its_class = glimpse.detection.label == record.label
                record.glimpsed(glimpse.contradiction if is_its_class else "")
                counted.append(record)
        return counted

    def _missed(self, known: Sequence[Record], seen: Sequence[Record], look: Detections) -> list[Record]:
        """Weigh that items were not seen where the look searched, and return those that proved phantoms."""
        unseen = [
            record
            for record in known
            if record not in seen and self._freshness.holds(record.position, look.frame.epoch)
        ]
        if not unseen:
            return []
        phantoms = []
        searched = look.is_searched(np.array([record.position for record in unseen]))
        for record, there in zip(unseen, searched, strict=True):
            if there:
                record.miss(look.error_rates)
            if there and not record.exists and record.probability <= self._config.overlooked:
                record.state, record.why = State.PHANTOM, NOTHING
                phantoms.append(record)
        return phantoms

    def _recognize(self, records: Items, seen: list[Record]) -> list[Record]:
        """Recognize items that were dropped or pushed away in new ones of their class, the nearest first.

        They take the places of the new ones in `seen`; the new ones that were known before are returned.
        """
        doubles = []
        for place, new in enumerate(seen):
            if new.state is not State.SEEN or new.attempts or new.probability < LIKELY:
                continue
            # Whose class is not sure yet may be another one: what fell near by, misread.
            if new.misjudged > self._config.misjudged:
                continue
            missing = [old for old in records.values() if self._may_be(old, new)]
            if missing:
                old = min(missing, key=lambda r: float(np.linalg.norm((r.position - new.position)[:2])))
                old.become(new)
                seen[place] = old
                if new.since == new.stamp:
                    del records[new.item]
                else:
                    new.state, new.why = State.PHANTOM, f"it is {old.item}"
                    doubles.append(new)
        return doubles

    def _one_of_two(self, records: Items, seen: list[Record]) -> list[Record]:
        """Make one of every two items closer than two objects can be; return those that were none."""
        doubles = []
        for record in list(seen):
            if record.state is not State.SEEN:
                continue
            for other in records.values():
                near = float(np.linalg.norm(other.position - record.position)) < self._config.gate
                if other is record or other.state is not State.SEEN or not near:
                    continue
                less, more = sorted((record, other), key=lambda r: (r.exists, self.settled(r), r.looks))
                less.state, less.why = State.PHANTOM, f"it is {more.item}"
                doubles.append(less)
                break
        return doubles

    def _may_be(self, old: Record, new: Record) -> bool:
        """Tell whether a new item may be one that is not where it was.

        The robot may have pushed it anywhere; somebody else, not far. A phantom may be one, too, if the robot
        tried to pick it: it has vanished since.
        """
        if old is new or old.label != new.label:
            return False
        if old.state is State.DROPPED:
            return new.entered > old.epoch
        pushed = self._freshness.disturbed(old.position, old.epoch)
        apart = float(np.linalg.norm((old.position - new.position)[:2]))
        moved = new.entered >= pushed if pushed is not None else False
        nudged = apart <= NUDGED and new.since > old.stamp and old.overlooked <= self._config.overlooked
        vanished = old.state is State.PHANTOM and old.why == NOTHING and old.attempts > 0
        missing = (old.state in LYING or vanished) and old.overlooked <= GONE and old.last_probability >= 0.5
        return missing and (moved or nudged)


def reach(record: Record, spread: float, gate: float) -> float:
    """Return how far from an item [m] a detection of it may be localized.

    At least `gate`, more where the measurements scatter more, and at most twice that.

    Args:
        record: The item.
        spread: Standard deviation of the new measurement along each axis [m].
        gate: Distance that is always allowed [m].
    """
    return min(max(gate, SURE * math.hypot(record.spread, spread)), 2 * gate)


def _bind(
    records: Sequence[Record],
    found: Sequence[Observation],
    *,
    gate: float,
    settled: Callable[[Record], bool],
) -> dict[int, Record]:
    """Return the item of each detection that lies where a known one was seen, by the detection's index.

    Each round is over what the ones before have left. Items that nothing has disturbed come first, of the
    same class and then of any (the class is evidence, not identity). Then, of the same class and of any,
    those that may have been pushed and still are about where they were.
    """
    bound: dict[int, Record] = {}

    def assign(candidates: Sequence[Record], same_class: bool) -> None:
        taken = {id(record) for record in bound.values()}
        pairs = sorted(
            (float(np.linalg.norm(record.position - found[index].position)), index, order)
            for order, record in enumerate(candidates)
            for index in range(len(found))
            if index not in bound
            and id(record) not in taken
            and (not same_class or record.label == found[index].detection.label)
        )
        for distance, index, order in pairs:
            record = candidates[order]
            allowed = reach(record, found[index].std, gate)
            if distance <= allowed and index not in bound and id(record) not in taken:
                bound[index] = record
                taken.add(id(record))

    quiet = [record for record in records if settled(record)]
    pushed = [record for record in records if not settled(record)]
    for candidates in (quiet, pushed):
        for same_class in (True, False):
            assign(candidates, same_class)
    return bound
