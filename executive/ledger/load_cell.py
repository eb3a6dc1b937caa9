"""Weighing of items, and checks of the load cell: its zero, and its gain by an object of a known class."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from executive.cell.objects import ObjectClass
from executive.ledger.certainty import MIN_LOG_RATIO_OF_WEIGHT, Certainty
from executive.ledger.item import ItemRecord
from executive.ledger.unexplained import Unexplained
from executive.perception import evidence


class Weighing(NamedTuple):
    """Item whose class a weighing determined, its weight and the error of the weight [N]."""

    record: ItemRecord
    weight: float
    std: float


class LoadCell:
    """Determines the class of items by their weight, and reports a load cell that may be wrong.

    Args:
        classes: The classes by label.
        certainty: Decides whether the class of an item is certain.
        unexplained: Receives the reports.

    Attributes:
        empty_load: Last load of the empty tool, before an approach or after a release [N].
    """

    def __init__(
        self, classes: Mapping[str, ObjectClass], certainty: Certainty, unexplained: Unexplained
    ) -> None:
        self.empty_load = 0.0
        self._classes = classes
        self._certainty = certainty
        self._unexplained = unexplained
        self._is_gain_proved: bool | None = None
        """True if an object was weighed whose class the looks prove; None before the first weighing."""
        self._problem = ""
        """Sentence on the last object whose class the looks prove, if its weight contradicts the class."""
        self._last_weighing: Weighing | None = None

    @property
    def assumption(self) -> str:
        """Sentence on what the weights assume; "" if a known object proved the gain, or without weights."""
        text = "the load cell has the right gain: no known object proved it"
        return text if self._is_gain_proved is False else ""

    def record_empty_load(self, load: float) -> None:
        """Record the load of the empty tool [N], and report an item whose class another zero contradicts."""
        shift = load - self.empty_load
        self.empty_load = load
        if self._last_weighing is None:
            return
        last = self._last_weighing
        self._last_weighing = None
        log_ratios = evidence.compute_weight_log_ratios(last.weight - shift, last.std, self._classes)
        if log_ratios[last.record.label] < MIN_LOG_RATIO_OF_WEIGHT:
            item = last.record.item
            text = f"the load cell's zero moved by {shift:+.2f} N; {item} may be no {last.record.label}"
            self._unexplained.report(f"weight of {item}", text)

    def record_weight(self, record: ItemRecord, weight: float, std: float) -> str:
        """Determine the class of an item by its weight, with the standard deviation `std` [N].

        Return "" if the class is then certain, otherwise a sentence that states the contradiction.
        """
        is_proved = self._is_class_proved_by_looks(record)
        self._is_gain_proved = self._is_gain_proved or is_proved
        label_map = {label: other.detected_label for label, other in self._classes.items()}
        record.belief.add_weighing(evidence.compute_weight_log_ratios(weight, std, self._classes), label_map)
        contradiction = "" if is_proved else self._problem
        if not self._certainty.is_class_certain_by_weight(record):
            contradiction = evidence.describe_weight(weight, record.label, self._classes)
        if is_proved:
            self._problem = contradiction and f"the load cell may be wrong: {record.item}: {contradiction}"
        text = self._problem and f"{self._problem}; others may be wrong, too"
        self._unexplained.report("load cell", text)
        if contradiction:
            record.last_contradiction = contradiction
        else:
            self._last_weighing = Weighing(record, weight, std)
        return contradiction

    def _is_class_proved_by_looks(self, record: ItemRecord) -> bool:
        """Return True if an item's class is certain without its weight, which the cell declares."""
        alike = [each for each in self._classes.values() if each.detected_label == record.detected_label]
        has_known_mass = len(alike) == 1 and math.isfinite(alike[0].mass_std)
        return has_known_mass and self._certainty.is_class_certain(record)
