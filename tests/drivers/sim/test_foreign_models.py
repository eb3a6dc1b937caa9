"""URDFs and meshes of other people: what the check accepts lies on the table, the rest is named."""

from __future__ import annotations

import struct
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from executive.cell.config import CellConfig, ObjectConfig
from executive.drivers.sim import model_check
from executive.drivers.sim.model_check import find_model_errors, try_model
from executive.drivers.sim.models import load_mesh
from executive.errors import InputError
from executive.physics.model_files import read_mesh

CORNERS = 0.025 * np.array([*product((-1, 1), repeat=3)])
FACES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6),
         (0, 6, 4), (1, 5, 7), (1, 7, 3)]  # fmt: skip
TRIANGLES = CORNERS[np.array(FACES)]
BINARY_STL = bytes(80) + struct.pack("<I", 12) + b"".join(
    struct.pack("<12fH", 0, 0, 0, *corners.ravel(), 0) for corners in TRIANGLES
)  # fmt: skip
VERTICES = "\n".join(f"vertex {x} {y} {z}" for x, y, z in TRIANGLES.reshape(-1, 3))
TEXT_STL = f"solid s\n{VERTICES}\nendsolid s"
BOX, AWAY = '<box size="0.05 0.05 0.05"/>', '<origin xyz="0.5 0 0"/>'
STL = '<mesh filename="package://parts/p.stl"/>'
INERTIAL = '<mass value="0.1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'


def write(
    folder: Path, visual: str, collision: str = "", inertial: str = INERTIAL, origin: str = ""
) -> ObjectConfig:
    """Write a URDF with its meshes, and return its class, which is 5 cm wide and high."""
    (folder / "p.stl").write_bytes(BINARY_STL)
    (folder / "text.stl").write_text(TEXT_STL)
    shapes = f"<visual>{origin}<geometry>{visual}</geometry></visual>"
    shapes += f"<collision>{origin}<geometry>{collision or visual}</geometry></collision>"
    (folder / "m.urdf").write_text(
        f"<robot name='r'><link name='l'><inertial>{inertial}</inertial>{shapes}</link></robot>"
    )
    return ObjectConfig(urdf=str(folder / "m.urdf"), height=0.05, radius=0.0354)


LOCAL = '<mesh filename="file://{}/p.stl"/>'


@pytest.mark.parametrize("visual", [BOX, STL, '<mesh filename="text.stl"/>', LOCAL])
def test_a_box_in_each_format_lies_on_the_table_as_declared(visual: str, tmp_path: Path) -> None:
    config = write(tmp_path, visual.format(tmp_path))
    assert np.ptp(load_mesh(config).vertices, axis=0) == pytest.approx([0.05, 0.05, 0.05])
    assert load_mesh(config).is_convex
    try_model(config)
    try_model(config.model_copy(update={"urdf": "", "mesh": str(tmp_path / "p.stl")}))


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [("p.stl", BINARY_STL[:400], "it has no faces"), ("p.dae", b"<COLLADA>nan</COLLADA>", "NaN")],
)
def test_a_broken_mesh_is_refused(name: str, content: bytes, reason: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=rf"the model {name} is no (STL|COLLADA) mesh: .*{reason}"):
        read_mesh(tmp_path / name)


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        ('<cylinder radius="0.02" length="0.1"/>', [0.04, 0.04, 0.1]),
        ('<sphere radius="0.03"/>', [0.06, 0.06, 0.06]),
        ('<capsule radius="0.02" length="0.1"/>', [0.04, 0.04, 0.14]),
    ],
)
def test_a_primitive_has_its_size_and_a_closed_surface(shape: str, size: list[float], tmp_path: Path) -> None:
    mesh = load_mesh(write(tmp_path, shape))
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx(size, rel=0.005)
    assert mesh.centroid == pytest.approx([0, 0, 0], abs=1e-9)
    assert mesh.is_convex


def test_geometry_far_from_the_origin_is_moved_to_the_object_frame(tmp_path: Path) -> None:
    config = write(tmp_path, BOX, origin=AWAY, inertial=AWAY + INERTIAL)
    assert load_mesh(config).vertices.mean(axis=0) == pytest.approx([0, 0, 0], abs=1e-9)
    try_model(config)


def test_links_joined_by_fixed_joints_are_one_object(tmp_path: Path) -> None:
    turn = '<origin xyz="0.3 0 0" rpy="0 1.5707963 0.2"/>'
    back = '<origin xyz="0 0 -0.3" rpy="0.2 0 0"/>'  # the sum of both is a turn about the y axis
    config = write(tmp_path, STL, origin=back, inertial=back + INERTIAL)
    joint = f"<joint name='j' type='fixed'>{turn}<parent link='k'/><child link='l'/></joint><link name='k'/>"
    text = Path(config.urdf).read_text().replace("</robot>", f"{joint}</robot>")
    Path(config.urdf).write_text(text)
    assert np.abs(load_mesh(config).vertices) == pytest.approx(0.025, abs=1e-6)
    try_model(config)


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        ({"inertial": ""}, "a mass of 0 kg"),
        ({"inertial": AWAY + INERTIAL}, "centre of mass at .* outside of its visual"),
        ({"collision": '<box size="0.05 0.05 0.1"/>'}, r"from 0\.025 to 0\.075 m, not 0 to 0\.05"),
        ({"collision": '<box size="0.07 0.05 0.05"/>'}, "collision shape that differs by 0.010 m"),
        ({"visual": '<box size="0.05 0.05 0"/>'}, r'size="0\.05 0\.05 0" in a <box>'),
        ({"inertial": f"{INERTIAL}</inertial></link><link name='k'><inertial>{INERTIAL}"}, "has 2 link"),
    ],
)
def test_a_model_that_no_tool_could_sort_is_refused(
    parts: dict[str, str], reason: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=reason):
        try_model(write(tmp_path, **{"visual": BOX, **parts}))


@pytest.mark.parametrize(
    ("script", "reason"),
    [
        ("mktemp -t models_XXX; kill -SEGV $$", "model m.urdf crashes PyBullet"),
        ("exec sleep 9", "takes over 0.2 s"),
        ("echo MemoryError >&2; exit 1", "trial of the model m.urdf failed: MemoryError"),
        ("mkdir $0/once", "height of 0.0500 m"),
    ],
)
def test_the_child_process_reads_a_model_first_and_once_and_may_crash(
    overhead: CellConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, reason: str
) -> None:
    part = write(tmp_path, BOX).model_copy(update={"height": 0.1})
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(model_check, "TRIAL_TIMEOUT", 0.2)
    monkeypatch.setattr(model_check, "build_command", lambda *_: ["sh", "-c", script, str(tmp_path)])
    config = overhead.model_copy(update={"objects": {"part": part}})
    (_, (_, message)) = [*find_model_errors(config), *find_model_errors(config)]
    assert reason in message
    assert not [*tmp_path.glob("models_*")]
