"""Scene files: changes of the simulated world that the cell file does not declare."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field

from executive.cell.config import BinConfig, CellConfig, ObjectConfig
from executive.cell.device_config import (
    POSE_AND_FOV_KEYS,
    CalibrationConfig,
    CameraConfig,
    Colour,
    Fraction,
    Natural,
    NoiseConfig,
    Section,
    TransformConfig,
    check_ascending,
)
from executive.drivers.sim.camera import Light
from executive.drivers.sim.models import DAMAGED_MODEL_NUMBER, UNKNOWN_MODEL_COUNT, scale_model
from executive.drivers.sim.world import TEXTURES, WOOD_TEXTURE, World
from executive.geometry import Pose
from executive.perception.camera_model import (
    compute_calibration,
    compute_camera_matrix,
    compute_field_of_view,
    intersect_plane,
)
from executive.text.files import read_source
from executive.text.findings import Finding, MissionError, make_error, sort_findings, suggest_choice
from executive.text.validate import find_span, validate
from executive.text.yaml_files import YamlNode, parse_yaml

ANY_CLASS = "any"
"""Key in `objects` of the section for all classes without their own section."""
MAX_FOV_DEG = 178.0
"""Maximum vertical field of view of a camera [degree]."""


def _check_texture(name: str) -> str:
    if name not in TEXTURES:
        last_pattern = TEXTURES[-1]
        raise ValueError(f'must be "wood", "plain", or "pattern 0" to "{last_pattern}", not "{name}"')
    return name


def _check_model_range(numbers: tuple[int, int]) -> tuple[int, int]:
    if set(numbers) == {DAMAGED_MODEL_NUMBER}:
        raise ValueError(
            f"contains only number {DAMAGED_MODEL_NUMBER}, whose mesh is damaged; name a wider range"
        )
    return numbers


def _check_palette(colours: tuple[Colour, ...]) -> tuple[Colour, ...]:
    if not colours:
        raise ValueError("needs at least one colour [r, g, b], each 0 to 1")
    return colours


Displacement = Annotated[float, Field(ge=-1, le=1)]
AngleDeg = Annotated[float, Field(ge=-90, le=90)]
CountRange = Annotated[tuple[Natural, Natural], AfterValidator(check_ascending)]
ModelNumber = Annotated[int, Field(ge=0, lt=UNKNOWN_MODEL_COUNT)]
ModelRange = Annotated[
    tuple[ModelNumber, ModelNumber], AfterValidator(check_ascending), AfterValidator(_check_model_range)
]
Palette = Annotated[tuple[Colour, ...], AfterValidator(_check_palette)]


class SceneTableConfig(Section):
    """The surface of the table and the arrangement of the objects."""

    colour: Colour = (1.0, 1.0, 1.0)
    """Factors on the texture: r, g, b, each 0 to 1."""
    texture: Annotated[str, AfterValidator(_check_texture)] = WOOD_TEXTURE
    """`wood`, `plain` (white), or a generated texture, `pattern 0` to `pattern 23`."""
    objects: CountRange | None = None
    """Minimum and maximum number of objects of the cell's classes; by default as in the cell file."""
    gap: float | None = Field(None, ge=0, le=0.5)
    """Minimum distance between the outlines of two objects [m]; 0: outlines may touch. By default
    as in the cell file."""
    stacked: Fraction | None = None
    """Fraction of the objects that are put on top of another object, 0 to 1; objects of an unstable
    stack return to the table. By default as in the cell file."""


class SceneObjectConfig(Section):
    """Colours and size of one object class."""

    colours: Palette | None = None
    """Colours (r, g, b, each 0 to 1) of which each object gets one; by default those of the cell
    file."""
    scale: float = Field(1.0, ge=0.2, le=3)
    """Factor on the size that the cell file declares."""


class UnknownConfig(Section):
    """Objects without a class, in addition to the other objects; they are never stacked."""

    count: CountRange
    """Minimum and maximum number of these objects."""
    models: ModelRange = (800, 999)
    """First and last number of the shapes in `random_urdfs` of pybullet_data, 0 to 999; the shipped detector
    was trained with 0 to 799."""
    meshes: tuple[str, ...] = ()
    """Absolute paths of meshes that replace these shapes."""
    scale: float = Field(0.6, ge=0.1, le=2)
    """Factor on the size of the shapes; most shapes are 0.12 m long at factor 1."""
    colours: Palette = ((1.0, 1.0, 1.0),)
    """Colours (r, g, b, each 0 to 1) of which each object gets one."""


class SceneBinConfig(Section):
    """True place and colour of one bin; frames, ledger and planner still rely on the cell file."""

    missing: bool = False
    """True if there is no such bin."""
    shift: tuple[Displacement, Displacement] = (0.0, 0.0)
    """Displacement x, y [m] from the place in the cell file, each -1 to 1."""
    colour: Colour | None = None
    """Colour of the walls: r, g, b, each 0 to 1; by default that of the cell file."""


class SceneCameraConfig(Section):
    """Calibration errors of the camera; its frames contain the matrix and the pose of the cell file."""

    shift: tuple[Displacement, Displacement, Displacement] = (0.0, 0.0, 0.0)
    """Displacement x, y, z [m], each -1 to 1: in the world, or for a wrist camera in the flange frame."""
    turn_deg: tuple[AngleDeg, AngleDeg, AngleDeg] = (0.0, 0.0, 0.0)
    """Rotation vector about the optical centre [degree], each -90 to 90; axes of the camera: x to the
    right, y down, z forwards."""
    orbit_deg: tuple[AngleDeg, AngleDeg, AngleDeg] = (0.0, 0.0, 0.0)
    """Rotation vector about the point where the optical axis meets the table top [degree], each -90 to 90;
    axes of the world. Only for a fixed camera."""
    fov_factor: float = Field(1.0, ge=0.3, le=3)
    """Factor on the vertical field of view."""
    noise: NoiseConfig | None = None
    """Sensor noise; by default as in the cell file."""


class SceneConfig(Section):
    """Changes to the simulated world; a missing key leaves the world as the cell file declares it."""

    scene: str = Field(min_length=1)
    """Name of the scene."""
    light: Light = Light()
    """The directional light and the ambient light."""
    table: SceneTableConfig = SceneTableConfig()
    """The table, and the number and positions of the objects."""
    objects: dict[str, SceneObjectConfig] = Field(default_factory=dict)
    """Colours and sizes by class; `any`: every class without a section."""
    unknown: UnknownConfig | None = None
    """Objects without a class; none by default."""
    bins: dict[str, SceneBinConfig] = Field(default_factory=dict)
    """True places and colours of bins by name."""
    camera: SceneCameraConfig = SceneCameraConfig()
    """Calibration errors and noise of the camera."""


DECLARED_SCENE = SceneConfig(scene="as declared")
"""The scene without changes to the world of the cell file."""


def load_scene(path: str | Path | None, config: CellConfig) -> SceneConfig:
    """Return the content of a scene file, checked against the cell whose world it changes.

    Args:
        path: The file, or None for `DECLARED_SCENE`.
        config: The cell file.

    Raises:
        MissionError: The file is invalid; the error lists all findings.
        InputError: There is no such file.
    """
    if path is None:
        return DECLARED_SCENE
    source = read_source(Path(path))
    root, findings = parse_yaml(source)
    scene, errors = (None, ()) if root is None else validate(root, SceneConfig)
    if root is not None and scene is not None:
        errors = (*errors, *_find_cell_findings(scene, root, config))
    if scene is None or findings or errors:
        raise MissionError(sort_findings((*findings, *errors), source.path))
    return scene


def _find_cell_findings(scene: SceneConfig, root: YamlNode, config: CellConfig) -> Iterator[Finding]:
    declared = {"class": ("objects", (*config.objects, ANY_CLASS)), "bin": ("bins", tuple(config.bins))}
    for kind, (section, choices) in declared.items():
        for key in (key for key in getattr(scene, section) if key not in choices):
            span = find_span(root, (section, key), at_key=True)
            hint = suggest_choice(key, choices, "Valid keys")
            yield make_error(span, f"unknown-{kind}", f'the cell {config.cell} has no {kind} "{key}"', hint)
    name, camera = next(iter(config.cameras.items()))
    if any(scene.camera.orbit_deg) and camera.mount != "fixed":
        yield make_error(
            find_span(root, ("camera", "orbit_deg")), "wrong-value",
            f"camera.orbit_deg moves a fixed camera, and the camera {name} of the cell {config.cell} is "
            "mounted on the wrist; use shift and turn_deg",
        )  # fmt: skip
    declared_fov = compute_field_of_view(compute_calibration(camera)[0], camera.height)
    if declared_fov * scene.camera.fov_factor > MAX_FOV_DEG:
        yield make_error(
            find_span(root, ("camera", "fov_factor")), "out-of-range",
            f"camera.fov_factor must be at most {MAX_FOV_DEG / declared_fov:.2f}, because the declared field "
            f"of view is {declared_fov:.1f} degrees, and no lens has more than {MAX_FOV_DEG:g}",
        )  # fmt: skip


def build_world(config: CellConfig, scene: SceneConfig, *, gui: bool = False) -> World:
    """Return the world of a scene, without objects; its `config` contains the changes of the scene."""
    world = World(apply_scene(config, scene), gui=gui)
    if (scene.table.colour, scene.table.texture) != ((1.0, 1.0, 1.0), WOOD_TEXTURE):
        world.paint_table(scene.table.colour, scene.table.texture)
    return world


def apply_scene(config: CellConfig, scene: SceneConfig) -> CellConfig:
    """Return the cell configuration with the objects, the table, the bins and the camera of a scene."""
    table_changes = scene.table.model_dump(include={"objects", "gap", "stacked"}, exclude_none=True)
    table = config.table.model_copy(update=table_changes)
    objects = {label: _change_object(label, model, scene) for label, model in config.objects.items()}
    cameras = {name: _change_camera(camera, scene) for name, camera in config.cameras.items()}
    sections = {name: scene.bins.get(name, SceneBinConfig()) for name in config.bins}
    present_names = [name for name in config.bins if not sections[name].missing]
    bins = {name: _change_bin(config.bins[name], sections[name]) for name in present_names}
    return config.model_copy(update={"table": table, "objects": objects, "bins": bins, "cameras": cameras})


def _change_bin(bin: BinConfig, section: SceneBinConfig) -> BinConfig:
    position = (*np.add(bin.position[:2], section.shift).tolist(), bin.position[2])
    return bin.model_copy(update={"position": position, "colour": section.colour or bin.colour})


def _change_object(label: str, model: ObjectConfig, scene: SceneConfig) -> ObjectConfig:
    section = scene.objects.get(label, scene.objects.get(ANY_CLASS))
    if section is None:
        return model
    colours = section.colours or model.colours
    if len(colours) == 1:
        # The number of colours is kept, because each later random choice depends on this number.
        colours *= len(model.colours)
    return scale_model(model, section.scale).model_copy(update={"colours": colours})


def _change_camera(camera: CameraConfig, scene: SceneConfig) -> CameraConfig:
    """Return a camera whose key `calibration` contains the pose and the intrinsics of a scene."""
    section = scene.camera
    if section.noise is not None:
        camera = camera.model_copy(update={"noise": section.noise})
    if not any((*section.shift, *section.turn_deg, *section.orbit_deg)) and section.fov_factor == 1:
        return camera
    matrix, X_MC = compute_calibration(camera)
    if any(section.orbit_deg):
        centre = intersect_plane(matrix, X_MC, matrix[:2, 2], 0.0)
        X_MC = Pose.of(centre) @ _make_rotation(section.orbit_deg) @ Pose.of(-centre) @ X_MC
    X_MC = Pose.of(section.shift) @ X_MC @ _make_rotation(section.turn_deg)
    fov = compute_field_of_view(matrix, camera.height) * section.fov_factor
    factor = compute_camera_matrix(camera.width, camera.height, fov)[1, 1] / matrix[1, 1]
    fx, fy = factor * matrix.diagonal()[:2]
    cx, cy = matrix[:2, 2] - 0.5
    pose = TransformConfig(rotation=tuple(X_MC.rotation_vector), translation=tuple(X_MC.position))
    calibration = CalibrationConfig(matrix=(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0), camera_to_mount=pose)
    return camera.model_copy(update={**dict.fromkeys(POSE_AND_FOV_KEYS), "calibration": calibration})


def _make_rotation(vector_deg: ArrayLike) -> Pose:
    return Pose(np.asarray(cv2.Rodrigues(np.radians(vector_deg))[0]), np.zeros(3))
