"""The oracle tells the truth, and no more of it than a camera could."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from executive.events import ignore
from executive.geometry import Pose
from executive.messages import Detection
from executive.mission.parse.cell_file import load_cell
from executive.sim.cell import SimCell
from executive.testing.fake_cell import ROUTES, SilentOperator
from executive.testing.oracle import TrueFrame, oracle_cell
from executive.workcell import CellOptions


@pytest.fixture
def build(missions: Path, request: pytest.FixtureRequest):
    """Build simulated cells with an oracle; they are closed after the test."""

    def build(cell: str = "overhead", *, seed: int = 3, **oracle) -> SimCell:
        path = missions / "cells" / f"{cell}.yaml"
        options = CellOptions(SilentOperator(), base=path.parent)
        made = oracle_cell(**oracle)(load_cell(path), seed=seed, routes=ROUTES, emit=ignore, options=options)
        request.addfinalizer(made.close)
        return made

    return build


def look(made: SimCell, view: str) -> tuple[TrueFrame, list[Detection]]:
    cell = made.cell
    frame = cell.camera.capture()
    assert isinstance(frame, TrueFrame)
    request = cell.detectors["embedded"].request(frame, view)
    while not request.ready:
        made.advance()
    return frame, list(request.result().found)


def test_without_jitter_every_object_is_located_where_it_lies(build) -> None:
    made = build(jitter=0.0)
    frame, found = look(made, "table")
    bodies = made._world.bodies
    assert [detection.label for detection in found] == list(bodies.values())
    for detection, body in zip(found, bodies, strict=True):
        place = made.cell.localizer.locate(detection, frame)
        # A duck's outline is not centred on its middle.
        assert np.linalg.norm(place[:2] - made._world.object_pose(body).position[:2]) < 0.012


def test_an_answer_is_due_when_a_detector_would_have_it(build) -> None:
    made = build()
    frame, _ = look(made, "table")
    assert made.cell.clock.now == pytest.approx(frame.stamp + 0.05, abs=1e-6)


def test_jitter_differs_from_look_to_look_and_repeats_with_the_seed(build) -> None:
    one, other = build(), build()
    first, second = look(one, "table")[1], look(one, "table")[1]
    assert look(other, "table")[1] == first != second
    shifts = np.array([a.box for a in first]) - np.array([b.box for b in second])
    assert 0.1 < np.abs(shifts).max() < 5.0


def test_what_lies_elsewhere_is_in_the_full_view_only_and_what_the_arm_hides_in_none(build) -> None:
    made = build(jitter=0.0)
    body, *_ = made._world.bodies
    count = len(made._world.bodies)
    made._world.place_object(body, Pose.of([0.5, -0.33, 0.03]))
    assert len(look(made, "table")[1]) == count - 1
    assert len(look(made, "full")[1]) == count
    made._world.place_object(body, Pose.of([0.0, 0.0, 0.03]))
    assert len(look(made, "full")[1]) == count - 1


def test_what_another_object_lies_on_is_found_when_that_is_gone(build) -> None:
    made = build(jitter=0.0)
    lower, upper, *_ = made._world.bodies
    made._world.place_object(lower, Pose.of([0.5, 0.0, 0.03]))
    made._world.place_object(upper, Pose.of([0.5, 0.0, 0.08]))
    labels = list(made._world.bodies.values())
    assert [detection.label for detection in look(made, "table")[1]] == labels[1:]
    made._world.remove_object(upper)
    assert [detection.label for detection in look(made, "table")[1]] == [labels[0], *labels[2:]]


def test_it_needs_no_image_but_can_have_one(build) -> None:
    assert look(build(), "table")[0].image.max() == 0
    assert look(build(rendered=True), "table")[0].image.max() > 100


def test_the_frames_of_another_camera_are_refused(build, fake) -> None:
    with pytest.raises(AssertionError, match="needs the frames of a TruthCamera"):
        build().cell.detectors["embedded"].request(fake.cell.camera.capture(), "table")
