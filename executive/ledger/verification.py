"""Verification that an item is at the place where the ledger believes it to be, by looks at the place.

A look is an image with its detections.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from executive.cell.config import LedgerConfig
from executive.cell.detection import Detections, Observation
from executive.cell.ledger import Presence
from executive.ledger.belief import make_viewpoint_key
from executive.ledger.bin_contents import BinContents
from executive.ledger.item import ON_TABLE, ItemRecord, State


def verify(
    record: ItemRecord,
    look: Detections,
    observations: Sequence[Observation],
    bins: BinContents,
    config: LedgerConfig,
) -> Presence:
    """Return whether an item is at its place, according to this look and to earlier looks.

    The item is gone if the probability that all looks missed it by chance is at most `max_miss_probability`.

    Args:
        record: The item.
        look: The last look, with which the ledger was updated.
        observations: Localized detections of the look.
        bins: Contents of the bins.
        config: Thresholds of the ledger.
    """
    if record.state is State.PLACED:
        presence = _find_presence_in_bin(record, look, observations, bins, config.gate)
        if presence is Presence.THERE:
            record.stamp, record.belief.miss_probability = look.frame.stamp, 1.0
            record.forget_viewpoints()
        if presence is not Presence.GONE:
            return presence
        record.belief.add_miss(look.error_rates, make_viewpoint_key(look))
    elif record.state is State.HELD:
        return Presence.HIDDEN
    elif record.state not in ON_TABLE or record.frame_id == look.frame.id:
        # A dropped item or a phantom has no place.
        return Presence.GONE if record.state not in ON_TABLE else Presence.THERE
    elif not look.compute_searched_mask(record.position[None])[0]:
        return Presence.HIDDEN
    is_gone = record.belief.miss_probability <= config.max_miss_probability
    return Presence.GONE if is_gone else Presence.UNSURE


def confirm_placed_items(
    look: Detections, observations: Sequence[Observation], bins: BinContents, config: LedgerConfig
) -> None:
    """Set the time of the last detection of each placed item that a look shows in its bin."""
    for record in bins.records.filter_by_state(State.PLACED):
        if _find_presence_in_bin(record, look, observations, bins, config.gate) is Presence.THERE:
            record.stamp = look.frame.stamp


def _find_presence_in_bin(
    record: ItemRecord, look: Detections, observations: Sequence[Observation], bins: BinContents, gate: float
) -> Presence:
    """Return whether one look shows an item in its bin; the look may have missed a `GONE` item by chance.

    A doubtful detection of the class of an item at the slot of the item shows the item, because the item is
    known to have been there. If the look shows fewer objects of the class than the bin contains, the missing
    items are those whose slots are farthest from the shown objects. The answer is `UNSURE` if another
    detection in the bin may be the item, or if the bin has more than one layer of objects, because a layer
    hides the layer below.
    """
    if not bins.is_floor_visible(record.bin, look):
        return Presence.HIDDEN
    items = [item for item in bins.records if item.bin == record.bin]
    same_class = [item for item in items if item.detected_label == record.detected_label]
    bias_std = look.error_rates.bias
    shown = [entry for entry in observations if bins.find_bin_name(entry, bias_std) == record.bin]
    same_look = [entry for entry in shown if entry.detection.label == record.detected_label]
    confident = [entry for entry in same_look if entry.is_confident]

    def measure_distance(item: ItemRecord, entries: Sequence[Observation]) -> float:
        slot = bins.get_slot_position(item)
        return min((float(np.linalg.norm(slot - entry.position[:2])) for entry in entries), default=np.inf)

    distances = {item: measure_distance(item, confident) for item in same_class}
    missing_count = len(same_class) - len(confident)
    for item, distance in distances.items():
        if distance > gate and measure_distance(item, same_look) <= gate:
            distances[item], missing_count = 0.0, missing_count - 1
    ranked = sorted(same_class, key=lambda item: distances[item], reverse=True)
    rank = ranked.index(record)
    if rank >= missing_count:
        return Presence.THERE
    has_layers = bins.count_used_slots(record.bin) > len(bins.bins[record.bin].slots)
    return Presence.UNSURE if has_layers or rank >= len(items) - len(shown) else Presence.GONE
