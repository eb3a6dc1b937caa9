"""Changes of a scene file to the simulated world: cell, lamp, table and unknown objects."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from executive.cell.config import CalibrationConfig, CameraConfig, CellConfig, ObjectConfig, TransformConfig
from executive.cell.config.cameras import POSE_AND_FOV_KEYS
from executive.cells.sim.arrangements import DAMAGED_MODEL, resize, unknown_model
from executive.cells.sim.camera import Light
from executive.cells.sim.scene_file import (
    ANY,
    LightConfig,
    SceneCameraConfig,
    SceneConfig,
    SceneObjectConfig,
    UnknownConfig,
)
from executive.cells.sim.table_top import WOOD
from executive.cells.sim.world import World
from executive.geometry import Pose
from executive.perception.camera_model import (
    compute_calibration,
    compute_camera_matrix,
    compute_field_of_view,
    intersect_plane,
)


def true_cell(config: CellConfig, scene: SceneConfig) -> CellConfig:
    """Return the simulated cell: a declared cell with the objects, table and camera of a scene."""
    table = {key: getattr(scene.table, key) for key in ("objects", "gap", "stacked")}
    table = {key: value for key, value in table.items() if value is not None}
    name, camera = next(iter(config.cameras.items()))
    return config.model_copy(
        update={
            "table": config.table.model_copy(update=table),
            "objects": {
                label: _true_object(model, scene.objects.get(label, scene.objects.get(ANY)))
                for label, model in config.objects.items()
            },
            "cameras": {**config.cameras, name: _true_camera(camera, scene.camera)},
        }
    )


def build_light(light: LightConfig) -> Light:
    """Return the lamp and the ambient light of a scene."""
    scaled = {key: light.brightness * getattr(light, key) for key in ("ambient", "diffuse", "specular")}
    return Light.model_construct(**{**light.model_dump(exclude={"brightness"}), **scaled})


def paint_table(world: World, scene: SceneConfig) -> None:
    """Give the table of a world the colour and the texture of a scene."""
    if (scene.table.colour, scene.table.texture) != ((1.0, 1.0, 1.0), WOOD):
        world.table_top.paint(scene.table.colour, scene.table.texture)


def unknown_objects(unknown: UnknownConfig | None, rng: np.random.Generator) -> list[ObjectConfig]:
    """Return random models of objects without a class; none if `unknown` is None."""
    if unknown is None:
        return []
    first, last = unknown.models
    numbers = [number for number in range(first, last + 1) if number != DAMAGED_MODEL]
    count = int(rng.integers(*unknown.count, endpoint=True))
    models = [resize(unknown_model(int(number)), unknown.scale) for number in rng.choice(numbers, count)]
    return [model.model_copy(update={"colours": unknown.colours}) for model in models]


def _true_object(model: ObjectConfig, appearance: SceneObjectConfig | None) -> ObjectConfig:
    """Return an object class with the colours and size of a scene."""
    if appearance is None:
        return model
    colours = appearance.colours or model.colours
    if len(colours) == 1:
        # With one colour, no random number is drawn: later rotations and stacks would change.
        colours *= len(model.colours)
    return resize(model, appearance.scale).model_copy(update={"colours": colours})


def _true_camera(camera: CameraConfig, error: SceneCameraConfig) -> CameraConfig:
    """Return a camera with the errors of a scene, its pose and intrinsics as a calibration."""
    if error.noise is not None:
        camera = camera.model_copy(update={"noise": error.noise})
    if not any((*error.shift, *error.turn_deg, *error.orbit_deg)) and error.fov_factor == 1:
        return camera
    matrix, X_MC = compute_calibration(camera)
    if any(error.orbit_deg):
        centre = intersect_plane(matrix, X_MC, matrix[:2, 2], 0.0)
        X_MC = Pose.of(centre) @ _make_rotation(error.orbit_deg) @ Pose.of(-centre) @ X_MC
    X_MC = Pose.of(error.shift) @ X_MC @ _make_rotation(error.turn_deg)
    fov = compute_field_of_view(matrix, camera.height) * error.fov_factor
    zoom = compute_camera_matrix(camera.width, camera.height, fov)[1, 1] / matrix[1, 1]
    (fx, fy), (cx, cy) = zoom * matrix.diagonal()[:2], matrix[:2, 2] - 0.5
    mounted = TransformConfig(rotation=tuple(X_MC.rotation_vector), translation=tuple(X_MC.position))
    rows = ((fx, 0.0, cx), (0.0, fy, cy), (0.0, 0.0, 1.0))
    calibration = CalibrationConfig(matrix=rows, camera_to_mount=mounted)
    return camera.model_copy(update={**dict.fromkeys(POSE_AND_FOV_KEYS), "calibration": calibration})


def _make_rotation(vector_deg: ArrayLike) -> Pose:
    """Return the rotation of a rotation vector `(3,)` [degree]."""
    return Pose(np.asarray(cv2.Rodrigues(np.radians(vector_deg))[0]), np.zeros(3))
