"""Sections of a cell file: calibration of a camera, in the form of OpenCV or ROS.

The loader writes every matrix of a calibration as the list of its entries, row by row.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import numpy as np
from pydantic import Field, TypeAdapter, ValidationInfo, WithJsonSchema, field_validator, model_validator

from executive.cell.config.section import Coordinate, Section
from executive.geometry import Pose

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
