"""What several detectors say together, and when they contradict each other."""

from __future__ import annotations

import pytest

from executive.errors import Unavailable
from executive.messages import Answer, Detection, Reliability
from executive.vision.detectors.agreement.union import together, unite

SIDE = 40.0


def box(left, top=0.0):
    """Return a square; one moved by a quarter of its side overlaps it at 0.6, by a half at a third."""
    return (left, top, left + SIDE, top + SIDE)


def cube(left, confidence=0.9):
    return Detection("cube", confidence, box(left))


def duck(left, confidence=0.8):
    return Detection("duck", confidence, box(left))


def says(*found, threshold=0.5):
    return Answer("whoever", found, Reliability(threshold, 0.05, 0.05, 0.1, 1.0))


def both(server, embedded):
    return unite("both", {"server": server, "embedded": embedded})


def test_what_both_see_is_one_object_as_the_first_sees_it():
    answer = both(says(cube(0, 0.7), duck(100)), says(duck(102, 0.99), cube(10, 0.95)))
    assert (answer.detector, answer.found) == ("both", (duck(100), cube(0, 0.7)))


def test_what_only_one_sees_counts_too():
    assert both(says(cube(0)), says(duck(100, 0.99))).found == (duck(100, 0.99), cube(0))
    assert both(says(), says(duck(100))).found == (duck(100),)


def test_two_blind_ones_agree_that_nothing_is_there():
    assert both(says(), says()).found == ()


def test_two_classes_for_one_object_are_no_answer():
    with pytest.raises(Unavailable) as caught:
        both(says(duck(0, 0.91), cube(100), cube(200)), says(cube(3, 0.95), cube(100)))
    assert str(caught.value) == (
        "server and embedded disagree about 1 of 3 objects: "
        "server sees a duck where embedded sees a cube (0.91, 0.95)"
    )


def test_two_contested_objects_are_named_and_the_others_counted():
    with pytest.raises(Unavailable) as caught:
        both(says(*map(duck, (0, 100, 200, 300))), says(*map(cube, (0, 100, 200, 300))))
    assert str(caught.value) == (
        "server and embedded disagree about 4 of 4 objects: "
        "server sees a duck where embedded sees a cube (0.80, 0.90), "
        "server sees a duck where embedded sees a cube (0.80, 0.90), and 2 more"
    )


def test_the_last_of_three_may_contradict_too():
    with pytest.raises(Unavailable) as caught:
        unite("all", {"one": says(), "two": says(cube(0)), "three": says(duck(0))})
    disagree = "one, two and three disagree about 1 of 1 objects: two sees a cube where three sees a duck"
    assert str(caught.value).startswith(disagree)


@pytest.mark.parametrize(("apart", "objects"), [(SIDE / 4, 1), (SIDE / 2, 2)])
def test_boxes_are_one_object_from_half_an_overlap_on(apart, objects):
    assert len(both(says(cube(0)), says(cube(apart))).found) == objects


def test_objects_that_overlap_are_told_apart_by_who_overlaps_more():
    stacked = (cube(0), duck(SIDE / 4))
    assert both(says(*stacked), says(*reversed(stacked))).found == stacked


def test_what_only_one_sees_beside_an_object_is_another_object():
    assert both(says(cube(0)), says(cube(0), duck(SIDE / 4))).found == (cube(0), duck(SIDE / 4))


def test_a_doubt_contradicts_nobody():
    assert both(says(cube(0)), says(duck(0, 0.49))).found == (cube(0), duck(0, 0.49))


def test_the_doubts_of_each_leave_a_look_in_doubt():
    answer = both(says(cube(0, 0.3)), says(duck(100, 0.45)))
    assert answer.found == (duck(100, 0.45), cube(0, 0.3))
    assert answer.reliability.threshold == 0.5


def test_a_box_counts_by_the_threshold_of_who_drew_it():
    careful, sure = says(cube(0, 0.4), cube(100, 0.2), threshold=0.35), says(duck(200, 0.4), threshold=0.5)
    for answer in (both(careful, sure), both(sure, careful)):
        assert answer.found == (cube(0, 0.4), cube(100, 0.2))
        assert answer.reliability.threshold == 0.35


def test_together_they_claim_no_more_than_is_known_of_each():
    one, other = Reliability(0.5, 0.05, 0.004, 0.02, 1.0), Reliability(0.35, 0.02, 0.05, 0.1, 0.6)
    united = together([one, other])
    assert united == Reliability(0.35, misses=0.02, confused=0.05, invented=pytest.approx(0.12), jitter=1.0)
