"""Verification that an item is at the place where the ledger believes it to be, by images of the place."""

from __future__ import annotations

from collections.abc import Sequence

from executive.cell.detection import Detections, Observation
from executive.cell.ledger import Presence
from executive.ledger.belief import make_viewpoint_key
from executive.ledger.bin_contents import BinContents
from executive.ledger.item import ON_TABLE, ItemRecord, State


def verify(
    record: ItemRecord, detections: Detections, observations: Sequence[Observation], bins: BinContents
) -> Presence:
    """Update a placed item with the last image, and return whether an item is at its place.

    The item is gone if the probability that all images missed it by chance is at most `max_miss_probability`.

    Args:
        record: The item.
        detections: Detections in the last image, with which the ledger was updated.
        observations: Localized detections.
        bins: Contents of the bins.
    """
    if record.state is State.HELD:
        return Presence.HIDDEN
    if record.state is State.PLACED:
        presence = _find_presence_in_bin(record, detections, observations, bins)
        if presence is Presence.THERE:
            record.stamp, record.belief.miss_probability = detections.frame.stamp, 1.0
            record.forget_viewpoints()
        if presence is not Presence.GONE:
            return presence
        record.belief.add_miss(detections.error_rates, make_viewpoint_key(detections))
    elif record.state not in ON_TABLE:
        return Presence.GONE
    elif record.frame_id == detections.frame.id:
        return Presence.THERE
    elif not detections.compute_searched_mask(record.position[None])[0]:
        return Presence.HIDDEN
    is_gone = record.belief.miss_probability <= bins.config.max_miss_probability
    return Presence.GONE if is_gone else Presence.UNSURE


def confirm_placed_items(
    detections: Detections, observations: Sequence[Observation], bins: BinContents
) -> None:
    """Set the time of the last detection of each placed item that an image shows in its bin."""
    for record in bins.records.filter_by_state(State.PLACED):
        if _find_presence_in_bin(record, detections, observations, bins) is Presence.THERE:
            record.stamp = detections.frame.stamp


def _find_presence_in_bin(
    record: ItemRecord, detections: Detections, observations: Sequence[Observation], bins: BinContents
) -> Presence:
    """Return whether one image shows a placed item in its bin.

    `GONE` means only that the image does not show the item; the detector may have missed the item. A doubtful
    detection shows an item if the detection has the class of the item and lies at the slot of the item. If
    the image shows fewer objects of the class than the bin contains, the missing items are those whose slots
    are farthest from the shown objects. The result is `UNSURE` if another detection in the bin may be the
    item, or if the bin has more than one layer of objects, because a layer hides the layer below.
    """
    if not bins.is_floor_visible(record.bin, detections):
        return Presence.HIDDEN
    bias_std = detections.error_rates.bias
    shown = [entry for entry in observations if bins.find_bin_name(entry, bias_std) == record.bin]
    alike = [entry for entry in shown if entry.detection.label == record.detected_label]
    confident = [entry for entry in alike if entry.is_confident]
    items = [item for item in bins.records if item.bin == record.bin]
    distances = {
        item: bins.measure_slot_distance(item, confident)
        for item in items
        if item.detected_label == record.detected_label
    }
    missing_count = len(distances) - len(confident)
    for item, distance in distances.items():
        if distance > bins.config.gate >= bins.measure_slot_distance(item, alike):
            distances[item], missing_count = 0.0, missing_count - 1
    rank = sorted(distances, key=distances.__getitem__, reverse=True).index(record)
    if rank >= missing_count:
        return Presence.THERE
    has_layers = bins.count_used_slots(record.bin) > len(bins.bins[record.bin].slots)
    return Presence.UNSURE if has_layers or rank >= len(items) - len(shown) else Presence.GONE
