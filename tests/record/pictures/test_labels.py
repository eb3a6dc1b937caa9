"""Where labels go."""

from __future__ import annotations

from executive.record.pictures.labels import PLACES, label_places

SIZE = (60.0, 14.0)


def places(*boxes):
    return label_places(boxes, [SIZE] * len(boxes), 640, 480)


def test_a_label_stands_above_its_box():
    assert places((100, 100, 120, 120)) == ["TOP_LEFT"]
    assert places((100.1, 100.3, 120.7, 120.9)) == ["TOP_LEFT"]


def test_a_label_keeps_off_other_boxes():
    assert places((100, 100, 120, 120), (100, 75, 120, 95))[0] == "BOTTOM_LEFT"


def test_a_label_keeps_off_labels_that_stand_already():
    # The first one's label covers the place above the second.
    assert places((100, 100, 120, 120), (130, 100, 150, 120)) == ["TOP_LEFT", "BOTTOM_LEFT"]


def test_a_label_stays_in_the_image():
    assert places((100, 2, 120, 22)) == ["BOTTOM_LEFT"]
    assert places((620, 2, 638, 22)) == ["CENTER_LEFT"]


def test_where_every_place_hides_something_a_label_hides_the_least():
    around = (0, 0, 640, 480)
    assert places((100, 100, 120, 120), around)[0] == "TOP_LEFT"


def test_supervision_knows_every_place():
    import supervision as sv

    assert all(sv.Position[place] for place in PLACES)
