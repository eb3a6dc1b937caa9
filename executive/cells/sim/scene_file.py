"""Schema of scene files, each of which changes the simulated world of a cell file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from executive.cell.config import CellConfig, Colour, NoiseConfig, Section
from executive.cell.config.section import Fraction, Natural, check_ascending
from executive.cells.sim.arrangements import DAMAGED_MODEL_NUMBER, UNKNOWN_MODEL_COUNT
from executive.cells.sim.renderer import Light
from executive.cells.sim.table_top import PATTERN_COUNT, PLAIN_TEXTURE, TEXTURES, WOOD_TEXTURE
from executive.errors import InputError
from executive.mission.findings import Finding, MissionError, make_error, sort_findings, suggest_choice
from executive.mission.parse.validate import find_span, validate
from executive.mission.text.file_search import read_source
from executive.mission.text.yaml_text import YamlNode, parse_yaml
from executive.perception.camera_model import compute_calibration, compute_field_of_view

ANY_CLASS = "any"
"""Key in `objects` of the section for all classes without their own section."""
MAX_FOV_DEG = 178.0
"""Maximum vertical field of view of a camera [degree]."""


def check_texture(name: str) -> str:
    """Return the name of a texture, or raise `ValueError` for an unknown name."""
    if name not in TEXTURES:
        choices = f'"{WOOD_TEXTURE}", "{PLAIN_TEXTURE}", or "pattern 0" to "pattern {PATTERN_COUNT - 1}"'
        raise ValueError(f'must be {choices}, not "{name}"')
    return name


def check_model_range(numbers: tuple[int, int]) -> tuple[int, int]:
    """Return a range of model numbers, or raise `ValueError` if it contains only the damaged model."""
    if set(numbers) == {DAMAGED_MODEL_NUMBER}:
        message = f"contains only number {DAMAGED_MODEL_NUMBER}, whose mesh is damaged; name a wider range"
        raise ValueError(message)
    return numbers


def check_palette(colours: tuple[Colour, ...]) -> tuple[Colour, ...]:
    """Return the colours of a palette, or raise `ValueError` if there is no colour."""
    if not colours:
        raise ValueError("needs at least one colour [r, g, b], each 0 to 1")
    return colours


Displacement = Annotated[float, Field(ge=-1, le=1)]
AngleDeg = Annotated[float, Field(ge=-90, le=90)]
CountRange = Annotated[tuple[Natural, Natural], AfterValidator(check_ascending)]
ModelNumber = Annotated[int, Field(ge=0, lt=UNKNOWN_MODEL_COUNT)]
ModelRange = Annotated[
    tuple[ModelNumber, ModelNumber], AfterValidator(check_ascending), AfterValidator(check_model_range)
]
Palette = Annotated[tuple[Colour, ...], AfterValidator(check_palette)]


class SceneTableConfig(Section):
    """The surface of the table and the arrangement of the objects."""

    colour: Colour = (1.0, 1.0, 1.0)
    """Factors on the texture: r, g, b, each 0 to 1."""
    texture: Annotated[str, AfterValidator(check_texture)] = WOOD_TEXTURE
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
    scale: float = Field(0.6, ge=0.1, le=2)
    """Factor on the size of the shapes; most shapes are 0.12 m long at factor 1."""
    colours: Palette = ((1.0, 1.0, 1.0),)
    """Colours (r, g, b, each 0 to 1) of which each object gets one."""


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
    camera: SceneCameraConfig = SceneCameraConfig()
    """Calibration errors and noise of the camera."""


DECLARED_SCENE = SceneConfig(scene="as declared")
"""The scene without changes to the world of the cell file."""


def load_scene(path: Path | None, config: CellConfig) -> SceneConfig:
    """Return the content of a scene file, checked against the cell whose world it changes.

    Args:
        path: The file, or None for `DECLARED_SCENE`.
        config: The cell file.

    Raises:
        MissionError: The file is invalid; the error lists all findings.
        InputError: There is no such file, or the cell is not simulated.
    """
    if path is None:
        return DECLARED_SCENE
    if config.kind != "sim":
        raise InputError(
            f"the scene {path} changes the simulated world of a cell of kind sim, and the cell {config.cell} "
            f"is of kind {config.kind}; leave --scene out, or name a mission on a cell of kind sim"
        )
    source = read_source(path)
    root, findings = parse_yaml(source)
    scene, errors = (None, ()) if root is None else validate(root, SceneConfig)
    if root is not None and scene is not None:
        errors = (*errors, *_find_cell_findings(scene, root, config))
    if scene is None or findings or errors:
        raise MissionError(sort_findings((*findings, *errors), source.path))
    return scene


def _find_cell_findings(scene: SceneConfig, root: YamlNode, config: CellConfig) -> Iterator[Finding]:
    """Yield a finding for every value of a scene that the cell does not allow."""
    for label in scene.objects:
        if label not in (ANY_CLASS, *config.objects):
            span = find_span(root, ("objects", label), at_key=True)
            hint = suggest_choice(label, (*config.objects, ANY_CLASS), "Valid keys")
            yield make_error(span, "unknown-class", f'the cell {config.cell} has no class "{label}"', hint)
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
