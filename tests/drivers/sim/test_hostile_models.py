"""Models that are no models: garbage, other XML, wrong numbers, names that no file can have."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from PIL import Image

from executive.arms.urdf import find_model
from executive.cell.config import ObjectConfig
from executive.drivers.sim.models import compute_mass, load_mesh
from executive.errors import InputError
from executive.physics.model_files import read_mesh

LEVELS = "".join(f"<!ENTITY a{number + 1} '{f'&a{number};' * 10}'>" for number in range(9))
BOMB = f"<!DOCTYPE r [<!ENTITY a0 'ha'>{LEVELS}]><robot name='&a9;'/>"


@pytest.mark.parametrize(
    ("content", "error"),
    [
        ("garbage", "is no URDF: syntax error"),
        (BOMB, "is no URDF: "),
        ("<robot><mesh xmlns='q' filename='../m.obj'/></robot>", "has an XML namespace"),
        ("<svg/>", "its root is <svg>, not <robot>"),
        ("<robot><inertial><mass value='nan'/></inertial></robot>", 'has value="nan" in a <mass>'),
        ("<robot><inertial><mass value='1 2'/></inertial></robot>", 'has value="1 2" in a <mass>'),
    ],
    ids=["garbage", "XML bomb", "namespace", "other XML", "not finite", "two numbers"],
)
def test_a_file_that_is_no_urdf_is_an_error(content: str, error: str, tmp_path: Path) -> None:
    (tmp_path / "m.urdf").write_text(content)
    config = ObjectConfig(urdf=str(tmp_path / "m.urdf"), height=0.05, radius=0.03, mass=0.1)
    with pytest.raises(InputError, match=re.escape(error)):
        compute_mass(config)  # also if the cell file states the mass


OUTSIDE = ("/etc/x.obj", "../x.obj", "link.obj", "file:///etc/x.obj", "http://x.obj")


@pytest.mark.parametrize(
    ("part", "mesh", "error"),
    [
        *(("visual", mesh, f'names the file "{mesh}", which is outside of its folder; copy')
          for mesh in OUTSIDE),
        *((part, "pipe.obj", r'names the file "pipe\.obj", but there is no file .*pipe\.obj; copy')
          for part in ("visual", "collision")),
        ("collision", "m.obj", r"^the model m\.obj has more than 20000 triangles; simplify the mesh$"),
    ],
)  # fmt: skip
def test_a_mesh_that_is_elsewhere_or_no_file_or_large_is_refused(
    part: str, mesh: str, error: str, tmp_path: Path
) -> None:
    (tmp_path / "link.obj").symlink_to("/etc/passwd")
    os.mkfifo(tmp_path / "pipe.obj")
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 20_001)
    shape = f"<{part}><geometry><mesh filename='{mesh}'/></geometry></{part}>"
    (tmp_path / "m.urdf").write_text(f"<robot>{shape}</robot>")
    with pytest.raises(InputError, match=error):
        load_mesh(ObjectConfig(urdf=str(tmp_path / "m.urdf"), height=0.05, radius=0.03))


def test_a_model_of_more_than_20_megabytes_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "m.obj").open("wb") as file:
        file.truncate(20_000_001)
    with pytest.raises(InputError, match=r"m\.obj is larger than 20 MB$"):
        find_model(str(tmp_path / "m.obj"))


@pytest.mark.parametrize(
    ("mesh", "material", "error"),
    [
        ("mtllib pipe", "", r"there is no model .*/pipe, neither"),
        (" mtllib /etc/passwd", "", 'm.obj names the file "/etc/passwd", which is outside'),
        ("mtllib a.mtl", "map_Kd pipe", r"there is no model .*/pipe, neither"),
        ("mtllib a.mtl", "\tmap_Kd zero", 'a.mtl names the file "zero", which is outside'),
        ("mtllib a.mtl", "map_Kd m.obj", r"m\.obj cannot be read; write a sound JPEG or PNG"),
        ("mtllib a.mtl", "map_Kd large.png", "large.png cannot be read; .* of at most 25000000 pixels"),
        ("mtllib a.mtl", "".join(f"map_Kd {n}\n" for n in range(1001)), "a.mtl names more than 1000 files"),
        ("g 1\n" * 1001, "", "it has more than 1000 groups"),
    ],
)
def test_the_materials_and_textures_of_a_mesh_are_checked_like_the_mesh(mesh, material, error, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    Image.new("1", (5001, 5000)).save(tmp_path / "large.png")
    (tmp_path / "a.mtl").write_text(material)
    (tmp_path / "m.obj").write_text(f"{mesh}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(InputError, match=error):
        read_mesh(tmp_path / "m.obj")
