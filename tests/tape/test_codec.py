"""Nothing is lost between a value and its plain form."""

from __future__ import annotations

import json

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from executive.geometry import Pose, about_z
from executive.messages import Answer, Detection, Frame, Reliability
from executive.tape.codec import (
    read_answer,
    read_array,
    read_frame,
    read_pose,
    write_answer,
    write_array,
    write_frame,
    write_pose,
)

finite = st.floats(allow_nan=False, allow_infinity=False)


def through_json(value: object) -> object:
    return json.loads(json.dumps(value))


@given(arrays(np.float64, (3, 2), elements=finite))
def test_arrays_come_back_bit_by_bit(array: np.ndarray) -> None:
    assert np.array_equal(read_array(through_json(write_array(array))), array)


@given(arrays(np.float64, (3,), elements=finite), st.floats(-4, 4))
def test_poses_come_back_bit_by_bit(position: np.ndarray, angle: float) -> None:
    pose = Pose(about_z(angle), position)
    back = read_pose(through_json(write_pose(pose)))
    assert np.array_equal(back.rotation, pose.rotation)
    assert np.array_equal(back.position, pose.position)


@given(arrays(np.bool_, st.tuples(st.integers(1, 40), st.integers(1, 40))), st.integers(0, 9))
def test_a_frame_comes_back_but_for_what_it_shows(visible: np.ndarray, epoch: int) -> None:
    size = visible.shape
    frame = Frame(
        7, "overhead", np.full((*size, 3), 9, np.uint8), np.ones(size), np.eye(3) / 3, Pose.identity(), 1 / 3,
        visible, epoch,
    )  # fmt: skip
    back = read_frame(through_json(write_frame(frame)))
    assert (back.id, back.camera, back.stamp, back.epoch) == (7, "overhead", 1 / 3, epoch)
    assert np.array_equal(back.visible, visible)
    assert np.array_equal(back.matrix, frame.matrix)
    assert (back.image.shape, back.image.any(), back.depth) == ((*size, 3), False, None)


@given(st.lists(st.tuples(st.text(), finite, st.tuples(finite, finite, finite, finite))), finite)
def test_an_answer_comes_back(found: list[tuple], misses: float) -> None:
    answer = Answer("eye", tuple(Detection(*one) for one in found), Reliability(0.5, misses, 0.1, 0.2, 0.7))
    assert read_answer(through_json(write_answer(answer))) == answer
