"""The oracle tells the truth, and no more of it than a camera could."""

from __future__ import annotations

import numpy as np
import pytest

from executive.cell.workcell import CellOptions
from executive.cells.fake.cell import SHIPPED_ROUTES, SilentOperator
from executive.events import discard_event
from executive.geometry import Pose
from executive.mission.parse.cell_file import load_cell
from executive.testing.oracle import make_oracle_kind


@pytest.fixture
def build(missions, request):
    """Builds simulated cells with an oracle; they are closed after the test."""

    def build(**oracle):
        path = missions / "cells" / "overhead.yaml"
        options = CellOptions(SilentOperator(), cell_folder=path.parent)
        made = make_oracle_kind(**oracle)(
            load_cell(path), seed=3, routes=SHIPPED_ROUTES, emit=discard_event, options=options
        )
        request.addfinalizer(made.close)
        return made

    return build


def look(made, view="table"):
    frame = made.cell.camera.capture()
    request = made.cell.detectors["embedded"].request(frame, view)
    while not request.ready:
        made.advance()
    return frame, list(request.result().confident)


def labels(made, view="table"):
    return [detection.label for detection in look(made, view)[1]]


def test_without_jitter_every_object_is_located_where_it_lies_as_late_as_by_a_detector(build):
    made = build(box_std=0.0)
    frame, found = look(made)
    assert made.cell.clock.now == pytest.approx(frame.stamp + 0.05, abs=1e-6)
    assert frame.image.max() == 0
    bodies = made._world.labels
    assert [detection.label for detection in found] == list(bodies.values())
    for detection, body in zip(found, bodies, strict=True):
        place = made.cell.localizer.locate(detection, frame)
        # A duck's outline is not centred on its middle.
        assert np.linalg.norm(place[:2] - made._world.get_object_pose(body).position[:2]) < 0.012


def test_jitter_differs_from_look_to_look_and_repeats_with_the_seed(build):
    one, other = build(), build(renders_images=True)
    first, second = look(one)[1], look(one)[1]
    frame, again = look(other)
    assert again == first != second
    shifts = np.array([a.box for a in first]) - np.array([b.box for b in second])
    assert 0.1 < np.abs(shifts).max() < 5.0
    assert frame.image.max() > 100


def test_what_lies_elsewhere_is_in_the_full_view_only_and_what_the_arm_hides_in_none(build):
    made = build(box_std=0.0)
    body, *_ = made._world.labels
    everything = list(made._world.labels.values())
    made._world.place_object(body, Pose.of([0.5, -0.33, 0.03]))
    assert (labels(made), labels(made, "full")) == (everything[1:], everything)
    made._world.place_object(body, Pose.of([0.0, 0.0, 0.03]))
    assert labels(made, "full") == everything[1:]


def test_what_another_object_lies_on_is_found_when_that_is_gone(build):
    made = build(box_std=0.0)
    lower, upper, *_ = made._world.labels
    made._world.place_object(lower, Pose.of([0.5, 0.0, 0.03]))
    made._world.place_object(upper, Pose.of([0.5, 0.0, 0.08]))
    first, *others = made._world.labels.values()
    assert labels(made) == others
    made._world.remove_object(upper)
    assert labels(made) == [first, *others[1:]]
