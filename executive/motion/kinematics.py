"""Forward and analytic inverse kinematics of the KUKA LBR iiwa 14.

Its seven joints are a shoulder, an elbow and a wrist (S-R-S): the axes of joints 1-3 meet in the
shoulder, those of joints 5-7 in the wrist, and

    R_WT = Rz(q1) Ry(q2) Rz(q3) Ry(-q4) Rz(q5) Ry(q6) Rz(q7).

A tool pose therefore fixes the wrist, the triangle shoulder-elbow-wrist fixes joint 4, and the elbow
may swivel on a circle about the line from shoulder to wrist. Each swivel angle has eight solutions:
shoulder, elbow and wrist can each be flipped, `(a, b, c) -> (a + π, -b, c + π)`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from executive.errors import Unreachable
from executive.geometry import Array, Pose

FLANGE_OFFSET = 0.045
"""From the origin of link 7 to the flange's outer face along its z axis [m]."""

SHOULDER_HEIGHT, UPPER_ARM, FOREARM, WRIST_TO_FLANGE = 0.36, 0.42, 0.40, 0.081 + FLANGE_OFFSET
"""[m]; pybullet_data kuka_iiwa/model.urdf."""

BRANCHES = np.array([[s, e, w] for s in (1, -1) for e in (1, -1) for w in (1, -1)])
"""Signs of joints 2, 4 and 6 in the eight solutions of one swivel angle, `(8, 3)`."""

_BENT = 120.0, 115.0, 110.0, 105.0, 100.0, 95.0, 90.0  # [degree]
_APART = -0.0132, -0.0059, 0.0012, 0.0079, 0.0141, 0.0195, 0.0237  # [m]

_FLIPPED = np.zeros((8, 7))
_FLIPPED[:, [0, 2]] += (BRANCHES[:, :1] < 0) * math.pi
_FLIPPED[:, [2, 4]] += (BRANCHES[:, 1:2] < 0) * math.pi
_FLIPPED[:, [4, 6]] += (BRANCHES[:, 2:] < 0) * math.pi
_SIGNS = np.ones((8, 7))
_SIGNS[:, [1, 3, 5]] = BRANCHES
_IS_Z = (True, False, True, False, True, False, True)
_ROUNDING = 1e-9  # [m]


def wrapped(angle: Array) -> Array:
    """Return every `angle` [rad] turned by full turns into [-π, π)."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def fold(distance: float) -> float:
    """Return how far joint 6 may bend for link 7 to stay `distance` [m] away from link 5 [rad].

    How far apart they are depends on joint 6 alone, to 0.3 mm; taken from the collision shapes of
    pybullet_data kuka_iiwa/model.urdf. 90 degrees are always allowed.
    """
    return math.radians(float(np.interp(distance, _APART, _BENT)))


class Kinematics:
    """An iiwa 14 at the world's origin with a straight tool on its flange.

    Attributes:
        reach: From the wrist to the tool centre point [m].
        position_limit: Largest joint angle to either side `(7,)` [rad].
        nearest, farthest: Smallest and largest distance of the wrist from the shoulder [m].
    """

    def __init__(self, tool_length: float, position_limit: ArrayLike) -> None:
        self.reach = WRIST_TO_FLANGE + tool_length
        self.position_limit = np.asarray(position_limit, dtype=float)
        bend = math.cos(self.position_limit[3])
        self.nearest = math.sqrt(UPPER_ARM**2 + FOREARM**2 + 2 * UPPER_ARM * FOREARM * bend)
        self.farthest = UPPER_ARM + FOREARM
        self._tool_length = tool_length

    def forward(self, q: ArrayLike) -> Pose:
        """Return the tool pose `X_WT` at the joint positions `q` `(7,)` [rad]."""
        return self._frames(q)[-1]

    def flange(self, q: ArrayLike) -> Pose:
        """Return the flange's pose `X_WF` at `q` `(7,)` [rad]; the tool is fixed on it along z."""
        X_WT = self.forward(q)
        return Pose(X_WT.rotation, X_WT.position - self._tool_length * X_WT.rotation[:, 2])

    def joint_frames(self, q: ArrayLike) -> tuple[Pose, ...]:
        """Return, for joints 1 to 7, the frame that turns with the joint, z along the arm, at its centre."""
        return tuple(self._frames(q)[:-1])

    def tips(self, qs: Array) -> tuple[Array, Array]:
        """Return tool centre points `(N, 3)` [m] and tool axes `(N, 3)` at many `qs` `(N, 7)` [rad].

        Two vectors are turned from joint to joint, from the wrist to the base: a fifth of the work of
        whole frames. Joint 7 turns the tool about its axis and counts for nothing.
        """
        cosines, sines = np.cos(qs.T), np.sin(qs.T)
        zero = np.zeros(len(qs))
        axis = np.array([sines[5], zero, cosines[5]])
        axis = np.array([cosines[4] * axis[0], sines[4] * axis[0], axis[2]])
        tip = self.reach * axis
        tip[2] += FOREARM
        both = np.stack([tip, axis], axis=1)  # (3, 2, N)
        both = _about_y(both, cosines[3], -sines[3])
        both[2, 0] += UPPER_ARM
        for joint in (2, 1, 0):
            turn = _about_y if joint == 1 else _about_z
            both = turn(both, cosines[joint], sines[joint])
        both[2, 0] += SHOULDER_HEIGHT
        return both[:, 0].T, both[:, 1].T

    def swivel(self, q: ArrayLike) -> float:
        """Return the elbow's angle about the line from shoulder to wrist [rad]; 0 is up."""
        frames = self.joint_frames(q)
        shoulder, elbow, wrist = (frames[i].position for i in (1, 3, 5))
        _, up, side = _triangle_frame(wrist - shoulder)
        return math.atan2(float((elbow - shoulder) @ side), float((elbow - shoulder) @ up))

    def branch(self, q: ArrayLike) -> int:
        """Return the row of `BRANCHES` that `q` `(7,)` belongs to."""
        negative = np.asarray(q, dtype=float)[[1, 3, 5]] < 0
        return int(negative @ [4, 2, 1])

    def grid(self, X_WT: Pose, swivels: Array) -> Array:
        """Return every solution of a tool pose as `(8, S, 7)` [rad]: by branch and by swivel angle `(S,)`.

        Joint limits are not looked at.

        Raises:
            Unreachable: The wrist is too near to or too far from the shoulder.
        """
        wrist = X_WT.position - self.reach * X_WT.rotation[:, 2]
        line = wrist - (0.0, 0.0, SHOULDER_HEIGHT)
        distance = self._distance(X_WT, line)
        n, up, side = _triangle_frame(line)
        cos4 = (distance**2 - UPPER_ARM**2 - FOREARM**2) / (2 * UPPER_ARM * FOREARM)
        q4 = math.acos(min(1.0, max(-1.0, cos4)))
        cos_lift = (UPPER_ARM**2 + distance**2 - FOREARM**2) / (2 * UPPER_ARM * distance)
        lift = math.acos(min(1.0, max(-1.0, cos_lift)))

        out = np.outer(np.cos(swivels), up) + np.outer(np.sin(swivels), side)
        # Frame 3: z along the upper arm, y normal to the triangle, x completes it.
        z3 = math.cos(lift) * n + math.sin(lift) * out
        y3 = np.cross(n, out)
        x3 = np.asarray(np.cross(y3, z3), dtype=np.float64)
        x4 = math.cos(q4) * x3 + math.sin(q4) * z3
        z4 = -math.sin(q4) * x3 + math.cos(q4) * z3
        R_47 = np.stack([x4, y3, z4], axis=-2) @ X_WT.rotation

        base = np.empty((len(swivels), 7))
        base[:, 0], base[:, 1], base[:, 2] = _zyz(x3, y3, z3)
        base[:, 3] = q4
        columns = R_47.transpose(2, 0, 1)
        base[:, 4], base[:, 5], base[:, 6] = _zyz(*columns)
        return wrapped(base * _SIGNS[:, None] + _FLIPPED[:, None])

    def outside_limits(self, X_WT: Pose, rejected: Array) -> Unreachable:
        """Return the error that says which joint of the `rejected` solutions `(N, 7)` is least outside."""
        excess = np.abs(rejected) - self.position_limit
        best = excess[np.argmin(np.max(excess, axis=1))]
        joint = int(np.argmax(best))
        return Unreachable(
            f"the tool cannot reach {_text(X_WT)}: no swivel of the elbow keeps every joint inside its "
            f"limits; the best one leaves joint {joint + 1} {math.degrees(best[joint]):.1f}° outside "
            f"±{math.degrees(self.position_limit[joint]):.0f}°"
        )

    def _distance(self, X_WT: Pose, line: Array) -> float:
        distance = float(np.linalg.norm(line))
        if distance > self.farthest + _ROUNDING:
            how = f"{distance - self.farthest:.3f} m farther than the arm is long ({self.farthest:.2f} m)"
        elif distance < self.nearest - _ROUNDING:
            how = f"{self.nearest - distance:.3f} m nearer than joint 4 can fold ({self.nearest:.2f} m)"
        else:
            return distance
        raise Unreachable(
            f"the tool cannot reach {_text(X_WT)}: its wrist would be {distance:.3f} m from the shoulder, "
            f"{how}"
        )

    def _frames(self, q: ArrayLike) -> list[Pose]:
        """Return the frames of joints 1 to 7, see `joint_frames`, and of the tool."""
        frames = []
        R, p = np.eye(3), np.array([0.0, 0.0, SHOULDER_HEIGHT])
        lengths = {3: UPPER_ARM, 5: FOREARM}
        angles = np.asarray(q, dtype=float) * (1, 1, 1, -1, 1, 1, 1)
        for i, (c, s) in enumerate(zip(np.cos(angles), np.sin(angles), strict=True)):
            p = p + lengths.get(i, 0.0) * R[:, 2]
            R = R @ _turn(c, s, _IS_Z[i])
            frames.append(Pose(R, p))
        return [*frames, Pose(R, p + self.reach * R[:, 2])]


def _about_z(v: Array, c: Array, s: Array) -> Array:
    """Return vectors `(3, ...)` turned about z."""
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]])


def _about_y(v: Array, c: Array, s: Array) -> Array:
    """Return vectors `(3, ...)` turned about y."""
    return np.array([c * v[0] + s * v[2], v[1], c * v[2] - s * v[0]])


def _turn(c: float, s: float, is_z: bool) -> Array:
    """Return the rotation about z, or about y, by the angle of a cosine and a sine."""
    if is_z:
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _zyz(x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
    """Return `a`, `b >= 0`, `c` with `Rz(a) Ry(b) Rz(c) = [x y z]`, given as columns `(N, 3)`."""
    sine = np.hypot(z[:, 0], z[:, 1])
    straight = sine < 1e-9  # only the sum (or difference) of a and c is defined: all of it goes to c
    a = np.where(straight, 0.0, np.arctan2(z[:, 1], z[:, 0]))
    c = np.where(
        straight,
        np.arctan2(x[:, 1], np.where(z[:, 2] > 0, x[:, 0], -x[:, 0])),
        np.arctan2(y[:, 2], -x[:, 2]),
    )
    return a, np.arctan2(sine, z[:, 2]), c


def _triangle_frame(line: Array) -> tuple[Array, Array, Array]:
    """Return the unit vector along `line`, the one square to it nearest to up, and the third."""
    n = line / np.linalg.norm(line)
    up = np.array([0.0, 0.0, 1.0]) if abs(n[2]) < 0.9999 else np.array([1.0, 0.0, 0.0])
    up = up - (up @ n) * n
    up /= np.linalg.norm(up)
    return n, up, np.cross(n, up)


def _text(X_WT: Pose) -> str:
    x, y, z = X_WT.position
    return f"({x:.3f}, {y:.3f}, {z:.3f}) m"
