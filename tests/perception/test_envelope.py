"""Measured envelope of a detector: statistics of frames, and error rates of the answers."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from executive.cell.config import TableConfig
from executive.cell.frame import Frame, assume_rates
from executive.mission.cell_file import load_cell
from executive.perception.detectors.envelope import (
    FrameRange,
    Measurement,
    StoredErrorRates,
    WitnessCounts,
    compute_fingerprint,
    compute_frame_statistics,
    find_envelopes,
    format_measurements,
    rate_frame,
    read_measurements,
)
from tests.camera_poses import looking_down

WOOD = (220, 200, 160)
RATES = StoredErrorRates(
    miss_rate=0.01, confusion_rate=0.002, false_detections=0.015, jitter=0.1, repeated=0.5, bias=0.001
)
WOOD_RANGE = FrameRange(
    brightness=(180, 195), contrast=(0, 6), red=(210, 225), green=(190, 205), blue=(150, 165)
)


def make_frame(colour: tuple[int, int, int]) -> Frame:
    """Return a frame of one colour from 1.2 m above the workspace."""
    image = np.full((480, 640, 3), colour, np.uint8)
    matrix = np.array([[461.0, 0, 320.0], [0, 461.0, 240.0], [0, 0, 1.0]])
    visible = np.ones((480, 640), bool)
    return Frame(1, "camera", image, None, matrix, looking_down((0.5, 0.0, 1.2)), 0.0, visible, 0)


def make_cell(**table):
    """Return a cell whose camera sees the whole workspace."""
    camera = SimpleNamespace(partial_views=False)
    return SimpleNamespace(table=TableConfig(**table), cameras={"overhead": camera})


def test_a_few_objects_change_neither_brightness_nor_colours_of_the_table():
    frame = make_frame(WOOD)
    frame.image[200:260, 280:360] = (10, 10, 10)
    statistics = compute_frame_statistics(frame, make_cell())
    assert (statistics["red"], statistics["green"], statistics["blue"]) == WOOD
    assert statistics["brightness"] == pytest.approx(sum(WOOD) / 3)
    assert statistics["contrast"] == 0


def test_a_frame_that_shows_the_workspace_in_part_says_nothing():
    assert compute_frame_statistics(make_frame(WOOD), make_cell(x=(0.4, 2.0))) is None
    hidden = replace(make_frame(WOOD), visible=np.zeros((480, 640), bool))
    assert compute_frame_statistics(hidden, make_cell()) is None


def test_a_frame_within_the_tolerance_of_the_range_is_no_difference_and_a_darker_one_is():
    frames = [compute_frame_statistics(make_frame(colour), make_cell()) for colour in (WOOD, (200, 180, 150))]
    assert FrameRange.compute([]) is None
    measured = FrameRange.compute(frames)
    assert measured.brightness == (176.7, 193.3)
    near = {"brightness": 170.0, "contrast": 0.0, "red": 195.0, "green": 175.0, "blue": 145.0}
    assert measured.describe_difference(near) == ""
    dark = {"brightness": 30.0, "contrast": 0.0, "red": 35.0, "green": 180.0, "blue": 150.0}
    expected = "brightness 30, measured 177 to 193; red 35, measured 200 to 220"
    assert measured.describe_difference(dark) == expected


@pytest.fixture
def stored(tmp_path, overhead):
    """A folder with a measurement of the cell overhead."""
    one = Measurement(
        detector="embedded", fingerprint=dict(compute_fingerprint(overhead, "embedded", tmp_path)),
        command="", seconds=1.0, images=1, rates=RATES, classes={}, counts={}, frames=WOOD_RANGE,
    )  # fmt: skip
    (tmp_path / "overhead.measured.json").write_text(format_measurements((), one))
    return tmp_path


def test_a_measurement_holds_for_other_bins_and_another_number_of_objects(overhead, stored):
    table = overhead.table.model_copy(update={"objects": (1, 2)})
    bins = {"red_bin": overhead.bins["red_bin"]}
    other = overhead.model_copy(update={"table": table, "bins": bins, "cell": "other"})
    envelope = find_envelopes(other, stored, [stored])["embedded"]
    assert envelope == (RATES.build_error_rates(0.5), WOOD_RANGE)


def test_a_measurement_of_another_camera_pose_does_not_hold_and_the_change_is_named(overhead, stored):
    moved = overhead.cameras["overhead"].model_copy(update={"position": (0.5, 0.0, 1.3)})
    changed = overhead.model_copy(update={"cameras": {"overhead": moved}})
    error_rates, _ = find_envelopes(changed, stored, [stored])["embedded"]
    text = error_rates.assumption_reason
    assert "measured before a change of camera pose, so high error rates are assumed; measure it with" in text


@pytest.mark.parametrize(("found", "is_blind"), [(98, False), (97, True)])
def test_an_image_that_hides_a_class_does_not_prove_an_empty_table(stored, overhead, found, is_blind):
    file = stored / "overhead.measured.json"
    (measurement,) = read_measurements(file)
    witness = WitnessCounts(objects={"cube": (100, 100), "duck": (found, 100)}, false_regions=0)
    file.write_text(format_measurements((), measurement.model_copy(update={"witness": witness})))
    blindness = find_envelopes(overhead, stored, [stored])["embedded"][0].blindness
    assert blindness.endswith("only 97 of 100 duck") == bool(blindness) == is_blind


def test_a_damaged_file_is_named_and_the_rates_are_assumed(overhead, tmp_path):
    (tmp_path / "overhead.measured.json").write_text("{")
    error_rates, _ = find_envelopes(overhead, tmp_path, [tmp_path])["embedded"]
    assert (error_rates.miss_rate, error_rates.repeated) == (0.15, 0.8)
    reason = error_rates.assumption_reason
    assert "was never measured in this cell" in reason
    assert f"the measurements in {tmp_path}/overhead.measured.json cannot be read" in reason


def test_fake_cells_and_fake_detectors_are_not_measured(overhead, missions, tmp_path):
    fake = overhead.model_copy(update={"kind": "fake"})
    noisy = load_cell(missions / "cells" / "noisy.yaml")
    assert find_envelopes(fake, tmp_path, []) == {}
    assert list(find_envelopes(noisy, tmp_path, [])) == ["embedded"]


@pytest.mark.parametrize(("colour", "doubted"), [(WOOD, False), ((60, 60, 60), True)])
def test_rates_are_assumed_for_frames_outside_the_measured_ranges(overhead, colour, doubted):
    envelope = RATES.build_error_rates(0.5), WOOD_RANGE
    answered = rate_frame(make_frame(colour), detector="embedded", envelope=envelope, config=overhead)
    doubt = answered.assumption_reason
    assumed = replace(assume_rates(0.5, doubt), blindness=doubt)
    assert answered == (assumed if doubted else RATES.build_error_rates(0.5))
    start = "the workspace differs from all images with which detector embedded was measured: "
    assert doubt.startswith(f"{start}brightness 60, measured 180 to 195; red 60") == doubted
    assert doubt.endswith("; measure it with `executive evaluate --cell overhead` (about 2 min)") == doubted


def test_measurements_of_other_detectors_in_a_file_are_kept(stored):
    (one,) = read_measurements(stored / "overhead.measured.json")
    text = format_measurements((one,), one.model_copy(update={"detector": "second"}))
    (stored / "both.measured.json").write_text(text)
    both = read_measurements(stored / "both.measured.json")
    assert [each.detector for each in both] == ["embedded", "second"]
    assert read_measurements(stored / "none.measured.json") == ()
