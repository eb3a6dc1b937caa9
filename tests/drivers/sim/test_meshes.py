"""Objects of one's own, given as meshes: where they lie, what is solid of them, what is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from executive.cell.config import CellConfig, GraspConfig, ObjectConfig
from executive.drivers.sim.model_check import find_model_errors, measure_hold
from executive.drivers.sim.models import load_mesh
from executive.drivers.sim.world import World
from executive.errors import InputError
from executive.geometry import Pose, rotate_about_z
from executive.physics.model_files import read_mesh

Build = Callable[[CellConfig], World]

# A wedge 20 mm long, 10 mm wide and 30 mm high, its origin in a corner of its underside; one face is a quad.
WEDGE = """
v 0 0 0
v 0.02 0 0
v 0.02 0.01 0
v 0 0.01 0
v 0 0 0.03
v 0 0.01 0.03
f 4 3 2 1
f 1/1/1 2/2/1 5/3/1
f 3 4 6
f -2 -5 -4 -1
f 1 5 6 4
"""


@pytest.fixture
def wedge(tmp_path: Path) -> ObjectConfig:
    path = tmp_path / "wedge.obj"
    path.write_text(WEDGE)
    return ObjectConfig(mesh=str(path), height=0.03, radius=0.0112, mass=0.2)


def with_objects(config: CellConfig, **objects: ObjectConfig) -> CellConfig:
    return config.model_copy(update={"objects": objects})


def test_a_mesh_stands_around_its_middle_and_weighs_about_the_middle_of_its_volume(
    build: Build, overhead: CellConfig, wedge: ObjectConfig
) -> None:
    mesh = load_mesh(wedge)
    assert mesh.vertices.min(axis=0) == pytest.approx([-0.01, -0.005, -0.015])
    assert mesh.vertices.max(axis=0) == pytest.approx([0.01, 0.005, 0.015])
    # A third of the way from its upright edge, and from its underside.
    assert mesh.centroid == pytest.approx([-0.01 + 0.02 / 3, 0.0, -0.005])
    laid = wedge.model_copy(update={"scale": 2.0, "upright_deg": (90.0, 0.0, 0.0)})
    assert np.ptp(load_mesh(laid).vertices, axis=0) == pytest.approx([0.04, 0.06, 0.02])
    world = build(with_objects(overhead, wedge=wedge, laid=laid))
    X_WO = Pose(rotate_about_z(0.7), np.array([0.5, 0.1, 0.2]))
    body, other = (
        world.add_object("wedge", X_WO, (1, 1, 1)),
        world.add_object("laid", Pose.of([0.3, 0, 0.3]), (1, 1, 1)),
    )
    assert world.get_object_pose(body).to_rounded_list() == pytest.approx(X_WO.to_rounded_list(), abs=1e-6)
    assert world.client.getDynamicsInfo(body, -1)[0] == 0.2
    centre, _ = world.client.getBasePositionAndOrientation(body)
    assert centre == pytest.approx(X_WO.apply(mesh.centroid))
    low, high = world.client.getAABB(other)
    assert np.subtract(high, low) == pytest.approx([0.04, 0.06, 0.02], abs=0.005)
    assert (np.array(low) + high) / 2 == pytest.approx([0.3, 0, 0.3], abs=1e-3)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", r"it has no faces \(lines beginning with f\)"),
        ("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "a vertex needs three finite numbers"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "a face names a vertex that is not there; there are 3"),
        ("v 0 0 zero\n", "could not convert string to float: 'zero'"),
    ],
)
def test_what_is_no_mesh_is_refused_with_the_reason(text: str, complaint: str, tmp_path: Path) -> None:
    path = tmp_path / "thing.obj"
    path.write_text(text)
    with pytest.raises(InputError, match=rf"the model thing\.obj is no Wavefront mesh: {complaint}"):
        read_mesh(path)


def test_every_variant_is_drawn_and_checked(wedge: ObjectConfig) -> None:
    part = wedge.model_copy(update={"variants": ("gone.obj", wedge.mesh)})
    meshes = [part.draw_model(np.random.default_rng(seed)).mesh for seed in range(40)]
    assert min(meshes.count(wedge.mesh) / 2, meshes.count("gone.obj")) > 5
    config = CellConfig.model_construct(objects={"part": part})
    assert [key for key, _ in find_model_errors(config)] == [("objects", "part", "variants", 0)]


@pytest.mark.parametrize(
    ("point", "text"),
    [
        ((-0.0095, 0.0, 0.028), ""),
        ((0.0, 0.0, 0.015), ""),
        ((0.0, 0.0, 0.02), "the surface is 15.0 mm high there"),
        ((0.0, 0.008, 0.01), "there is no surface there"),
    ],
)
def test_a_grasp_point_outside_of_the_mesh_is_found(wedge: ObjectConfig, point, text: str) -> None:
    part = wedge.model_copy(update={"grasp": (GraspConfig(point=point),), "footprint": (0.02, 0.01)})
    messages = [message for _, message in find_model_errors(CellConfig.model_construct(objects={"w": part}))]
    assert bool(messages) is bool(text)
    assert all(text in message for message in messages)


def test_a_model_that_looks_the_same_after_a_half_turn_has_no_yaw_symmetry_of_1(
    overhead: CellConfig, wedge: ObjectConfig
) -> None:
    footprint = {"footprint": (0.02, 0.01), "yaw_symmetry": 1}
    config = with_objects(overhead, wedge=wedge.model_copy(update=footprint))
    ((key, message),) = find_model_errors(config)
    assert (key, "half turn" in message) == (("objects", "wedge", "yaw_symmetry"), True)
    assert not [
        *find_model_errors(with_objects(overhead, wedge=wedge.model_copy(update={"footprint": (0.02, 0.01)})))
    ]


@pytest.mark.parametrize(
    ("scale", "offset", "finding"), [(1, 0, ""), (-1, 0, "yaw_offset_deg: 180"), (-1, 180, "")]
)
def test_the_narrower_end_points_along_the_yaw(
    overhead: CellConfig, tmp_path: Path, scale: float, offset: float, finding: str
) -> None:
    # A roof, seen from above: a trapezoid with its narrower end at positive x.
    corners = [(-0.02, -0.01), (0.02, -0.004), (0.02, 0.004), (-0.02, 0.01)]
    vertices = [(scale * x, y, z) for z in (0, 0.02) for x, y in corners]
    faces = ["1 2 3 4", "8 7 6 5", "1 5 6 2", "2 6 7 3", "3 7 8 4", "4 8 5 1"]
    lines = [*("v {:g} {:g} {:g}".format(*vertex) for vertex in vertices), *(f"f {face}" for face in faces)]
    path = tmp_path / "end.obj"
    path.write_text("\n".join(lines) + "\n")
    part = ObjectConfig(
        mesh=str(path),
        height=0.02,
        radius=0.0224,
        footprint=(0.04, 0.02),
        yaw_symmetry=1,
        yaw_offset_deg=offset,
    )
    found = [message for _, message in find_model_errors(with_objects(overhead, part=part))]
    assert [finding in message for message in found] == ([True] if finding else [])


def test_a_variant_that_the_tool_cannot_hold_counts(overhead: CellConfig, wedge: ObjectConfig) -> None:
    cube = ObjectConfig(mesh=str(Path(wedge.mesh).with_name("cube.obj")), height=0.03, radius=0.0112)
    plate = [f"v {x} {y} {z}" for z in (0, 0.03) for x, y in ((0, 0), (0.03, 0), (0.03, 0.03), (0, 0.03))]
    faces = ["f 4 3 2 1", "f 5 6 7 8", "f 1 2 6 5", "f 2 3 7 6", "f 3 4 8 7", "f 4 1 5 8"]
    Path(cube.mesh).write_text("\n".join([*plate, *faces]) + "\n")
    both = cube.model_copy(update={"variants": (wedge.mesh,)})
    config = with_objects(overhead, cube=cube, both=both)
    assert measure_hold(config, "cube") > 1
    assert measure_hold(config, "both") == 0


def test_a_cup_holds_no_edge_and_no_surface_that_is_smaller_than_itself(
    overhead: CellConfig, wedge: ObjectConfig
) -> None:
    perfect = overhead.tool.max_holding_force
    assert measure_hold(overhead, "cube") == pytest.approx(perfect)
    assert 0.0 < measure_hold(overhead, "duck") < perfect
    cube = overhead.objects["cube"]
    edge = cube.model_copy(update={"grasp": GraspConfig(point=(0.022, 0.0, 0.05))})
    config = with_objects(overhead, small=wedge, edge=edge)
    assert [measure_hold(config, label) for label in ("small", "edge")] == [0.0, 0.0]


def test_the_declared_friction_is_that_of_the_body(
    build: Build, overhead: CellConfig, wedge: ObjectConfig
) -> None:
    wet = ObjectConfig.model_validate({**wedge.model_dump(exclude_unset=True), "friction": 0.2})
    world = build(with_objects(overhead, wet=wet))
    body = world.add_object("wet", Pose.of([0.5, 0.0, 0.1]), (1, 1, 1))
    assert world.client.getDynamicsInfo(body, -1)[1] == 0.2


def test_missing_models_and_wrong_sizes_are_named_with_their_keys(
    overhead: CellConfig, wedge: ObjectConfig
) -> None:
    gone = wedge.model_copy(update={"mesh": "gone.obj"})
    half = overhead.objects["cube"].model_copy(update={"scale": 0.5})
    flat = overhead.objects["cube"].model_copy(update={"footprint": (0.05, 0.02)})
    found = dict(find_model_errors(with_objects(overhead, gone=gone, half=half, flat=flat)))
    keys = (
        ("gone", "mesh"),
        ("half", "height"),
        ("half", "radius"),
        ("half", "footprint"),
        ("flat", "footprint"),
    )
    assert list(found) == [("objects", *key) for key in keys]
    assert "height of 0.0250 m, not 0.05 m; correct height" in found["objects", "half", "height"]
