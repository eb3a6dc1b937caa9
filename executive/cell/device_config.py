"""Sections of a cell file about devices: tool, motion, cameras with calibration, noise and depth.

Each field is a key of `missions/cells/*.yaml`, in SI units. Values of keys that end in `_deg` are in degrees.
The loader writes every matrix of a calibration as the list of its entries, row by row.
"""

from __future__ import annotations

import re
from typing import Annotated, Literal, TypeAlias, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationInfo,
    WithJsonSchema,
    field_validator,
    model_validator,
)

from executive.geometry import Pose

STEP = 1 / 240
"""Physics step of the simulation, spacing of the checked samples of motions, and default time between two
ticks [s]."""

Number = TypeVar("Number", int, float)


def check_ascending(pair: tuple[Number, Number]) -> tuple[Number, Number]:
    """Return a range; a lower limit above the upper limit raises `ValueError`."""
    if pair[0] > pair[1]:
        raise ValueError(f"must be in ascending order: {pair[0]:g} is greater than {pair[1]:g}")
    return pair


NAME_PATTERN = re.compile(r"\w[\w -]{0,63}")
"""Permitted names: a letter, digit or `_`, and at most 63 letters, digits, blanks, `_` and `-`."""


def check_name(name: str) -> str:
    """Return a name that can be part of a file name; any other name raises `ValueError`."""
    if not NAME_PATTERN.fullmatch(name):
        raise ValueError('must be a name of at most 64 letters, digits, blanks, "_" and "-"')
    return name


Name = Annotated[str, AfterValidator(check_name)]
MIN_LENGTH = 1e-4
"""Minimum length in a cell [m], below the error of each sensor."""
MAX_LENGTH = 10.0
"""Maximum length in a cell [m], above the reach of each arm."""
Length = Annotated[float, Field(ge=MIN_LENGTH, le=MAX_LENGTH)]
"""A positive length [m]."""
Distance = Annotated[float, Field(ge=0, le=MAX_LENGTH)]
"""A length that may be 0 [m]."""
Coordinate = Annotated[float, Field(ge=-MAX_LENGTH, le=MAX_LENGTH)]
"""A coordinate of a point [m]."""
Count = Annotated[int, Field(ge=1, le=1000)]
"""A positive number of objects; no bin, table or image has more than 1000 objects."""
Natural = Annotated[int, Field(ge=0, le=1000)]
"""An integer that may be 0."""
Range = Annotated[tuple[Coordinate, Coordinate], AfterValidator(check_ascending)]
"""Minimum and maximum coordinate [m]."""
Vector = tuple[Coordinate, Coordinate, Coordinate]
"""x, y, z [m]."""
Angle = Annotated[float, Field(ge=-360, le=360)]
"""An angle [degree], up to one revolution in each direction."""
Angles = tuple[Angle, Angle, Angle]
"""Roll, pitch, yaw [degree]."""
Force = Annotated[float, Field(ge=1e-3, le=1e4)]
"""A force [N]: from the weight of 0.1 g to the weight of 1 t."""
Fraction = Annotated[float, Field(ge=0, le=1)]
"""A fraction, 0 to 1."""
Colour = tuple[Fraction, Fraction, Fraction]
"""Red, green and blue, 0 to 1."""
Seconds = Annotated[float, Field(ge=0, le=600)]
"""A duration [s]; more than ten minutes is an error in the cell file."""


class Section(BaseModel):
    """A section of a cell file: unknown keys are errors, and the values are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class ClockConfig(Section):
    """The clock of the cell."""

    step: float = Field(STEP, ge=0.999 * STEP, le=0.1)
    """Time between two ticks of the behaviour tree [s]; in simulation a multiple of 1/240 s. Devices follow
    their motions at their own rate."""


class MotionConfig(Section):
    """Parameters of motion planning."""

    margin: Distance = 0.005
    """Minimum distance of arm, tool and load from all obstacles during a motion [m]."""
    clearance: Length = 0.04
    """Clearance over the highest wall and pile [m] in the fallback motion, which stops at every corner and is
    used if no other motion is collision-free."""
    descent: float = Field(0.005, ge=MIN_LENGTH, le=0.1)
    """Height above the expected surface at which the guarded descent of an approach starts [m]."""
    slow_descent: float = Field(0.001, ge=MIN_LENGTH, le=0.1)
    """Height above the expected surface from which the guarded descent is slow [m], at most `descent`, if a
    touch has confirmed the height of the class; else, the whole guarded descent is slow. The default is the
    distance at which the simulated tool feels a surface."""
    descent_speed: float = Field(0.035, ge=0.001, le=0.25)
    """Tool speed of the slow part of the guarded descent [m/s]; the maximum is the reduced speed of ISO
    10218."""
    straight: float = Field(0.0, ge=0, le=0.2)
    """Length of the straight vertical segment at the end of a motion into a bin, and at the start of a motion
    that begins upwards [m]."""
    planning_time: float = Field(0.1, ge=0.1, le=60)
    """Planning time of a motion that was not planned ahead, on the clock of the run [s]. The lower bound is
    the measured 99th percentile of the planning time, 94 ms, rounded up (`tests/benchmarks/README.md`)."""


MatrixForm: TypeAlias = (
    tuple[float, ...] | tuple[tuple[float, ...], ...] | dict[str, int | str | tuple[float, ...]]
)
MATRIX_SCHEMA = WithJsonSchema(TypeAdapter(MatrixForm).json_schema())
"""JSON schema of a matrix in a cell file: a list of entries, a list of rows, or a mapping with `data`."""
Pixels = Annotated[float, Field(ge=-1e5, le=1e5)]
"""An entry of a camera matrix [pixel]; at a focal length of 100,000 pixels, 640 pixels span 0.4 degrees."""
RotationComponent = Annotated[float, Field(ge=-7, le=7)]
"""A component of a rotation vector [rad], where 7 rad are more than one revolution, or of a matrix."""
Quaternion = tuple[float, float, float, float]
MAX_ROTATION_ERROR = 0.003
"""Maximum entry of R Rᵀ - I, for numbers with at least three decimal places."""


class TransformConfig(Section):
    """A coordinate transformation in OpenCV's form: p' = R p + t.

    The section contains `translation` and one of the other keys.
    """

    rotation: Annotated[tuple[RotationComponent, ...], MATRIX_SCHEMA] = ()
    """R: nine entries, or OpenCV's rvec, the axis times the angle (three numbers) [rad]."""
    quaternion_xyzw: Quaternion | None = None
    """Unit quaternion of R with the scalar last, as in ROS and SciPy."""
    quaternion_wxyz: Quaternion | None = None
    """Unit quaternion of R with the scalar first, as in Eigen and MuJoCo."""
    translation: Annotated[tuple[Coordinate, Coordinate, Coordinate], MATRIX_SCHEMA]
    """OpenCV's tvec t: x, y, z [m]."""

    @field_validator("rotation", "quaternion_xyzw", "quaternion_wxyz")
    @classmethod
    def _check_rotation(cls, entries: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        if not entries:  # `_check_keys` reports a missing rotation.
            return entries
        if info.field_name == "rotation" and len(entries) not in (3, 9):
            raise ValueError(
                f"needs 3 or 9 numbers, not {len(entries)}; "
                "name a quaternion by its order, quaternion_xyzw or quaternion_wxyz"
            )
        # The rows of R, and a unit quaternion as the only row, are orthonormal.
        rows = np.reshape(entries, (3, 3) if len(entries) == 9 else (1, -1))
        error = np.abs(rows @ rows.T - np.eye(len(rows))).max()
        determinant = np.linalg.det(rows) if len(rows) == 3 else 1.0
        if len(entries) > 3 and (error > MAX_ROTATION_ERROR or determinant < 0):
            norms = ", ".join(f"{norm:.4g}" for norm in np.linalg.norm(rows, axis=1))
            raise ValueError(
                "must not be scaled, reflected or rounded to few decimals (norms of rows: "
                f"{norms}; determinant: {determinant:.3g}; R Rᵀ - I up to {error:.3g})"
            )
        return entries

    @model_validator(mode="after")
    def _check_keys(self) -> TransformConfig:
        if sum(map(bool, (self.rotation, self.quaternion_xyzw, self.quaternion_wxyz))) != 1:
            raise ValueError("needs exactly one of rotation, quaternion_xyzw and quaternion_wxyz")
        return self

    def compute_pose(self) -> Pose:
        """Return the transformation with an orthonormal rotation."""
        # scipy.spatial is imported here because the import takes 0.3 s, and few cells need it.
        from scipy.spatial.transform import Rotation

        entries = np.array(self.rotation or self.quaternion_xyzw or np.roll(self.quaternion_wxyz or (), -1))
        if len(entries) == 9:
            rotation = Rotation.from_matrix(entries.reshape(3, 3))
        else:
            rotation = Rotation.from_quat(entries) if len(entries) == 4 else Rotation.from_rotvec(entries)
        return Pose(rotation.as_matrix(), np.array(self.translation))


class CalibrationConfig(Section):
    """Camera matrix and pose in the form of OpenCV's calibration, for images without distortion."""

    file: str = Field("", exclude=True)  # The loader inserts the content of the file.
    """Path of a `camera_info` file of ROS or a YAML file of OpenCV, relative to the cell file. It supplies
    the missing ones of the keys `matrix`, `width`, `height`, `distortion` and `distortion_model`."""
    matrix: Annotated[tuple[Pixels, ...], MATRIX_SCHEMA] = ()
    """[[fx, 0, cx], [0, fy, cy], [0, 0, 1]] [pixel]; as in OpenCV, pixel centres have integer coordinates."""
    width: int | None = None
    """Width of the calibrated images [pixel], which must be the width of the camera."""
    height: int | None = None
    """Height of the calibrated images [pixel], which must be the height of the camera."""
    distortion: Annotated[tuple[float, ...], MATRIX_SCHEMA] = ()
    """Distortion coefficients of OpenCV. The cell uses undistorted images, for instance by `cv2.undistort`
    with the same matrix."""
    distortion_model: Literal["plumb_bob", "rational_polynomial"] = "plumb_bob"
    """Distortion model of ROS. The matrix of a fisheye lens does not describe its undistorted images."""
    mount_to_camera: TransformConfig | None = None
    """Transformation of points into the camera frame, from the world frame (fixed camera) or the flange
    frame (wrist camera), for instance from `cv2.solvePnP`."""
    camera_to_mount: TransformConfig | None = None
    """Inverse of `mount_to_camera`, for instance from `cv2.calibrateHandEye`; exactly one key is required."""

    @field_validator("matrix", mode="before")
    @classmethod
    def _join_rows(cls, entries: object) -> object:
        """Return the entries of a matrix in rows, as earlier records of runs contain it."""
        if not isinstance(entries, list):
            return entries
        rows = [row if isinstance(row, list) else [row] for row in entries]
        return tuple(entry for row in rows for entry in row)

    @field_validator("matrix")
    @classmethod
    def _check_matrix(cls, entries: tuple[float, ...]) -> tuple[float, ...]:
        fixed_entries = entries[1:2] + entries[3:4] + entries[6:]
        if fixed_entries != (0, 0, 0, 0, 1) or min(entries[0], entries[4]) <= 0:
            raise ValueError(
                "must be the camera matrix K, [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx and fy above 0, "
                f"and neither transposed nor P, not {list(entries)}"
            )
        return entries

    @model_validator(mode="after")
    def _check_keys(self) -> CalibrationConfig:
        if not self.matrix:
            raise ValueError("needs a matrix, or a file with the key camera_matrix or K")
        if (self.mount_to_camera is None) == (self.camera_to_mount is None):
            raise ValueError("needs exactly one of mount_to_camera and camera_to_mount, its inverse")
        return self


POSE_AND_FOV_KEYS = ("position", "look_at", "up", "fov_deg")
"""Keys that a camera without a calibration needs for its pose and field of view."""


class NoiseConfig(Section):
    """Image noise of a camera, sampled for each frame with the seed of the run."""

    gain: Fraction = 0.02
    """Standard deviation of the random brightness factor of a frame; the mean of the factor is 1."""
    read: float = Field(2.0, ge=0, le=255)
    """Standard deviation of the noise of each pixel [grey level, 0 to 255]."""


class DepthConfig(Section):
    """A depth sensor registered to the camera, and its noise, sampled for each frame.

    The defaults model a RealSense D435 at 848 x 480 (focal length 425 pixels, baseline 50 mm). According to
    Intel's "Tuning depth cameras for best performance", the RMS error of a stereo camera at distance z is
    z² · subpixel error / (focal length · baseline); the subpixel error is 0.08 pixel. The dropout fractions
    and the correlation of neighbouring pixels are assumed.
    """

    floor: Distance = 0.0005
    """Standard deviation of the noise at distance 0 [m]."""
    growth: Fraction = 0.0038
    """Quadratic coefficient [1/m]: the standard deviation of the noise is floor + growth · distance²."""
    grain: float = Field(1.0, ge=0, le=100)
    """Standard deviation of the Gaussian kernel that smooths the noise [pixel]; 0: independent pixels."""
    step: Distance = 0.001
    """Resolution of the distances [m]; 0: exact distances."""
    edge: Length = 0.02
    """Minimum difference between the distances of neighbouring pixels that counts as an edge [m]."""
    edge_width: Natural = 2
    """Maximum distance from an edge at which `edge_dropout` applies [pixel]."""
    edge_dropout: Fraction = 0.7
    """Fraction of the pixels near an edge that have no measurement."""
    dropout: Fraction = 0.01
    """Fraction of all pixels that have no measurement."""


class CameraConfig(Section):
    """A camera, fixed in the world or mounted on the wrist.

    Pose and field of view are defined by `position`, `look_at`, `up` and `fov_deg`, or by `calibration`.
    """

    mount: Literal["fixed", "wrist"]
    """`fixed`: the pose is in the world frame. `wrist`: the pose is in the frame of the flange."""
    position: Vector | None = None
    """Optical centre: x, y, z [m]."""
    look_at: Vector | None = None
    """A point on the optical axis: x, y, z [m]."""
    up: Vector | None = None
    """Direction of the top of the image: x, y, z."""
    width: int = Field(640, ge=64, le=8192)
    """Image width [pixel]."""
    height: int = Field(480, ge=64, le=8192)
    """Image height [pixel]."""
    fov_deg: float | None = Field(None, gt=1, lt=179)
    """Vertical field of view [degree]."""
    calibration: CalibrationConfig | None = None
    """Camera matrix and pose, instead of `position`, `look_at`, `up` and `fov_deg`."""
    table_view: tuple[int, int, int, int]
    """Square region of the image that shows the workspace: left, top, right and bottom side [pixel]."""
    scan_poses: tuple[Name, ...] = Field(min_length=1)
    """Arm poses from which the camera sees the table, best first."""
    partial_views: bool = False
    """True if the camera shows only a part of the workspace from each scan pose, and all of it from all
    scan poses together. Objects at the border of an image are then ignored, because the image cuts them."""
    noise: NoiseConfig = NoiseConfig()
    """Image noise."""
    depth: DepthConfig | None = None
    """Depth sensor; by default there is none. `depth: {}` is a depth sensor with the default noise."""

    def get_view_box(self, view: str) -> tuple[int, int, int, int]:
        """Return the region of the image [pixel] that a view shows: `table` (the workspace) or `full`."""
        return self.table_view if view == "table" else (0, 0, self.width, self.height)

    @model_validator(mode="after")
    def _check_view_and_pose(self) -> CameraConfig:
        left, top, right, bottom = self.table_view
        is_inside = 0 <= left < right <= self.width and 0 <= top < bottom <= self.height
        if not is_inside or right - left != bottom - top:
            raise ValueError(
                f"needs a table_view that is a square inside its image of {self.width} x {self.height} "
                f"pixels, not {list(self.table_view)}"
            )
        present = [key for key in POSE_AND_FOV_KEYS if getattr(self, key) is not None]
        if self.calibration is not None and present:
            raise ValueError(f"must not have {', '.join(present)} besides calibration, which defines them")
        image = f"{self.width} x {self.height}"
        calibration = self.calibration
        if calibration and calibration.width and image != f"{calibration.width} x {calibration.height}":
            raise ValueError(
                f"has images of {image} pixels, but its calibration is for {calibration.width} x "
                f"{calibration.height}; correct width and height, or calibrate at this resolution"
            )
        if self.calibration is None and len(present) < len(POSE_AND_FOV_KEYS):
            missing = ", ".join(key for key in POSE_AND_FOV_KEYS if key not in present)
            raise ValueError(f"needs {missing}, or a calibration instead of {', '.join(POSE_AND_FOV_KEYS)}")
        if self.position is not None and self.look_at is not None and self.up is not None:
            axis = np.subtract(self.look_at, self.position)
            if np.linalg.norm(np.cross(axis, self.up)) < 1e-9:
                raise ValueError("needs a look_at other than position, and an up that is not along the axis")
        return self
