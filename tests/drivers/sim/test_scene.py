"""Scene files: the effect of each key on world and image, what stays declared, and what is refused."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from executive.cell.config import CellConfig
from executive.cell.frame import Frame, TrueFrame
from executive.cell.objects import UNKNOWN_LABEL
from executive.drivers.sim.camera import CELL_LIGHT
from executive.drivers.sim.models import load_mesh
from executive.drivers.sim.scene import DECLARED_SCENE, SceneConfig, apply_scene, load_scene
from executive.drivers.sim.spawn import build_initial_world
from executive.drivers.sim.world import World
from executive.errors import InputError
from executive.events import discard_event
from executive.geometry import Pose
from executive.perception.camera_model import compute_calibration
from executive.station.station import CellOptions, SilentOperator, Station
from executive.testing.fake_cell import SHIPPED_ROUTES
from executive.testing.oracle import make_oracle_kind
from executive.text.findings import MissionError

Build = Callable[..., World]
SEED = 3
BLACK = (0.06, 0.06, 0.06)
TABLE = np.s_[100:160, 60:200]
"""Part of the overhead image that shows nothing but the table."""


def scene(**sections: Any) -> SceneConfig:
    """Return a scene with these sections."""
    return SceneConfig.model_validate({"scene": "changed", **sections})


@pytest.fixture
def cell(overhead: CellConfig, tmp_path: Path, request: pytest.FixtureRequest) -> Callable[..., Station]:
    """Build cells in the world of a scene with these sections; without noise unless the scene has some."""

    def build(config: CellConfig = overhead, **sections: Any) -> Station:
        path = tmp_path / "scene.yaml"
        quiet = {"noise": {"gain": 0, "read": 0}}
        sections["camera"] = {**quiet, **sections.get("camera", {})}
        path.write_text(yaml.safe_dump({"scene": "changed", **sections}))
        options = CellOptions(SilentOperator(), cell_folder=tmp_path, driver_options={"scene": str(path)})
        make = make_oracle_kind(box_std=0.0, renders_images=True)
        made = make(config, seed=SEED, routes=SHIPPED_ROUTES, emit=discard_event, options=options)
        request.addfinalizer(made.close)
        return made

    return build


@pytest.fixture
def world(overhead: CellConfig) -> Iterator[Callable[..., World]]:
    """Build the first world of a scene with these sections."""
    worlds: list[World] = []

    def build(**sections: Any) -> World:
        worlds.append(build_initial_world(overhead, SEED, scene=scene(**sections)))
        return worlds[-1]

    yield build
    for made in worlds:
        made.close()


def capture(made: Station) -> Frame:
    return made.cell.camera.capture()


def placed(world: World) -> list[tuple[str, list[float]]]:
    """Return label and pose of every object."""
    return [(label, world.get_object_pose(body).to_rounded_list(5)) for body, label in world.labels.items()]


def test_a_scene_without_changes_is_the_declared_world(world: Build, overhead: CellConfig) -> None:
    assert apply_scene(overhead, scene()) == overhead
    assert DECLARED_SCENE.light == CELL_LIGHT
    declared = build_initial_world(overhead, SEED)
    assert placed(world()) == placed(declared)
    declared.close()
    assert load_scene(None, overhead) == DECLARED_SCENE


def test_number_gap_and_stacks_are_those_of_the_scene(world: Build, overhead: CellConfig) -> None:
    made = world(table={"objects": [7, 7], "gap": 0.05})
    places = [made.get_object_pose(body).position[:2] for body in made.labels]
    kinds = [overhead.objects[label].radius for label in made.labels.values()]
    gaps = [np.linalg.norm(places[a] - places[b]) - kinds[a] - kinds[b] for a in range(7) for b in range(a)]
    assert (len(places), min(gaps) > 0.045) == (7, True)
    piled = world(table={"objects": [6, 6], "stacked": 1})
    assert max(piled.get_object_pose(body).position[2] for body in piled.labels) > 0.06


def test_appearance_changes_no_position_and_the_ledger_does_not_know_the_true_size(
    world: Build, cell: Callable[..., Station], overhead: CellConfig
) -> None:
    looks = {"objects": {"any": {"colours": [BLACK]}, "duck": {}}, "light": {"brightness": 0.3}}
    table = {"colour": [0.2, 0.2, 0.4], "texture": "pattern 1"}
    usual = world()
    black = world(**looks, table=table)
    assert placed(usual) == placed(black)
    for body, label in black.labels.items():
        colour = black.client.getVisualShapeData(body)[0][7][:3]
        assert (tuple(round(value, 3) for value in colour) == BLACK) == (label != "duck")
    (*_, colour), *_ = black.client.getVisualShapeData(black.table)
    assert colour[:3] == pytest.approx((0.2, 0.2, 0.4))
    large = world(objects={"sphere": {"scale": 1.3}}, table={"objects": [6, 6]})
    for body, label in large.labels.items():
        factor = 1.3 if label == "sphere" else 1.0
        mesh, declared = load_mesh(large.models[body]), load_mesh(overhead.objects[label])
        assert mesh.top - mesh.bottom == pytest.approx(factor * (declared.top - declared.bottom))
        if label == "sphere":
            low, high = large.client.getAABB(body)
            assert high[2] - low[2] == pytest.approx(0.078, abs=0.005)
    made = cell(objects={"sphere": {"scale": 1.3}})
    assert made.cell.classes["sphere"].height == overhead.objects["sphere"].height


def test_unknown_objects_lie_beside_the_others_and_no_detector_knows_them(
    cell: Callable[..., Station], overhead: CellConfig
) -> None:
    unknown = {"count": [2, 2], "models": [168, 169], "scale": 0.5, "colours": [[0.0, 0.9, 0.0]]}
    made = cell(unknown=unknown, table={"objects": [3, 3], "stacked": 1.0})
    world = made.driver.world
    strange = [body for body, label in world.labels.items() if label == UNKNOWN_LABEL]
    assert (len(world.labels), len(strange)) == (5, 2)
    others = [body for body in world.labels if body not in strange]
    for body in strange:
        model, place = world.models[body], world.get_object_pose(body).position
        assert "169.urdf" in model.urdf
        assert model.radius == pytest.approx(load_mesh(model).radius)
        for other in others:
            apart = np.linalg.norm(world.get_object_pose(other).position[:2] - place[:2])
            assert apart > model.radius, "neither on nor under an object"
    frame = capture(made)
    assert isinstance(frame, TrueFrame)
    assert {true.label for true in frame.true_detections} <= overhead.objects.keys()
    assert all(world.client.getVisualShapeData(body)[0][7][1] == pytest.approx(0.9) for body in strange)
    assert UNKNOWN_LABEL not in made.cell.classes


def turned(axis: str, angle: float) -> np.ndarray:
    """Return the rotation about an axis of the world by an angle [degree]."""
    vector = np.radians(angle) * np.eye(3)["xyz".index(axis)]
    return np.asarray(cv2.Rodrigues(vector)[0])


def test_the_audit_knows_the_true_bins_and_the_ledger_the_declared_ones(cell: Callable[..., Station]) -> None:
    bins = {"red_bin": {"shift": [0, 0.96]}, "blue_bin": {"missing": True}}
    station = cell(bins=bins)
    thing = station.driver.list_objects()[0]
    place = station.cell.bins["blue_bin"].position
    x, y, _ = place - thing.position
    station.driver.move_object(thing, (float(x), float(y)))
    assert next(iter(station.driver.list_final_objects())).bin == "red_bin"


@pytest.mark.parametrize(
    ("error", "zoom", "moved"),
    [
        ({"shift": [0.02, 0.0, 0.03]}, 1.0, lambda X: Pose.of([0.02, 0.0, 0.03]) @ X),
        ({"turn_deg": [0.0, 0.0, 4.0]}, 1.0, lambda X: Pose(X.rotation @ turned("z", 4.0), X.position)),
        (
            {"orbit_deg": [0.0, 15.0, 0.0]}, 1.0,
            lambda X: Pose(turned("y", 15.0), [0.5, 0, 0]) @ Pose(np.eye(3), [-0.5, 0, 0]) @ X,
        ),
        ({"fov_factor": 1.1}, math.tan(math.radians(27.5)) / math.tan(math.radians(1.1 * 27.5)), lambda X: X),
    ],
    ids=["shift", "turn", "orbit", "lens"],
)  # fmt: skip
def test_the_true_camera_differs_from_the_declared_one_by_the_errors_of_the_scene(
    overhead: CellConfig, error: dict[str, Any], zoom: float, moved: Any
) -> None:
    matrix, X_WC = compute_calibration(overhead.cameras["overhead"])
    true_camera = apply_scene(overhead, scene(camera=error)).cameras["overhead"]
    true_matrix, X_WT = compute_calibration(true_camera)
    assert true_matrix.diagonal()[:2] == pytest.approx(zoom * matrix.diagonal()[:2])
    assert true_matrix[:2, 2] == pytest.approx(matrix[:2, 2])
    assert X_WT.position == pytest.approx(moved(X_WC).position)
    assert X_WT.rotation == pytest.approx(moved(X_WC).rotation, abs=1e-9)


def test_the_image_is_from_the_true_camera_and_the_frame_says_the_declared_one(
    cell: Callable[..., Station], overhead: CellConfig
) -> None:
    frame = capture(cell(camera={"shift": [0.0, 0.05, 0.0]}))
    assert isinstance(frame, TrueFrame)
    matrix, X_WC = compute_calibration(overhead.cameras["overhead"])
    assert (frame.matrix == matrix).all()
    assert frame.X_WC.to_rounded_list() == X_WC.to_rounded_list()
    straight = capture(cell())
    assert isinstance(straight, TrueFrame)
    pairs = zip(frame.true_detections, straight.true_detections, strict=True)
    assert min(np.linalg.norm(np.subtract(one.centre, other.centre)) for one, other in pairs) > 15


def test_the_noise_is_that_of_the_scene(cell: Callable[..., Station]) -> None:
    clean, noisy = (capture(cell(camera={"noise": {"gain": 0, "read": read}})).image for read in (0, 16))
    assert (noisy[TABLE].astype(float) - clean[TABLE]).std() == pytest.approx(16, abs=0.5)


@pytest.mark.parametrize(
    ("section", "finding"),
    [
        ("light: {brightnes: 0.3}", '2:9: error[unknown-key]: light has no key "brightnes"'),
        ("unknown: {count: [1, 2], size: 0.5}", "2:26: error[unknown-key]: "),
        ("objects: {cubes: {scale: 0.8}}", "2:11: error[unknown-class]: "),
        ("table: {texture: pattern 24}", "2:18: error[wrong-value]: table.texture must be "),
        ("objects: {any: {colours: [[0.5, 0.5, 255]]}}", "2:38: error[out-of-range]: "),
        ("unknown: {count: [1, 1], models: [168, 168]}", "2:26: error[wrong-value]: unknown.models "),
        ("objects: {any: {colours: []}}", "2:17: error[wrong-value]: objects.any.colours needs "),
    ],
)
def test_a_mistake_is_reported_with_its_position(
    overhead: CellConfig, tmp_path: Path, section: str, finding: str
) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(f"scene: wrong\n{section}\n")
    with pytest.raises(MissionError, match=re.escape(f"scene.yaml:{finding}")):
        load_scene(path, overhead)


def test_a_scene_that_does_not_fit_the_cell_is_refused(
    overhead: CellConfig, wrist: CellConfig, tmp_path: Path
) -> None:
    path = tmp_path / "scene.yaml"
    with pytest.raises(InputError, match=f"there is no file {path}"):
        load_scene(path, overhead)
    path.write_text("scene: tilted\ncamera: {orbit_deg: [0, 5, 0]}\n")
    with pytest.raises(MissionError, match="orbit_deg moves a fixed camera"):
        load_scene(path, wrist)
    path.write_text("scene: fish eye\ncamera: {fov_factor: 3}\n")
    with pytest.raises(MissionError, match=r"must be at most 2\.97"):
        load_scene(path, wrist)
