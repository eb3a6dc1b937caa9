"""Changes of a scene file to the simulated world: cell, light, table and unknown objects."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from executive.cell.config import CalibrationConfig, CameraConfig, CellConfig, ObjectConfig
from executive.cell.config.calibration import TransformConfig
from executive.cell.config.cameras import POSE_AND_FOV_KEYS
from executive.cells.sim.arrangements import DAMAGED_MODEL_NUMBER, load_unknown_model, scale_model
from executive.cells.sim.scene_file import ANY_CLASS, SceneConfig, UnknownConfig
from executive.cells.sim.table_top import WOOD_TEXTURE
from executive.cells.sim.world import World
from executive.geometry import Pose
from executive.perception import camera_model


def build_world(config: CellConfig, scene: SceneConfig, *, gui: bool = False) -> World:
    """Return the world of a scene, without objects; `gui` shows it in a window.

    The attribute `config` of the world is the cell file with the changes of the scene.
    """
    world = World(apply_scene(config, scene), gui=gui)
    if (scene.table.colour, scene.table.texture) != ((1.0, 1.0, 1.0), WOOD_TEXTURE):
        world.table_top.paint(scene.table.colour, scene.table.texture)
    return world


def apply_scene(config: CellConfig, scene: SceneConfig) -> CellConfig:
    """Return the cell configuration with the objects, the table and the camera of a scene."""
    table_changes = scene.table.model_dump(include={"objects", "gap", "stacked"}, exclude_none=True)
    table = config.table.model_copy(update=table_changes)
    objects = {label: _change_object(label, model, scene) for label, model in config.objects.items()}
    cameras = {name: _change_camera(camera, scene) for name, camera in config.cameras.items()}
    return config.model_copy(update={"table": table, "objects": objects, "cameras": cameras})


def draw_unknown_models(unknown: UnknownConfig | None, rng: np.random.Generator) -> list[ObjectConfig]:
    """Return random models of objects without a class; none if `unknown` is None."""
    if unknown is None:
        return []
    first_number, last_number = unknown.models
    numbers = [number for number in range(first_number, last_number + 1) if number != DAMAGED_MODEL_NUMBER]
    count = int(rng.integers(*unknown.count, endpoint=True))
    models = [load_unknown_model(int(number)) for number in rng.choice(numbers, count)]
    colours = {"colours": unknown.colours}
    return [scale_model(model, unknown.scale).model_copy(update=colours) for model in models]


def _change_object(label: str, model: ObjectConfig, scene: SceneConfig) -> ObjectConfig:
    """Return an object class with the colours and the size of a scene."""
    section = scene.objects.get(label, scene.objects.get(ANY_CLASS))
    if section is None:
        return model
    colours = section.colours or model.colours
    if len(colours) == 1:
        # The number of colours is kept, because each later random choice depends on this number.
        colours *= len(model.colours)
    return scale_model(model, section.scale).model_copy(update={"colours": colours})


def _change_camera(camera: CameraConfig, scene: SceneConfig) -> CameraConfig:
    """Return a camera with the errors of a scene, whose key `calibration` contains pose and intrinsics."""
    section = scene.camera
    if section.noise is not None:
        camera = camera.model_copy(update={"noise": section.noise})
    if not any((*section.shift, *section.turn_deg, *section.orbit_deg)) and section.fov_factor == 1:
        return camera
    matrix, X_MC = camera_model.compute_calibration(camera)
    if any(section.orbit_deg):
        centre = camera_model.intersect_plane(matrix, X_MC, matrix[:2, 2], 0.0)
        X_MC = Pose.of(centre) @ _make_rotation(section.orbit_deg) @ Pose.of(-centre) @ X_MC
    X_MC = Pose.of(section.shift) @ X_MC @ _make_rotation(section.turn_deg)
    fov = camera_model.compute_field_of_view(matrix, camera.height) * section.fov_factor
    factor = camera_model.compute_camera_matrix(camera.width, camera.height, fov)[1, 1] / matrix[1, 1]
    (fx, fy), (cx, cy) = factor * matrix.diagonal()[:2], matrix[:2, 2] - 0.5
    pose = TransformConfig(rotation=tuple(X_MC.rotation_vector), translation=tuple(X_MC.position))
    entries = (fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
    calibration = CalibrationConfig(matrix=entries, camera_to_mount=pose)
    return camera.model_copy(update={**dict.fromkeys(POSE_AND_FOV_KEYS), "calibration": calibration})


def _make_rotation(vector_deg: ArrayLike) -> Pose:
    """Return the pose at the origin with the rotation of a rotation vector `(3,)` [degree]."""
    return Pose(np.asarray(cv2.Rodrigues(np.radians(vector_deg))[0]), np.zeros(3))
