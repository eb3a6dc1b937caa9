"""The picture of the worst mistakes."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from executive.errors import InputError
from executive.messages import Detection
from executive.vision.evaluation.matching import match
from executive.vision.evaluation.misses import WorstMisses, misses
from executive.vision.evaluation.sheet import FOUND, TRUE, draw_sheet, write_sheet


def told(sample, *found):
    detections = [Detection(label, confidence, box) for label, confidence, box in found]
    return list(misses(match(detections, sample), sample))


def test_every_kind_of_mistake_is_told_in_words(sample, knowing):
    duck = sample.boxes[1]
    phantom = (150.0, 200.0, 180.0, 230.0)
    hidden = knowing(visible_fraction=[0.62, 1.0])
    found = told(hidden, ("cube", 0.91, duck), ("duck", 0.7, phantom))
    assert [(miss.text, miss.severity) for miss in found] == [
        ("cube overlooked, 62% visible", 0.62),
        ("duck taken for cube 0.91", 0.91),
        ("no such thing: duck 0.70", 0.7),
    ]


def test_a_box_off_its_place_is_as_bad_as_its_share_of_the_object(sample):
    left, top, right, bottom = sample.boxes[0]
    *_, off = told(sample, ("cube", 0.9, (left + 3, top + 4, right + 3, bottom + 4)))
    assert off.text == "cube off by 5.0 px"
    assert off.severity == pytest.approx(5 / 30)


def test_what_is_cut_off_weighs_half(sample):
    cut = replace(sample, labels=("cube",), boxes=((0.0, 10.0, 30.0, 40.0),))
    (miss,) = told(cut)
    assert (miss.text, miss.severity) == ("cube overlooked, cut off", 0.5)


def test_the_worst_come_first_and_the_others_are_forgotten(sample, knowing):
    worst = WorstMisses(3)
    for share in (0.55, 0.95, 0.75, 0.65):
        worst.add([], knowing(visible_fraction=[share, 0.5]))
    assert [miss.severity for miss in worst.kept] == [0.95, 0.75, 0.65]


def test_the_sheet_shows_the_true_and_the_found_box(sample):
    left, top, right, bottom = sample.boxes[0]
    shown = told(sample, ("cube", 0.9, (left + 6, top, right + 6, bottom)))
    assert [miss.text for miss in shown] == ["duck overlooked", "cube off by 6.0 px"]
    picture = draw_sheet(shown, "overhead")
    first, second = picture[34:274, 10:250], picture[34:274, 260:500]
    assert has(first, TRUE)
    assert not has(first, FOUND)
    assert has(second, TRUE)
    assert has(second, FOUND)


def has(picture, colour):
    return bool((picture == list(bytes.fromhex(colour[1:]))).all(axis=-1).any())


def test_a_sheet_without_mistakes_says_so_and_more_than_a_row_of_them_make_two(sample):
    assert draw_sheet([], "overhead").shape == (34 + 290, 10 + 3 * 250, 3)
    assert draw_sheet(told(sample) * 4, "overhead").shape == (34 + 2 * 290, 10 + 6 * 250, 3)


def test_a_sheet_is_written_where_it_is_asked_for(sample, tmp_path):
    path = tmp_path / "new" / "sheet.png"
    write_sheet(path, told(sample), "overhead")
    assert np.array_equal(cv2.imread(str(path))[..., ::-1], draw_sheet(told(sample), "overhead"))


def test_a_sheet_that_cannot_be_written_is_explained(sample, tmp_path):
    (tmp_path / "sheet.png").mkdir()
    with pytest.raises(InputError, match=r"sheet\.png could not be written; is the disk full"):
        write_sheet(tmp_path / "sheet.png", told(sample), "overhead")
