"""The oracle tells the truth, and no more of it than a camera could."""

from __future__ import annotations

import math

import numpy as np
import pytest

from executive.cell.frame import Detections, assume_rates
from executive.events import discard_event
from executive.geometry import Pose
from executive.mission.cell_file import load_cell
from executive.station.station import CellOptions, SilentOperator
from executive.testing.fake_cell import SHIPPED_ROUTES
from executive.testing.oracle import make_oracle_kind
from executive.tools.suction import Suction


@pytest.fixture
def build(missions, request):
    """Builds simulated cells with an oracle; they are closed after the test."""

    def build(**oracle):
        path = missions / "cells" / "overhead.yaml"
        options = CellOptions(SilentOperator(), cell_folder=path.parent)
        values = {"seed": 3, "routes": SHIPPED_ROUTES, "emit": discard_event, "options": options}
        cell = make_oracle_kind(**oracle)(load_cell(path), **values)
        request.addfinalizer(cell.close)
        return cell, cell.driver.world

    return build


def look(cell, view="table"):
    frame = cell.cell.camera.capture()
    request = cell.cell.detectors["embedded"].request(frame, view)
    while not request.ready:
        cell.advance()
    return frame, list(request.result().confident)


def find_labels(cell, view="table"):
    return [detection.label for detection in look(cell, view)[1]]


def test_without_noise_every_object_is_located_where_it_lies_as_late_as_by_a_detector(build):
    cell, world = build(box_std=0.0)
    frame, found = look(cell)
    assert cell.cell.clock.now == pytest.approx(frame.stamp + 0.05, abs=1e-6)
    assert frame.image.max() == 0
    assert [detection.label for detection in found] == list(world.labels.values())
    for detection, body in zip(found, world.labels, strict=True):
        place = cell.cell.localizer.locate(detection, frame)
        # A duck's outline is not centred on its middle.
        assert np.linalg.norm(place[:2] - world.get_object_pose(body).position[:2]) < 0.012


def test_noise_differs_from_look_to_look_and_repeats_with_the_seed(build):
    cell, _ = build()
    other, _ = build(renders_images=True)
    first = look(cell)[1]
    second = look(cell)[1]
    frame, again = look(other)
    assert again == first != second
    shifts = np.array([a.box for a in first]) - np.array([b.box for b in second])
    assert 0.1 < np.abs(shifts).max() < 5.0
    assert frame.image.max() > 100


def test_what_is_elsewhere_or_hidden_by_the_arm_or_another_object_is_not_found(build):
    cell, world = build(box_std=0.0)
    first, second, *_ = world.labels
    labels = list(world.labels.values())
    world.place_object(first, Pose.of([0.5, -0.33, 0.03]))
    assert (find_labels(cell), find_labels(cell, "full")) == (labels[1:], labels)
    world.place_object(first, Pose.of([0.0, 0.0, 0.03]))
    assert find_labels(cell, "full") == labels[1:], "the arm stands there"
    world.place_object(first, Pose.of([0.5, 0.0, 0.03]))
    world.place_object(second, Pose.of([0.5, 0.0, 0.08]))
    assert find_labels(cell) == labels[1:]
    world.remove_object(second)
    assert find_labels(cell) == [labels[0], *labels[2:]]


@pytest.mark.parametrize("needs_yaw", [True, False])
def test_outlines_show_the_yaws_if_the_tool_needs_them(build, monkeypatch, needs_yaw):
    monkeypatch.setattr(Suction, "needs_yaw", needs_yaw)
    cell, world = build()
    frame, found = look(cell)
    look_of_table = Detections(
        "embedded", tuple(found), assume_rates(0.5, ""), frame=frame, view="table", area=(192, 100, 448, 356)
    )
    observations = cell.cell.localizer.localize(look_of_table)
    for observation, body in zip(observations, world.labels, strict=True):
        assert (observation.detection.outline is not None) == needs_yaw
        rotation = world.get_object_pose(body).rotation
        if yaw := observation.yaw:
            difference = yaw.angle - math.atan2(rotation[1, 0], rotation[0, 0])
            assert abs(math.remainder(difference, math.tau / yaw.symmetry)) < 2 * yaw.std < 0.3
    with_yaw = {each.detection.label for each in observations if each.yaw}
    assert with_yaw == ({"cube", "duck"} if needs_yaw else set())
