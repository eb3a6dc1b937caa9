"""Nothing is lost between an answer of a cell and its plain form."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from executive.cell.devices import CameraImage
from executive.cell.frame import Answer, Detection, ErrorRates, Observation
from executive.cell.protocols import BehaviourStep
from executive.geometry import Yaw
from executive.station.border import (
    ANSWER,
    ARRAY,
    BEHAVIOUR_STEP,
    IMAGE,
    MOTION,
    OBSERVATIONS,
    Codec,
    RecordedMotion,
)

finite = st.floats(allow_nan=False, allow_infinity=False)
few = settings(max_examples=25)


def back(codec: Codec, answer: Any) -> Any:
    """Return an answer after its way through JSON."""
    return codec.decode(json.loads(json.dumps(codec.encode(answer))))


@few
@given(arrays(np.float64, (3, 2), elements=finite), finite)
def test_numbers_come_back_bit_by_bit(array: np.ndarray, duration: float) -> None:
    assert np.array_equal(back(ARRAY, array), array)
    assert back(MOTION, RecordedMotion(duration)) == RecordedMotion(duration)


masks = arrays(np.bool_, st.tuples(st.integers(1, 40), st.integers(1, 40)))


@few
@given(masks, st.booleans(), finite)
def test_an_image_comes_back_black_and_without_depth(mask: np.ndarray, hides: bool, stamp: float) -> None:
    size = mask.shape
    visible = mask if hides else None
    read = back(IMAGE, CameraImage(np.full((*size, 3), 9, np.uint8), np.ones(size), stamp, visible))
    assert (read.colour.shape, read.colour.dtype, read.colour.any()) == ((*size, 3), np.uint8, False)
    assert (read.depth, read.stamp, read.true_detections) == (None, stamp, None)
    assert read.visible is None if visible is None else np.array_equal(read.visible, visible)


@pytest.mark.parametrize("size", [[0, 4], [-3, 4], [10**5, 10**5]])
def test_an_image_of_an_impossible_size_is_refused(size: list[int]) -> None:
    with pytest.raises(ValueError, match="an image of"):
        IMAGE.decode({"size": size, "stamp": 0.0, "visible": None})


points = st.tuples(finite, finite)
detections = st.builds(
    Detection,
    st.text(max_size=5), finite, st.tuples(finite, finite, finite, finite), finite,
    st.none() | st.lists(points, min_size=1, max_size=4).map(tuple),
)  # fmt: skip
some = st.lists(detections, max_size=4).map(tuple)


@few
@given(some, some, some, finite)
def test_an_answer_comes_back(found: tuple, doubtful: tuple, unknown: tuple, misses: float) -> None:
    answer = Answer("eye", found, ErrorRates(0.5, misses, 0.1, 0.2, 0.7), doubtful, unknown)
    assert back(ANSWER, answer) == answer


def test_detections_and_yaws_of_old_journals_are_read() -> None:
    detection = Detection("duck", 0.9, (1.0, 2.0, 3.0, 4.0), 0.1)
    observation = Observation(detection, np.zeros(3), 0.1, 2.0, True, "", Yaw(0.3, 0.01))
    (encoded,) = OBSERVATIONS.encode([observation])
    assert encoded[0] == ["duck", 0.9, [1.0, 2.0, 3.0, 4.0], 0.1], "an unknown outline takes no space"
    (read,) = OBSERVATIONS.decode([[*encoded[:-1], [0.3, 0.01]]])
    assert (read.detection, read.yaw) == (detection, Yaw(0.3, 0.01))


@few
@given(
    detections,
    arrays(np.float64, 3, elements=finite),
    finite,
    st.none() | st.builds(Yaw, finite, finite, st.integers(1, 6)),
)
def test_observations_come_back(
    detection: Detection, position: np.ndarray, value: float, yaw: Yaw | None
) -> None:
    (read,) = back(OBSERVATIONS, [Observation(detection, position, value, value, False, "size", yaw)])
    assert np.array_equal(read.position, position)
    others = (read.detection, read.std, read.stamp, read.is_confident, read.contradiction, read.yaw)
    assert others == (detection, value, value, False, "size", yaw)


def test_collections_that_a_behaviour_wrote_keep_their_types() -> None:
    values = {"place": (0.5, [1]), "seen": {"duck", "cube"}, "nested": [(1, 2)]}
    step = BehaviourStep("SUCCESS", "", values)
    restored = back(BEHAVIOUR_STEP, step).values
    assert restored == {"place": (0.5, [1]), "seen": {"duck", "cube"}}, "JSON cannot restore the nested tuple"
