"""Under injected faults, the ledger agrees with the audit, or the run names the items in question."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from executive.cell.frame import Answer
from executive.station.station import Station
from executive.testing.fake_cell import FakeCell
from executive.testing.faults import after, during, make_detector_effect, object_bumped
from executive.testing.faulty_cell import Effect, Occurrence, ScheduledFault
from executive.testing.run_mission import MissionResult, run_mission

X_RANGE, Y_RANGE = (0.42, 0.64), (-0.22, 0.22)
"""Part of the table in which bumped objects stay [m]."""
SWAPPED = {"cube": "sphere", "sphere": "cube", "duck": "duck"}
SEEDS = range(171000, 171006)


def exchange_objects(occurrence: Occurrence) -> bool:
    """Swap the target object with one of another class, once."""
    world = occurrence.context.world
    if (first := occurrence.find_object("node")) is None:
        return False
    others = [
        thing
        for thing in world.objects
        if thing.label != first.label
        and not any(b.contains(thing.position) for b in occurrence.context.station.cell.bins.values())
    ]
    if not others:
        return False
    x, y = (others[0].position - first.position)[:2]
    world.move(first, (float(x), float(y)))
    world.move(others[0], (-float(x), -float(y)))
    occurrence.emit_event(first)
    return True


def empty_bin(occurrence: Occurrence) -> bool:
    """Take all objects out of the first bin that holds some, once."""
    for bin in occurrence.context.station.cell.bins.values():
        inside = [thing for thing in occurrence.context.world.objects if bin.contains(thing.position)]
        for thing in inside:
            occurrence.emit_event(thing)
            occurrence.context.world.remove(thing)
        if inside:
            return True
    return False


def detector_swaps_classes() -> Effect:
    """Exchange the classes cube and sphere in an answer."""

    def swap(answer: Answer) -> Answer:
        return replace(
            answer, confident=tuple(replace(one, label=SWAPPED[one.label]) for one in answer.confident)
        )

    return make_detector_effect("detector_swaps_classes", swap)


def schedule(kind: str, seed: int) -> list[ScheduledFault]:
    if kind == "bumped objects":
        return [during("*/Approach", object_bumped(X_RANGE, Y_RANGE))]
    if kind == "wrong classes":
        looks = (1 + np.flatnonzero(np.random.default_rng(seed).random(1000) < 0.3)).tolist()
        return [during("*/Detect", detector_swaps_classes(), activations=looks)]
    if kind == "exchanged objects":
        return [during("*/Approach", Effect("objects_exchanged", exchange_objects), activations=1 + seed % 3)]
    assert kind == "emptied bin"
    return [after(4.0 + seed % 6, Effect("bin_emptied", empty_bin))]


def names_rejected_and_lost_items(result: MissionResult) -> bool:
    rows = [row for row in result.ledger.list_items() if row.state in ("rejected", "lost")]
    return result.status == "INCOMPLETE" and all(row.item in result.message for row in rows)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("cell", ["fake", "sim"])
@pytest.mark.parametrize("kind", ["bumped objects", "wrong classes", "exchanged objects", "emptied bin"])
def test_ledger_and_audit_agree_or_the_run_names_the_items(kind: str, cell: str, seed: int) -> None:
    result = run_mission(
        "sort_overhead", FakeCell if cell == "fake" else Station,
        seed=seed, faults=schedule(kind, seed), set={"cell.kind": cell},
    )  # fmt: skip
    assert result.agrees or names_rejected_and_lost_items(result)
