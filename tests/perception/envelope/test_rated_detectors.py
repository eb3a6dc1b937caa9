"""Error rates that the answers of a cell's detectors carry: measured ones, or assumed ones."""

from __future__ import annotations

import pytest
from plain_frames import frame_of

from executive.cell.detection import ErrorRates, assume_rates
from executive.mission.parse.cell_file import load_cell
from executive.perception.detectors.requests import PendingSearch
from executive.perception.envelope import (
    DetectorEnvelope,
    FrameRange,
    Measurement,
    RatedDetector,
    StoredErrorRates,
    compute_fingerprint,
    find_envelopes,
    find_unmeasured_detectors,
    format_measurements,
    list_changes,
    read_measurements,
)

RATES = StoredErrorRates(
    miss_rate=0.01, confusion_rate=0.002, false_detections=0.015, jitter=0.1, repeated=0.5, bias=0.001
)
WOOD = FrameRange(brightness=(180, 195), contrast=(0, 6), red=(210, 225), green=(190, 205), blue=(150, 165))


@pytest.fixture
def overhead(missions):
    return load_cell(missions / "cells" / "overhead.yaml")


@pytest.fixture
def stored(tmp_path, overhead):
    """A folder with a measurement of the cell overhead."""
    one = Measurement(
        detector="embedded", fingerprint=dict(compute_fingerprint(overhead, "embedded", tmp_path)),
        command="", seconds=1.0, images=1, rates=RATES, classes={}, counts={}, frames=WOOD,
    )  # fmt: skip
    (tmp_path / "overhead.measured.json").write_text(format_measurements((), one))
    return tmp_path


def test_a_measurement_holds_for_other_bins_and_another_number_of_objects(overhead, stored):
    table = overhead.table.model_copy(update={"objects": (1, 2)})
    bins = {"red_bin": overhead.bins["red_bin"]}
    other = overhead.model_copy(update={"table": table, "bins": bins, "cell": "other"})
    envelope = find_envelopes(other, stored, [stored])["embedded"]
    assert envelope == DetectorEnvelope(RATES.build_error_rates(0.5), WOOD)
    assert list(find_unmeasured_detectors(other, stored, [stored])) == []


def test_a_measurement_of_another_camera_pose_does_not_hold_and_the_change_is_named(overhead, stored):
    moved = overhead.cameras["overhead"].model_copy(update={"position": (0.5, 0.0, 1.3)})
    changed = overhead.model_copy(update={"cameras": {"overhead": moved}})
    ((keys, text),) = find_unmeasured_detectors(changed, stored, [stored])
    assert keys == ("detectors", "embedded")
    assert text == (
        "detector embedded was measured before a change of camera pose, so high error rates are assumed; "
        "measure it with `executive evaluate --cell overhead` (about 2 min)"
    )


def test_a_damaged_file_is_named_and_the_rates_are_assumed(overhead, tmp_path):
    (tmp_path / "overhead.measured.json").write_text("{")
    error_rates = find_envelopes(overhead, tmp_path, [tmp_path])["embedded"].error_rates
    assert (error_rates.miss_rate, error_rates.repeated) == (0.15, 0.8)
    reason = error_rates.assumption_reason
    assert "was never measured in this cell" in reason
    assert f"the measurements in {tmp_path}/overhead.measured.json cannot be read" in reason


def test_fake_cells_and_fake_detectors_are_not_measured(overhead, missions, tmp_path):
    fake = overhead.model_copy(update={"kind": "fake"})
    noisy = load_cell(missions / "cells" / "noisy.yaml")
    assert find_envelopes(fake, tmp_path, []) == {}
    assert list(find_envelopes(noisy, tmp_path, [])) == ["embedded"]


class Silent:
    """A detector that finds nothing."""

    def request(self, frame, view):
        del frame, view
        from concurrent.futures import Future

        class Now:
            now = 0.0

        work: Future = Future()
        work.set_result([])
        return PendingSearch(work, 0.0, Now(), "embedded", ErrorRates(0.5, 0.9, 0.9, 0.9, 9.0))

    def close(self):
        """Close nothing."""


@pytest.mark.parametrize(("colour", "doubted"), [((220, 200, 160), False), ((60, 60, 60), True)])
def test_rates_are_assumed_for_frames_outside_the_measured_ranges(overhead, colour, doubted):
    envelope = DetectorEnvelope(RATES.build_error_rates(0.5), WOOD)
    detector = RatedDetector(Silent(), envelope, overhead, "embedded")
    answered = detector.request(frame_of(colour), "table").result().error_rates
    doubt = answered.assumption_reason
    assert answered == (assume_rates(0.5, doubt) if doubted else RATES.build_error_rates(0.5))
    start = "the workspace differs from all images with which detector embedded was measured: "
    assert doubt.startswith(f"{start}brightness 60, measured 180 to 195; red 60") == doubted
    assert doubt.endswith("; measure it with `executive evaluate --cell overhead` (about 2 min)") == doubted


def test_measurements_of_other_detectors_in_a_file_are_kept(stored):
    (one,) = read_measurements(stored / "overhead.measured.json")
    text = format_measurements((one,), one.model_copy(update={"detector": "second"}))
    (stored / "both.measured.json").write_text(text)
    assert [each.detector for each in read_measurements(stored / "both.measured.json")] == [
        "embedded",
        "second",
    ]
    assert read_measurements(stored / "none.measured.json") == ()


def test_changed_properties_are_named():
    assert list_changes({"a": "1", "b": "2"}, {"a": "1", "b": "3", "c": "4"}) == "b, c"
