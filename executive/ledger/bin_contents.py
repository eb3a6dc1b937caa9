"""Contents of the bins: numbers of objects, items that an image shows, and items that fell into a bin."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from executive.cell.config import LedgerConfig
from executive.cell.frame import BinAppearance, Detections, ErrorRates, Frame, Observation
from executive.cell.ledger import Presence
from executive.cell.objects import BIN_THICKNESS, Bin, Item, ObjectClass, Quotas, is_quota_reached
from executive.cell.protocols import Routes
from executive.geometry import Array
from executive.ledger.belief import make_viewpoint_key
from executive.ledger.certainty import REASON_CONTRADICTED
from executive.ledger.item import ItemRecord, ItemRecords, State
from executive.ledger.look import MAX_STANDARD_DEVIATIONS

REASON_PROBABLY_FELL = "it probably fell into the bin"
"""Reason of the state PLACED of a dropped item that no look has shown in the bin."""
WALL_MARGIN = 0.035
"""Minimum distance from the walls at which an object that lands in a bin certainly stays there [m]."""
LOG_ODDS_FELL_IN_BIN = math.log(0.95 / 0.05)
"""Prior log odds that a dropped item lies in the bin over which it was predicted to land."""
BIN_AREA_FRACTION = 0.04
"""Fraction of an image that a bin covers: probability that a false detection lies in the bin."""
MIN_CHANGED_FRACTION = 0.5
"""Minimum change of the visible area in a bin, as a fraction of the area of the smallest class."""
MIN_AREA_FACTORS = (0.5, 0.9)
"""Minimum visible area of an object in a bin: as a multiple of the area of its outline from above, and, of a
prism with a flat top, as a multiple of the visible area at its slot or, if less, at the centre of the bin."""
MAX_AREA_FACTORS = (1.7, 1.4)
"""Maximum visible area, as a multiple of the circle around an object, and of the visible area of a prism.

In 700 views of whole bins in the cells depth, wrist, overhead_large and fasteners, the contents covered 0.6
to 2.2 times the outlines of the items, cubes at least 1.48 times, and 0.3 to 1.46 times their circles. In the
cells of grippers, a cube that turns an edge to the camera at the far side of a bin covered 1.62 circles.
Washers of the brightness of the floor cover least.
"""
MIN_LOOKS_AT_ITEM_LEFT_BEHIND = 2
"""Minimum number of looks that prove an item at a place from which another item was picked."""
FLOOR_POINTS = np.array([(0, 0, 0), (1, 1, 0), (1, -1, 0), (-1, 1, 0), (-1, -1, 0)])
"""Points of a bin's floor that must be visible, in units of half its length and half its width `(5, 3)`."""

BinItems = Mapping[Item, tuple[float, float]]
"""Items in a bin, each with the least and the greatest area of the floor that it may hide [m²]."""
BinNameByObservation = Mapping[Observation, str | None]
"""Name of the bin in which each observed object lies, or None."""


@dataclass(eq=False)
class BinView:
    """What the last image of a whole bin showed in it; of a new bin: nothing.

    Attributes:
        items: Items in the bin according to the ledger.
        area: Area that differs from the floor [m²].
        suspect: A later image that showed more or less than the robot brought, or None.
        change: Sentence on what the suspect image showed, or "".
    """

    items: BinItems = field(default_factory=dict)
    area: float = 0.0
    suspect: BinView | None = None
    change: str = ""


@dataclass(eq=False)
class BinContents:
    """Bins of the cell, and estimates of the items in them.

    Attributes:
        config: Thresholds of the ledger, from the cell file.
        bins: Bins by name.
        routes: Names of the permitted bins by class.
        records: All items.
        quotas: Maximum numbers of objects in the bins.
        contradictions: What the last image of a bin shows, by name of the bin: "" if the bin is as declared.
        classes: Classes of the cell by label.
        surplus_counts: Maximum number of objects that full images showed beside the items, by detected class
            and bin.
        known_bins: Names of the bins whose contents images showed before an item was dropped.
        views: What images show, by name of the bin.
    """

    config: LedgerConfig
    bins: Mapping[str, Bin]
    routes: Routes
    records: ItemRecords
    quotas: Quotas
    classes: Mapping[str, ObjectClass]
    contradictions: dict[str, str] = field(default_factory=dict)
    surplus_counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    known_bins: set[str] = field(default_factory=set)
    views: dict[str, BinView] = field(default_factory=dict)

    def count_objects_in(self, bin_name: str, label: str | None = None) -> int:
        """Return the number of items that were released in a bin or have probably fallen into the bin.

        `label` restricts the count to one class.
        """
        records = self.list_records_in(bin_name)
        return len(records) if label is None else sum(record.label == label for record in records)

    def list_records_in(self, bin_name: str) -> list[ItemRecord]:
        """Return the items that were released in a bin or have probably fallen into the bin."""
        return [each for each in self.records.all if bin_name in (each.bin, find_probable_bin(each))]

    def archive_items(self, bins: Collection[str]) -> None:
        """Archive the items in bins that were emptied, and all phantoms that cannot become an item again."""
        for record in self.records.filter_by_state(State.DROPPED):
            if (bin_name := find_probable_bin(record)) and bin_name in bins:
                record.reason = REASON_PROBABLY_FELL
                self.records.set_placed(record, bin_name)
        for bin_name in bins:
            self.views.pop(bin_name, None)
        placed = [each for each in self.records.filter_by_state(State.PLACED) if each.bin in bins]
        phantoms = self.records.filter_by_state(State.PHANTOM)
        # A phantom after a failed pick may be an object that the pick pushed away.
        for key in [key for key in self.surplus_counts if key[1] in bins]:
            del self.surplus_counts[key]
        self.records.archive(
            [*placed, *(each for each in phantoms if not (each.failed_pick_count or each.may_have_left))]
        )

    def count_placed(self, detected_label: str, bin_name: str) -> int:
        """Return the number of items placed in a bin whose class the detectors report as `detected_label`."""
        return sum((item.detected_label, item.bin) == (detected_label, bin_name) for item in self.records.all)

    def explain_skipped_class(self, label: str) -> str:
        """Return the reason why the mission does not sort objects of a class, or ""."""
        all_names = self.routes.get(label, ())
        bin_names = [name for name in all_names if not self.contradictions.get(name)]
        if not all(is_quota_reached(self.quotas, name, label, self.count_objects_in) for name in bin_names):
            return ""
        if not all_names:
            return "the mission has no route for it"
        if contradicted_names := [name for name in all_names if name not in bin_names]:
            return f"{REASON_CONTRADICTED} {', '.join(contradicted_names)}"
        subject, verb = ("quota", "is") if len(bin_names) == 1 else ("quotas", "are")
        return f"the {subject} of {', '.join(bin_names)} {verb} reached"

    def find_next_slot_index(self, bin_name: str) -> int:
        """Return the index after the last used slot of a bin, but at least the number of objects in it."""
        slots = [record.slot for record in self.records.all if record.bin == bin_name]
        return max([self.count_objects_in(bin_name), *(slot + 1 for slot in slots if slot is not None)])

    def measure_slot_distance(self, record: ItemRecord, observations: Sequence[Observation]) -> float:
        """Return the distance of the nearest observation from the slot of a placed item [m]; inf if none."""
        slot = self.get_slot(record)
        return min((math.dist(slot, entry.position[:2]) for entry in observations), default=math.inf)

    def get_slot(self, record: ItemRecord) -> Array:
        """Return the slot `(2,)` [m] of an item in a bin; the centre of the bin if the item fell into it."""
        bin = self.bins[record.bin]
        return bin.position[:2] if record.slot is None else bin.slots[record.slot % len(bin.slots)]

    def find_bin_name(self, observation: Observation, bias_std: float) -> str | None:
        """Return the name of the bin in which an observed object lies, or None.

        A bin that contains items is enlarged by the measurement error. `bias_std` is the standard deviation
        of the systematic measurement error along each axis [m].
        """
        max_error = MAX_STANDARD_DEVIATIONS * math.hypot(observation.std, bias_std)
        for name, bin in self.bins.items():
            is_near = bin.contains(observation.position, max_error)
            if is_near and (bin.contains(observation.position) or self.count_objects_in(name)):
                return name
        return None

    def set_prior_log_odds(self, record: ItemRecord, landing: Array | None) -> None:
        """Set the prior log odds that a dropped item lies in each permitted bin.

        `landing` is the predicted landing position `(3,)` [m]; None: unknown.
        """
        record.bin_log_odds.clear()
        for bin_name in self.routes.get(record.label, ()):
            if landing is not None and self.bins[bin_name].contains(landing, -WALL_MARGIN):
                record.bin_log_odds[bin_name] = LOG_ODDS_FELL_IN_BIN

    def mark_dropped_items_as_placed(self, detections: Detections, bin_names: BinNameByObservation) -> None:
        """Set dropped items that almost certainly lie in a permitted bin to PLACED.

        If the detections in a full image contain more objects of a class in a bin than the ledger, one of the
        objects may be a dropped item.
        """
        visible_counts = self.count_visible_objects(bin_names)
        rates = detections.error_rates
        for record in self.records.filter_by_state(State.DROPPED):
            for bin_name in self.routes.get(record.label, ()):
                label = record.detected_label
                known_count = self.count_placed(label, bin_name) + self.surplus_counts[label, bin_name]
                is_known = bin_name in self.known_bins
                has_additional_object = is_known and visible_counts[label, bin_name] > known_count
                if has_additional_object or self.is_floor_visible(bin_name, detections):
                    update_bin_log_odds(record, bin_name, rates, has_additional_object=has_additional_object)
                if record.bin_log_odds[bin_name] >= -math.log(self.config.max_miss_probability):
                    record.reason = ""
                    record.mark_as_detected_in_bin(detections.frame)
                    self.records.set_placed(record, bin_name)
                    break

    def count_visible_objects(self, bin_names: BinNameByObservation) -> Counter[tuple[str, str]]:
        """Return the number of confident observations in bins, by detected class and bin."""
        # The centre of an object that leans on a wall from the inside may lie over the wall.
        return Counter(
            (observed.detection.label, name)
            for observed, name in bin_names.items()
            if observed.is_confident and name and self.bins[name].contains(observed.position, BIN_THICKNESS)
        )

    def record_surplus(self, detections: Detections, bin_names: BinNameByObservation) -> None:
        """Record the objects in bins in a full image that no item explains, unless an item was dropped."""
        if self.records.filter_by_state(State.DROPPED):
            return
        for key, count in self.count_visible_objects(bin_names).items():
            self.surplus_counts[key] = max(self.surplus_counts[key], count - self.count_placed(*key))
        self.known_bins.update(name for name in self.bins if self.is_floor_visible(name, detections))

    def compare_contents(self, appearances: Mapping[str, BinAppearance], frame: Frame) -> dict[str, str]:
        """Return sentences on bins in which two images show more or less than the robot brought.

        The sentences are by name of the bin, `appearances` are those of `Camera.inspect_bins(frame)`. While
        the position of an item is unknown, it may be in any bin.
        """
        changes: dict[str, str] = {}
        if self.records.filter_by_state(State.DROPPED):
            return changes
        held_items = self.records.filter_by_state(State.HELD)
        target_bins = {name for item in held_items for name in self.routes.get(item.label, ())}
        for name, (_, area, is_whole) in appearances.items():
            # The tool may have released a held item just now.
            if area is None or name in target_bins:
                continue
            records = self.list_records_in(name)
            items = {record.item: self.predict_area(record, frame.X_WC.position) for record in records}
            view = self.views.setdefault(name, BinView())
            new_view = BinView(items, area)
            verb = self.find_change(name, view, new_view, is_whole=is_whole)
            if is_whole and not items and area < self.min_change:
                self.known_bins.add(name)
            change = f"something {verb} {name}, and the robot did not do it" if verb else ""
            if change and change == view.change:
                changes[name] = change
            elif change:
                # One image may show the shadow of the arm.
                view.suspect = new_view
                view.change = change
            # An object that the robot brought may hide the difference between the suspect view and its base.
            is_refuted = view.suspect and self.find_change(name, view.suspect, new_view, is_whole=True)
            if is_whole and (name in changes or (not change and (is_refuted or not view.suspect))):
                self.views[name] = new_view
        return changes

    @property
    def min_change(self) -> float:
        """Least change of the visible area that an image proves, if the robot brought nothing [m²]."""
        return MIN_CHANGED_FRACTION * math.pi * min(each.radius for each in self.classes.values()) ** 2

    def find_change(self, bin_name: str, old: BinView, new: BinView, *, is_whole: bool) -> str:
        """Return what happened to something between two views that no item explains; "" for nothing.

        If the new view is not whole, it may show less than lies in the bin.
        """
        added = [new.items[item] for item in new.items.keys() - old.items.keys()]
        removed = [old.items[item] for item in old.items.keys() - new.items.keys()]
        # An item on others hides them.
        free_count = max(0, len(self.bins[bin_name].slots) - len(old.items))
        lows = sorted(low for low, _ in added)[:free_count]
        min_growth = sum(lows) - sum(high for _, high in removed) - (0.0 if lows else self.min_change)
        max_growth = sum(high for _, high in added) - sum(low for low, _ in removed)
        growth = new.area - old.area
        if growth > max_growth + (0.0 if added else self.min_change):
            return "came into"
        return "left" if is_whole and growth < min_growth else ""

    def predict_area(self, record: ItemRecord, camera_position: Array) -> tuple[float, float]:
        """Return the least and the greatest area [m²] of the floor that an item in its bin hides.

        A camera beside the bin, at `camera_position` `(3,)` [m], sees a side of the item, too: of an item
        near the camera less, and of an item at the far side at least as much as at the centre of the bin,
        because the wall hides its shadow.
        """
        object_class = self.classes[record.label]
        bin = self.bins[record.bin]
        height = max(camera_position[2] - bin.position[2], 1e-3)
        # Tangents of the angle between the line of sight and the vertical.
        slant = math.dist(camera_position[:2], bin.position[:2]) / height
        min_slant = min(slant, math.dist(camera_position[:2], self.get_slot(record)) / height)
        circle_area = math.pi * object_class.radius**2
        prism_area = object_class.outline_area + object_class.height * slant * 2 * object_class.radius
        high = min(MAX_AREA_FACTORS[0] * circle_area, MAX_AREA_FACTORS[1] * prism_area)
        if object_class.flat_top and object_class.footprint is not None:
            side_area = object_class.height * min_slant * min(object_class.footprint)
            return MIN_AREA_FACTORS[1] * (object_class.outline_area + side_area), high
        return MIN_AREA_FACTORS[0] * object_class.outline_area, high

    def describe_unseen_bins(self) -> str:
        """Return a sentence on the bins with items that no image showed completely, or ""."""
        used_bins = {record.bin for record in self.records.filter_by_state(State.PLACED)}
        shown_bins = {name for name, view in self.views.items() if view.items}
        unseen_bins = sorted(used_bins - shown_bins - {""})
        return f"no image showed all that lies in {', '.join(unseen_bins)}" if unseen_bins else ""

    def discard_items_left_behind(self) -> dict[str, str]:
        """Discard placed items that looks show where they were picked, and return a sentence on each."""
        texts = {}
        for placed in self.records.filter_by_state(State.PLACED):
            if (left := self.find_item_left_behind(placed)) is None:
                continue
            text = f"looks showed {left.item} where {placed.item} had been picked: {placed.bin} received"
            texts[placed.item] = f"{text} another object, or nothing"
            placed.bin = ""
            placed.slot = None
            placed.set_state(State.PHANTOM, f"it is {left.item}")
            self.records.emit(placed)
        return texts

    def find_item_left_behind(self, placed: ItemRecord) -> ItemRecord | None:
        """Return the item that looks showed at the place of a placed item after its pick, or None.

        The result is None if an object of the class that appeared later, or that looks miss elsewhere, may
        have got to the place.
        """
        existing = [each for each in self.records.all if each.state is not State.PHANTOM]
        alike = [each for each in existing if each.detected_label == placed.detected_label]
        if any(each.state is State.DROPPED or each.belief.miss_probability < 1.0 for each in alike):
            return None
        for item in alike:
            is_new = item.first_change_count > placed.change_count and not item.has_appeared
            is_near = math.dist(item.first_position[:2], placed.position[:2]) < self.config.gate
            is_proved = item.had_contact or item.belief.look_count >= MIN_LOOKS_AT_ITEM_LEFT_BEHIND
            if is_new and is_near and is_proved:
                return item
        return None

    def is_floor_visible(self, bin_name: str, detections: Detections) -> bool:
        """Return True if an image shows the whole floor of a bin without occlusion by the arm."""
        bin = self.bins[bin_name]
        half_size = np.append(bin.size[:2] / 2 - WALL_MARGIN, 0.0)
        return bool(detections.compute_searched_mask(bin.position + half_size * FLOOR_POINTS).all())

    def confirm_placed_items(self, detections: Detections, observations: Sequence[Observation]) -> None:
        """Set the time of the last detection of each placed item that an image shows in its bin."""
        for bin_name in self.bins:
            for record, presence in self.find_presences(bin_name, detections, observations).items():
                if record.state is State.PLACED and presence is Presence.PRESENT:
                    record.mark_as_detected_in_bin(detections.frame)

    def update_presence(
        self, record: ItemRecord, detections: Detections, observations: Sequence[Observation]
    ) -> Presence:
        """Record whether one image shows a placed item in its bin, and return the answer of the image."""
        presence = self.find_presences(record.bin, detections, observations)[record]
        if presence is Presence.GONE:
            record.belief.add_miss(
                detections.error_rates, make_viewpoint_key(detections),
                was_detected_here=record.was_detected_in_bin,
            )  # fmt: skip
        elif presence is Presence.PRESENT:
            record.mark_as_detected_in_bin(detections.frame)
            record.belief.miss_probability = 1.0
            record.clear_viewpoints()
        return presence

    def find_presences(
        self, bin_name: str, detections: Detections, observations: Sequence[Observation]
    ) -> dict[ItemRecord, Presence]:
        """Return whether one image shows each placed item of a bin in the bin.

        `GONE` means only that the image does not show the item; the detector may have missed the item. A
        doubtful detection shows an item if the detection has the class of the item and lies at the slot of
        the item. If the image shows fewer objects of the class than the bin contains, the missing items are
        those whose slots are farthest from the shown objects. There are two cases of `UNSURE`: a detection of
        another class in the bin may be the item, or the bin has several layers of objects, and an upper layer
        may hide the item.
        """
        items = [item for item in self.records.all if item.bin == bin_name]
        presences = dict.fromkeys(items, Presence.HIDDEN)
        if not items or not self.is_floor_visible(bin_name, detections):
            return presences
        bias_std = detections.error_rates.bias
        shown = [entry for entry in observations if self.find_bin_name(entry, bias_std) == bin_name]
        has_layers = self.find_next_slot_index(bin_name) > len(self.bins[bin_name].slots)
        for label in {item.detected_label for item in items}:
            alike = [entry for entry in shown if entry.detection.label == label]
            confident = [entry for entry in alike if entry.is_confident]
            distances = {
                item: self.measure_slot_distance(item, confident)
                for item in items
                if item.detected_label == label
            }
            missing_count = len(distances) - len(confident)
            for item, distance in distances.items():
                if distance > self.config.gate >= self.measure_slot_distance(item, alike):
                    distances[item] = 0.0
                    missing_count -= 1
            for rank, item in enumerate(sorted(distances, key=distances.__getitem__, reverse=True)):
                is_unsure = has_layers or rank >= len(items) - len(shown)
                missing = Presence.UNSURE if is_unsure else Presence.GONE
                presences[item] = Presence.PRESENT if rank >= missing_count else missing
        return presences


def find_probable_bin(record: ItemRecord) -> str | None:
    """Return the name of the bin that contains a dropped item with at least 95 % probability, or None."""
    log_odds_by_bin = record.bin_log_odds.items()
    probable_bins = (name for name, log_odds in log_odds_by_bin if log_odds >= LOG_ODDS_FELL_IN_BIN)
    return next(probable_bins, None) if record.state is State.DROPPED else None


def update_bin_log_odds(
    record: ItemRecord, bin_name: str, rates: ErrorRates, *, has_additional_object: bool
) -> None:
    """Update, by one look, the log odds that a dropped item lies in a bin; negative log odds become 0.

    `has_additional_object` is True if the look shows more objects of the item's class in the bin than the
    ledger knows.
    """
    likelihood_ratio = rates.miss_rate
    if has_additional_object:
        likelihood_ratio = (1.0 - rates.miss_rate) / (rates.false_detections * BIN_AREA_FRACTION)
    log_odds = record.bin_log_odds[bin_name] + math.log(likelihood_ratio)
    record.bin_log_odds[bin_name] = max(0.0, log_odds)
