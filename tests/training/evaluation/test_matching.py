"""Which detection is which object, and which mistakes that makes."""

from __future__ import annotations

from dataclasses import replace

import cv2
import pytest

from executive.cell.frame import Detection
from executive.training.dataset import save_image
from executive.training.evaluate import collect_mistakes, draw_sheet, find_mistakes
from executive.training.metrics import is_ignored, match_detections


def matches(sample, *found):
    return match_detections([Detection(*one) for one in found], sample)


def list_mistakes(sample, *found):
    return list(find_mistakes(matches(sample, *found), sample))


def right_by(box, pixels, down=0):
    left, top, right, bottom = box
    return left + pixels, top + down, right + pixels, bottom + down


def test_an_object_goes_to_its_own_class_then_to_the_most_confident(sample):
    cube, duck = sample.boxes
    for found, expected in (
        ([("cube", 0.7, cube), ("cube", 0.9, cube)], [(0.9, 0, True), (0.7, None, False)]),
        ([("duck", 0.9, cube), ("cube", 0.6, cube)], [(0.9, None, False), (0.6, 0, True)]),
        ([("cube", 0.9, duck)], [(0.9, 1, False)]),
        ([("cube", 0.9, right_by(cube, 11))], [(0.9, None, False)]),
        ([("cube", 0.9, right_by(cube, 9))], [(0.9, 0, True)]),
    ):
        assert [
            (m.detection.confidence, m.object_index, m.is_correct) for m in matches(sample, *found)
        ] == expected


def test_an_ignored_object_is_one_that_a_box_fits_better_than_any_other(sample):
    (half_hidden,), on_cube = sample.ignored_boxes, Detection("cube", 0.9, sample.boxes[0])
    assert is_ignored(Detection("cube", 0.9, half_hidden), sample)
    assert not is_ignored(on_cube, sample)
    assert not is_ignored(on_cube, replace(sample, ignored_boxes=(right_by(sample.boxes[0], 3),)))


def test_every_kind_of_mistake_has_a_text_and_a_weight(sample, knowing):
    cube, duck = sample.boxes
    phantom = ("duck", 0.7, (150.0, 200.0, 180.0, 230.0))
    found = list_mistakes(knowing(visible_fraction=[0.62, 1.0]), ("cube", 0.91, duck), phantom)
    # A box off its place is as bad as its share of the object; what is cut off weighs half.
    found += list_mistakes(sample, ("duck", 0.9, duck), ("cube", 0.8, right_by(cube, 3, down=4)))[1:]
    found += list_mistakes(replace(sample, labels=("cube",), boxes=((0.0, 10.0, 30.0, 40.0),)))
    assert [(mistake.text, pytest.approx(mistake.severity)) for mistake in found] == [
        ("cube missed, 62% visible", 0.62),
        ("duck detected as cube 0.91", 0.91),
        ("false detection: duck 0.70", 0.7),
        ("cube off by 5.0 px", 5 / 30),
        ("cube missed, truncated", 0.5),
    ]


def test_the_sheet_shows_the_true_and_the_found_box_of_the_worst_mistakes(sample, tmp_path):
    worst = []
    for pixels in (2, 6):
        found = matches(
            sample, ("cube", 0.9, right_by(sample.boxes[0], pixels)), ("duck", 0.9, sample.boxes[1])
        )
        collect_mistakes(worst, found, sample, max_count=2)
    collect_mistakes(worst, matches(sample, ("cube", 0.9, sample.boxes[0])), sample, max_count=2)
    assert [mistake.text for mistake in worst] == ["duck missed", "cube off by 6.0 px"]
    save_image(tmp_path / "new" / "sheet.png", draw_sheet(worst, "overhead"))
    picture = cv2.imread(str(tmp_path / "new" / "sheet.png"))[..., ::-1]
    assert picture.shape == (34 + 290, 10 + 3 * 250, 3)
