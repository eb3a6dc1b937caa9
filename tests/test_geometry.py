from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from executive.geometry import Pose, make_tool_down_pose, rotate_about_z

unit = st.floats(-1, 1, allow_nan=False)
quaternions = st.tuples(unit, unit, unit, unit).filter(lambda q: np.linalg.norm(q) > 0.1)
points = st.tuples(unit, unit, unit)


@given(points, quaternions, points)
def test_the_inverse_undoes_a_pose(position, quaternion, point) -> None:
    X = Pose.of(position, quaternion)
    assert np.allclose(X.inverse().apply(X.apply(point)), point, atol=1e-9)
    assert np.allclose((X @ X.inverse()).rotation, np.eye(3), atol=1e-9)


@given(quaternions)
def test_a_quaternion_survives_the_way_through_a_matrix(quaternion) -> None:
    q = np.asarray(quaternion) / np.linalg.norm(quaternion)
    back = Pose.of((0, 0, 0), q).quaternion
    assert np.allclose(back, q, atol=1e-9) or np.allclose(back, -q, atol=1e-9)


def test_a_rotation_vector_is_the_axis_times_the_angle() -> None:
    assert np.allclose(make_tool_down_pose((0, 0, 0), yaw=np.pi).rotation_vector, [np.pi, 0, 0])
    assert np.allclose(Pose(rotate_about_z(-0.4), np.zeros(3)).rotation_vector, [0, 0, -0.4])
