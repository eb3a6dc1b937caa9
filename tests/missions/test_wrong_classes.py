"""A detector that takes one class for another, or uses labels that the cell does not know."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from executive.cell.frame import Detection
from executive.events import ItemChanged
from executive.perception.camera_model import compute_calibration
from executive.testing.fake_cell import FakeCell, load_empty_cell
from executive.testing.run_mission import MissionResult, run_mission

Answers = Callable[[int, Sequence[Detection]], Sequence[Detection]]
OBJECTS = (("cube", 0.46, -0.12), ("sphere", 0.58, 0.0), ("cube", 0.5, 0.14), ("duck", 0.6, 0.16))


def sort_objects(mission: str, make_answer: Answers, **cell: str) -> MissionResult:
    """Sort `OBJECTS` with a detector that answers so."""

    def arrange(fake: FakeCell) -> None:
        fake.world.objects.clear()
        for thing in OBJECTS:
            fake.world.put(*thing)
        fake.detector.make_answer = make_answer

    return run_mission(mission, FakeCell, arrange=arrange, set=cell)


def sorted_with(mission: str, labels: dict[str, str], **cell: str) -> MissionResult:
    """Sort `OBJECTS` with a detector that gives some classes another label."""

    def relabel(look: int, true: Sequence[Detection]) -> Sequence[Detection]:
        return [replace(one, label=labels.get(one.label, one.label)) for one in true]

    return sort_objects(mission, relabel, **cell)


@pytest.mark.parametrize("mission", ["sort_overhead", pytest.param("sort_wrist", marks=pytest.mark.slow)])
def test_a_class_that_is_always_mistaken_is_in_no_wrong_bin_and_rejected_by_its_height(mission: str) -> None:
    result = sorted_with(mission, {"duck": "sphere"})
    assert (result.status, result.items["placed"], result.items["rejected"]) == ("INCOMPLETE", 3, 1)
    assert (result.audit["wrong_bin"], result.agrees) == (0, True)
    reasons = [row.reason for row in result.ledger.list_items() if row.state == "rejected"]
    # The fake tool feels a surface from 1 mm above it.
    height = "it was touched 57 mm above the table, and a sphere is 60 mm high"
    assert reasons == [f"could not be picked: {height}"]
    assert height in result.message
    assert result.list_failure_reasons().count("contradicted") == 3


def test_objects_of_no_class_are_reported_as_not_sorted() -> None:
    label = "Cube"
    result = sorted_with("sort_overhead", {"cube": label})
    assert (result.status, result.items["placed"], result.items["rejected"]) == ("INCOMPLETE", 2, 2)
    assert (result.agrees, result.ledger.unknown_labels) == (True, {label: 2})
    assert f'{label}-1 (the cell has no class "{label}"' in result.message


def sorted_beside_banana(
    is_shown: Callable[[int], bool], x: float, y: float, confidence: float, **cell: str
) -> MissionResult:
    """Sort `OBJECTS`; some looks also show a banana at (x, y) [m]."""

    def add_banana(look: int, true: Sequence[Detection]) -> Sequence[Detection]:
        matrix, X_WC = compute_calibration(load_empty_cell().cameras["overhead"])
        column, row, depth = matrix @ X_WC.inverse().apply(np.array([x, y, 0.025]))
        u, v = column / depth, row / depth
        banana = Detection("banana", confidence, (u - 9, v - 9, u + 9, v + 9))
        return [*true, banana] if is_shown(look) else true

    return sort_objects("sort_overhead", add_banana, **cell)


@pytest.mark.parametrize(
    ("is_shown", "x", "y", "confidence", "status"),
    [
        (lambda look: True, 0.5, 0.0, 0.9, "INCOMPLETE"),
        (lambda look: look % 2 == 1, 0.5, 0.0, 0.9, "INCOMPLETE"),
        (lambda look: look == 1, 0.5, 0.0, 0.9, "SUCCESS"),
        (lambda look: look <= 6, 0.5, 0.0, 0.9, "SUCCESS"),
        (lambda look: True, 0.5, 0.0, 0.4, "SUCCESS"),
        (lambda look: True, 0.8, 0.0, 0.9, "SUCCESS"),
        (lambda look: look == 1, 0.46, -0.12, 0.9, "SUCCESS"),
    ],
    ids=["always", "every other look", "one look", "taken away", "doubtful",
         "beside the workspace", "box of a cube"],
)  # fmt: skip
def test_a_box_of_no_class_counts_if_looks_confirm_it_in_the_workspace(
    is_shown: Callable[[int], bool], x: float, y: float, confidence: float, status: str
) -> None:
    result = sorted_beside_banana(is_shown, x, y, confidence)
    assert (result.status, result.items["placed"]) == (status, 4)


def test_a_label_that_the_cell_file_ignores_is_not_counted() -> None:
    # The banana is beside a sphere.
    result = sorted_beside_banana(lambda look: True, 0.5, 0.06, 0.9, **{"cell.unknown.ignore": "[banana]"})
    assert (result.status, result.ledger.unknown_labels, result.is_table_empty) == ("SUCCESS", {}, True)
    assert (result.items["placed"], result.agrees) == (4, True)


def test_the_audit_leaves_out_objects_that_were_only_seen_with_an_ignored_label() -> None:
    result = sorted_with("sort_overhead", {"cube": "banana"}, **{"cell.unknown.ignore": "[banana]"})
    assert (result.status, result.items["seen"], result.agrees) == ("SUCCESS", 2, True)


def test_a_look_full_of_boxes_ends_the_mission_at_once() -> None:
    def arrange(fake: FakeCell) -> None:
        fake.detector.make_answer = lambda look, true: [*true] * 100

    result = run_mission("sort_overhead", arrange=arrange)
    assert (result.status, result.reason) == ("FAILURE", "Detect.crowded")
    assert "at most 60 are allowed" in result.message
    assert not [one for one in result.events if isinstance(one.event, ItemChanged)]
