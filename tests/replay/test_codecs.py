"""Nothing is lost between an answer of a cell and its plain form."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from executive.replay.recording_cell import BOX, FRAME, MOTION, POSE
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from executive.cell.frame import Answer, Detection, ErrorRates, Frame, Observation
from executive.cell.protocols import BehaviourStep
from executive.geometry import Pose, rotate_about_z
from executive.station.border import ANSWER, ARRAY, BEHAVIOUR_STEP, OBSERVATIONS, Codec, RecordedMotion

finite = st.floats(allow_nan=False, allow_infinity=False)
few = settings(max_examples=25)


def back(codec: Codec, answer: Any) -> Any:
    """Return an answer after its way through JSON."""
    return codec.decode(json.loads(json.dumps(codec.encode(answer))))


@few
@given(arrays(np.float64, (3, 2), elements=finite), st.floats(-4, 4))
def test_numbers_come_back_bit_by_bit(array: np.ndarray, angle: float) -> None:
    assert np.array_equal(back(ARRAY, array), array)
    pose = Pose(rotate_about_z(angle), array[:, 0])
    assert np.array_equal(back(POSE, pose).rotation, pose.rotation)
    assert np.array_equal(back(POSE, pose).position, pose.position)
    assert back(MOTION, RecordedMotion(angle)) == RecordedMotion(angle)
    assert back(BOX, (1, 2, 3.5, angle)) == (1, 2, 3.5, angle)


@few
@given(arrays(np.bool_, st.tuples(st.integers(1, 40), st.integers(1, 40))), st.integers(0, 9))
def test_a_frame_comes_back_without_its_image(visible: np.ndarray, change_count: int) -> None:
    size = visible.shape
    frame = Frame(
        7, "overhead", np.full((*size, 3), 9, np.uint8), np.ones(size), np.eye(3) / 3, Pose.identity(), 1 / 3,
        visible, change_count,
    )  # fmt: skip
    read = back(FRAME, frame)
    assert (read.id, read.camera, read.stamp, read.change_count) == (7, "overhead", 1 / 3, change_count)
    assert np.array_equal(read.visible, visible)
    assert np.array_equal(read.matrix, frame.matrix)
    assert (read.image.shape, read.image.any(), read.depth) == ((*size, 3), False, None)


detections = st.builds(
    Detection, st.text(max_size=5), finite, st.tuples(finite, finite, finite, finite), finite
)
some = st.lists(detections, max_size=4).map(tuple)


@few
@given(some, some, some, finite)
def test_an_answer_comes_back(found: tuple, doubtful: tuple, unknown: tuple, misses: float) -> None:
    answer = Answer("eye", found, ErrorRates(0.5, misses, 0.1, 0.2, 0.7), doubtful, unknown)
    assert back(ANSWER, answer) == answer


@few
@given(detections, arrays(np.float64, 3, elements=finite), finite, st.booleans(), st.text(max_size=5))
def test_observations_come_back(
    detection: Detection, position: np.ndarray, std: float, confident: bool, contradiction: str
) -> None:
    (read,) = back(OBSERVATIONS, [Observation(detection, position, std, confident, contradiction)])
    assert np.array_equal(read.position, position)
    others = (read.detection, read.std, read.is_confident, read.contradiction)
    assert others == (detection, std, confident, contradiction)


def test_collections_that_a_behaviour_wrote_keep_their_types() -> None:
    values = {"place": (0.5, [1]), "seen": {"duck", "cube"}, "nested": [(1, 2)]}
    step = BehaviourStep("SUCCESS", "", values)
    restored = back(BEHAVIOUR_STEP, step).values
    assert restored == {"place": (0.5, [1]), "seen": {"duck", "cube"}}, "JSON cannot restore the nested tuple"
