# ruff: noqa: E501 - a case is a line
"""Broken and odd URDFs of an arm of a user: one finding that names the fault, or an arm that moves."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
from pathlib import Path

import numpy as np
import pytest
from at_terminal import invoke

from executive.behaviours import load_skills
from executive.cell.arm import Goal
from executive.geometry import make_tool_down_pose
from executive.mission.cell_file import load_cell
from executive.mission.load import load_mission
from executive.motion.configurations import find_configuration_pairs
from executive.motion.joints import build_kinematics
from executive.physics.arm_model import find_arm_model_errors
from executive.physics.cell_world import CellWorld
from executive.physics.collision import ClearanceChecker, find_self_collision_pairs
from executive.physics.model_files import list_arm_files, list_model_files
from executive.station.check import load_checker
from executive.text.findings import MissionError

MAX_CPU_TIME = 5.0
"""Maximum CPU time of loading and checking a cell [s]."""
MISSION = """\
mission: look
cell: cells/bench.yaml
routes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}
tree: [MoveToScan]
"""
CELL = """\
base: cells/overhead.yaml
cell: bench
arm: {file: arms/cobot.yaml, poses_deg: {home: [-54, 4, 114, 0, 62, 0], aside: [54, 4, 114, 0, 62, 0]}}
motion: {descent_speed: 0.02}
"""
ARM = """\
arm: cobot
urdf: cobot.urdf
flange: {link: link_6, offset: 0.08}
limits: {source: a test, acceleration: 5, jerk: 50, stop_acceleration: 6, stop_jerk: 100}
"""
INERTIA = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
MESH = '<mesh filename="link_4.stl"/>'
LINKS = {
    0.05: '<cylinder radius="0.08" length="0.1"/>',
    -0.05: '<cylinder radius="0.07" length="0.11"/>',
    0.22: '<box size="0.1 0.12 0.4"/>',
    0.1: '<box size="0.08 0.08 0.2"/>',
    0.11: MESH,
    0.0: '<cylinder radius="0.045" length="0.09"/>',
    0.051: '<cylinder radius="0.04" length="0.03"/>',
}
"""Shape of each link, by the height of its centre over the joint [m]."""
JOINTS = {0.16: "0 0 1", 0.05: "0 1 0", 0.45: "0 1 0", 0.22: "0 0 1", 0.23: "0 1 0", 0.0: "0 0 1"}
"""Axis of each joint, by its height over the joint before [m]."""


def make_link(name: str, height: float, shape: str) -> str:
    """Return a link; in a name such as link_3, the number of the link makes its mass unique."""
    return f"""\
<link name="{name}"><inertial><mass value="2.{name[-1]}"/>{INERTIA}</inertial>
<collision><origin xyz="0 0 {height}"/><geometry>{shape}</geometry></collision></link>
"""


def make_joint(number: int, height: float, axis: str) -> str:
    return f"""\
<joint name="joint_{number}" type="revolute"><origin xyz="0 0 {height}"/>
<parent link="link_{number - 1}"/><child link="link_{number}"/><axis xyz="{axis}"/>
<limit lower="-2.9{number}" upper="2.9{number}" velocity="2.{number}" effort="5{number}"/></joint>
"""


BODY = "".join(make_link(f"link_{n}", *link) for n, link in enumerate(LINKS.items()))
BODY += "".join(make_joint(n, *joint) for n, joint in enumerate(JOINTS.items(), start=1))
URDF = f'<?xml version="1.0"?>\n<robot name="cobot">\n{BODY}</robot>\n'
LIMIT_3 = '<limit lower="-2.93" upper="2.93" velocity="2.3" effort="53"/>'


def make_stl(scale: float = 1.0, count: int = 12) -> bytes:
    """Return a binary STL of a box of 0.07 x 0.07 x 0.2 m, its triangles repeated up to `count`."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * (0.035, 0.035, 0.1)
    quads = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    triangles = np.zeros(count, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles["corners"] = scale * np.resize(corners[faces], (count, 3, 3))
    return bytes(80) + count.to_bytes(4, "little") + triangles.tobytes()


def make_png(side: int) -> bytes:
    """Return the header of a square image."""
    header = b"IHDR" + side.to_bytes(4, "big") * 2 + bytes([8, 2, 0, 0, 0])
    return b"\x89PNG\r\n\x1a\n\0\0\0\r" + header + bytes(8)


FILES = {
    "link_4.stl": make_stl,
    "millimetres.stl": lambda: make_stl(1000.0),
    "empty.stl": lambda: b"",
    "medium.stl": lambda: make_stl(count=50_000),
    "no_faces.stl": lambda: make_stl(count=0),
    "fine.stl": lambda: make_stl(count=300_000),
    "large.stl": lambda: make_stl(count=500_000),
    "text.stl": lambda: b"solid \xff what",
    "wrong.step": make_stl,
    "huge.png": lambda: make_png(30_000),
    "cobot_description/meshes/link_4.stl": make_stl,
}
"""Content of files beside the URDF; a file is written if the URDF names it."""


def write_project(content: str | bytes) -> None:
    """Write mission, cell, arm file, URDF and the files that the URDF names below the working directory."""
    Path("cells/arms/cobot_description/meshes").mkdir(parents=True)
    Path("cells/bench.yaml").write_text(CELL.replace("0, 62", "62") if content == FIVE else CELL)
    Path("cells/arms/cobot.yaml").write_text(ARM)
    raw = content.encode() if isinstance(content, str) else content
    Path("cells/arms/cobot.urdf").write_bytes(raw)
    Path("cells/arms/outside.stl").symlink_to(Path("outside.stl").absolute())
    Path("outside.stl").write_bytes(make_stl())
    for name, make in FILES.items():
        if name == "link_4.stl" or name.encode() in raw:
            Path("cells/arms", name).write_bytes(make())
    Path("look.yaml").write_text(MISSION)


def edit(old: str, new: str) -> str:
    assert old in URDF
    return URDF.replace(old, new)


def check() -> list[str]:
    """Return the findings in the mission, and check the CPU time, and that a cell without findings moves."""
    start = sum(os.times()[:4])
    try:
        loaded = load_mission("look.yaml", load_skills(), find_checker=load_checker)
    except MissionError as error:
        return [str(finding) for finding in error.findings]
    finally:
        assert sum(os.times()[:4]) - start < MAX_CPU_TIME
    config = loaded.cell_config
    kinematics = build_kinematics(config)
    home = np.radians(config.arm.poses_deg["home"])
    goal = Goal((0.5, 0.1, 0.2), yaws=(0.4,))
    (q, *_) = find_configuration_pairs(kinematics, goal, 0.0, home).lower_qs
    pose = kinematics.compute_tool_pose(q)
    assert np.allclose(pose.rotation, make_tool_down_pose(goal.position, 0.4).rotation, atol=1e-4)
    assert np.allclose(pose.position, goal.position, atol=1e-4)
    with contextlib.closing(CellWorld(config)) as world:  # with visual shapes, in contrast to the check
        world.set_joint_positions(q)
        assert np.allclose(world.get_tool_pose().position, goal.position, atol=1e-4)
    return [str(warning) for warning in loaded.warnings if warning.code != "not-measured"]


GRIPPER = """\
<link name="finger"><inertial><mass value="-1"/></inertial><collision><geometry><mesh filename="no.stl"/></geometry></collision></link>
<joint name="grip" type="prismatic"><parent link="link_6"/><child link="finger"/><mimic joint="joint_1"/></joint>
"""
BOMB = '<!DOCTYPE r [<!ENTITY a "lol">' + "".join(
    f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in itertools.pairwise("abcdefghij")
)


def add(elements: str) -> str:
    return edit("</robot>", f"{elements}</robot>")


def add_sensors(link: str) -> str:
    """Return the URDF with 10,000 links on a link."""
    sensor = '<link name="s{n}"/><joint name="m{n}" type="fixed"><parent link="{link}"/><child link="s{n}"/></joint>'
    return add("".join(sensor.format(n=n, link=link) for n in range(10_000)))


def change_3(old: str, new: str) -> str:
    """Return the URDF with a change in joint 3."""
    before, joint, after = URDF.partition(make_joint(3, 0.45, "0 1 0"))
    assert old in joint
    return before + joint.replace(old, new) + after


def change_mesh(name: str) -> str:
    return edit("link_4.stl", name)


WRIST = '<link name="wrist"/><joint name="fix" type="fixed"><origin xyz="0.01 0 0"/><parent link="wrist"/><child link="link_6"/></joint>'
FIVE = URDF.replace('name="joint_4" type="revolute"', 'name="joint_4" type="fixed"').replace(
    '0 0 0.45"', '0 0 0.45" rpy="0.000004 0 0"'
)
SOUND = {
    "sound": URDF,
    "no inertia": edit(INERTIA, ""),
    "incomplete inertia": edit('ixx="0.01"', ""),
    "no mass": edit('<mass value="2.3"/>', '<mass value="0"/>'),
    "undeclared prefix": edit(LIMIT_3, f'<drake:x a="1"/>{LIMIT_3}'.replace("<limit", '<limit drake:a="2"')),
    "unused namespace": edit("<robot", '<robot xmlns:xacro="http://ros.org/wiki/xacro"'),
    "CRLF": URDF.replace("\n", "\r\n"),
    "byte order mark": "\ufeff" + URDF,
    "UTF-16": edit('"1.0"', '"1.0" encoding="utf-16"').encode("utf-16"),
    "Latin-1": edit('"1.0"', '"1.0" encoding="latin-1"').replace("link_3", "glied_ä").encode("latin-1"),
    "continuous joints": edit("revolute", "continuous"),
    "limits beyond 360 degrees": edit("2.91", "12"),
    "last axis into the arm": URDF.replace(
        '"0 0 1"/>\n<limit lower="-2.96"', '"0 0 -1"/>\n<limit lower="-2.96"'
    ),
    "five joints, right angle rounded": FIVE,
    "gripper": add(GRIPPER),
    "fixed joint with <mimic>": add(
        WRIST.replace("0.01 0 0", "0 0 0").replace("<parent", '<mimic joint="joint_1"/><parent')
    ).replace('<child link="link_6"/><axis', '<child link="wrist"/><axis'),
    "plugin": add('<gazebo><plugin filename="no.so"/></gazebo>'),
    "10,000 links beyond the flange": add_sensors("link_6"),
    "package folder": change_mesh("package://cobot_description/meshes/link_4.stl"),
    "mesh with 50,000 faces": change_mesh("medium.stl"),
    "materials without names": edit(
        "</link>", "<visual><geometry><sphere radius='.1'/></geometry><material/></visual></link>"
    ),
    "long line": add("<material name='m'/>" * 2000),
    "odd names": edit("link_3", "a&amp;b &lt;&quot;"),
    "scaled mesh": edit(MESH, '<mesh filename="millimetres.stl" scale="0.001 0.001 0.001"/>'),
    "link beyond the flange named tool": add(GRIPPER.replace('"finger"', '"tool"')),
}


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("content", SOUND.values(), ids=[*SOUND])
def test_an_odd_urdf_works(content: str | bytes) -> None:
    write_project(content)
    assert check() == []


SHAPE_3 = '<box size="0.08 0.08 0.2"/>'
OF_JOINT_3 = 'the joint "joint_3" of the model cobot.urdf '
OF_LINK_3 = 'the link "link_3" of the model cobot.urdf '
OF_LINK_4 = 'the link "link_4" of the model cobot.urdf '
NOT_MOVABLE = OF_JOINT_3 + "is {}; the joints between base and flange must be revolute"
CHAIN = "".join(make_joint(n, 0, "0 0 1") + f'<link name="link_{n}"/>' for n in range(7, 10_000))
VISUAL = "<visual><geometry>{}</geometry>{}</visual></link>"
BROKEN = [
    # The file.
    ("", "cobot.urdf is no URDF: no element found"),
    (bytes(range(256)) * 100, "cobot.urdf is no URDF: not well-formed"),
    (URDF[:2000], "cobot.urdf is no URDF: unclosed token"),
    (URDF + " " * 20_000_000, "cobot.urdf is larger than 20 MB"),
    (edit('"1.0"', '"1.0" encoding="shift-jis"'), "cobot.urdf is no URDF: multi-byte encodings are not supported"),
    (edit('"1.0"', '"1.0" encoding="klingon"'), "cobot.urdf is no URDF: unknown encoding"),
    (edit("link_3", "glied_ä").encode("latin-1"), "cobot.urdf is no URDF: not well-formed (invalid token): line 9"),
    (edit("robot", "sdf"), "its root is <sdf>, not <robot>"),
    (edit("<robot", '<robot xmlns="http://x.org"'), "its root is <{http://x.org}robot>, not <robot>"),
    (edit(MESH, MESH + '<q:x xmlns:q="http://x.org"/>'), "has an XML namespace, {http://x.org}x; remove it"),
    (edit('<robot', '<robot xmlns:xacro="http://ros.org/wiki/xacro"').replace("</robot>", '<xacro:macro name="a"/></robot>'), "cobot.urdf is for xacro; run `xacro cobot.urdf > robot.urdf`"),
    (f"{BOMB}]><robot>&j;</robot>", "cobot.urdf is no URDF: limit on input amplification"),
    (add("<a>" * 100_000 + "</a>" * 100_000), "cobot.urdf is no URDF: <a> is in over 50 elements"),
    (edit("</link>", "<a>" * 2000 + "</a>" * 2000 + "</link>"), "cobot.urdf is no URDF: <a> is in over 50 elements"),
    # The joints.
    (edit(LIMIT_3, ""), "has no limits.position_deg from -360 to 360 for the joint joint_3; write"),
    (edit(' velocity="2.3"', ""), "has no limits.velocity_deg from 1 to 1000 for the joint joint_3; write"),
    (edit('velocity="2.3"', 'velocity="1e4"'), "has no limits.velocity_deg from 1 to 1000 for the joint joint_3; write"),
    (edit(' effort="53"', ""), "has no effort from 0.1 to 100000 for the joint joint_3; write"),
    (edit('"2.93"', '"170"'), OF_JOINT_3 + "has the limits -2.93 to 170 rad; angles in a URDF are in radians"),
    (edit('upper="2.93"', 'upper="-2.95"'), OF_JOINT_3 + "has a lower limit of -2.93 rad above its upper limit"),
    (edit('upper="2.93"', 'upper="-2.92"'), "limits allows joint 3 the positions"),
    (edit('upper="2.93"', 'upper="nan"'), OF_JOINT_3 + 'has upper="nan"'),
    (change_3("0 1 0", "0 0 0"), OF_JOINT_3 + "has the axis [0. 0. 0.]; write its direction"),
    (change_3("0 1 0", "0 1"), OF_JOINT_3 + 'has xyz="0 1" in a <axis>; write 3 finite'),
    (change_3("0 0 0.45", "0 0 nan"), OF_JOINT_3 + 'has xyz="0 0 nan" in a <origin>; write 3 finite'),
    (change_3("0 0 0.45", "0 0.45"), OF_JOINT_3 + 'has xyz="0 0.45" in a <origin>; write 3 finite'),
    (change_3("0 0 0.45", "0 0 450"), OF_JOINT_3 + "is 450 m away: lengths in a URDF are in metres"),
    *((change_3("revolute", kind), NOT_MOVABLE.format(kind)) for kind in ("prismatic", "planar", "floating")),
    (change_3(' type="revolute"', ""), NOT_MOVABLE.format("without type")),
    (change_3("<axis", '<mimic joint="joint_2"/><axis'), NOT_MOVABLE.format("moved by another joint (<mimic>)")),
    (edit("revolute", "fixed"), 'has 0 joint(s) up to the link "link_6"; an arm has two or more'),
    (edit("revolute", "fixed").replace("fixed", "revolute", 1), 'has 1 joint(s) up to the link "link_6"'),
    (change_3('"link_2"', '"link_6"'), 'has a loop of joints through the link "link_3"'),
    (add(make_joint(7, 0, "0 0 1").replace("link_7", "link_3")), 'the link "link_3" of the model cobot.urdf has two joints before it: "joint_3" and "joint_7"'),
    *((change_3(f'{role} link="link', f'{role} link="elbow'), f'{OF_JOINT_3}has the {role} "elbow_') for role in ("parent", "child")),
    (change_3('<parent link="link_2"/>', ""), OF_JOINT_3 + 'has the parent ""'),
    (edit('"joint_3"', '"joint_2"'), '2 joint(s) with the name "joint_2"; each needs its own name'),
    (edit("joint>", "joint>", ).replace("</joint>", '<dynamics damping="nan"/></joint>'), 'the joint "joint_1" of the model cobot.urdf has damping="nan"'),
    (edit('"link_6"', '"link_7"'), 'cobot.urdf has no link "link_6". Did you mean'),
    (edit("0 0 0.0", '0 0 0" rpy="1 0 0').replace("0 0 1", "0 1 0"), 'the z axis of the flange "link_6" of the model cobot.urdf must be the axis of the joint "joint_6"'),
    (add(WRIST).replace('<child link="link_6"/><axis', '<child link="wrist"/><axis'), '"joint_6", which turns the tool; it is turned by 0.0 degrees and 10.0 mm away'),
    # The links.
    (edit('link name="link_3"', 'link name="link_2"'), '2 link(s) with the name "link_2"; each needs its own name'),
    (edit('link name="link_3"', "link"), '1 link(s) with the name ""; each needs its own name'),
    (edit("link_3", "x" * 5000), "x…"),
    (edit('"link_3"', '"tool"'), 'cobot.urdf has a link "tool", the name of the tool'),
    (add_sensors("link_3"), "the arm in cobot.urdf has 10007 links; join them to at most 80"),
    (edit("collision", "visual"), "has no <collision> after its first joint"),
    (edit("</link>", "<collision><geometry><sphere radius='.01'/></geometry></collision>" * 200 + "</link>"), "the arm in cobot.urdf has 1407 <collision>; write at most 1000"),
    (edit('"2.3"/>', '"-1"/>'), OF_LINK_3 + "has a mass of -1 kg; allowed are 0 to 1000 kg"),
    (edit('"2.3"/>', '"1e6"/>'), OF_LINK_3 + "has a mass of 1e+06 kg"),
    (edit('"2.3"/>', '"nan"/>'), OF_LINK_3 + 'has value="nan" in a <mass>'),
    (edit('ixx="0.01"', 'ixx="nan"'), 'the link "link_0" of the model cobot.urdf has ixx="nan"'),
    (edit("0 0 0.11", "0 0 nan"), OF_LINK_4 + 'has xyz="0 0 nan" in a <origin>'),
    (edit(SHAPE_3, '<cone radius="1"/>'), OF_LINK_3 + "has the geometry <cone>; possible are box"),
    (edit(SHAPE_3, '<box size="0.08 0.2"/>'), OF_LINK_3 + 'has size="0.08 0.2" in a <box>; write 3'),
    (edit(SHAPE_3, "<sphere/>"), OF_LINK_3 + 'has radius="" in a <sphere>; write 1'),
    (edit(SHAPE_3, '<sphere radius="-0.04"/>'), OF_LINK_3 + 'has radius="-0.04" in a <sphere>'),
    (edit(SHAPE_3, '<sphere radius="40"/>'), OF_LINK_3 + "is 40 m long: lengths are in metres"),
    (edit(SHAPE_3, ""), OF_LINK_3 + "has 0 shapes in a <collision>"),
    (edit("</link>", VISUAL.format("<plane/>", "")), "has the geometry <plane>"),
    # The files that the URDF names.
    (change_mesh("no.stl"), 'names the file "no.stl", but there is no file'),
    (change_mesh(""), 'names the file "", but there is no file'),
    (change_mesh("package://cobot_meshes/no.stl"), 'names the file "package://cobot_meshes/no.stl", but there is no file'),
    (change_mesh("wrong.step"), "wrong.step is no mesh; convert it to one of: .obj, .stl, .dae"),
    (change_mesh("empty.stl"), "empty.stl is no STL mesh: it has no faces"),
    (change_mesh("no_faces.stl"), "no_faces.stl is no STL mesh: it has no faces"),
    (change_mesh("text.stl"), "text.stl is no STL mesh: it has no faces"),
    (change_mesh("large.stl"), "large.stl is larger than 20 MB"),
    (change_mesh("millimetres.stl"), OF_LINK_4 + "is 100 m long: lengths are in metres; add scale="),
    *((change_mesh(name), f'names the file "{name}", which is outside of its folder') for name in ("../link_4.stl", "/etc/link_4.stl", "outside.stl", "http://x.org/link_4.stl")),
    (edit("</link>", VISUAL.format(SHAPE_3, '<material name="m"><texture filename="no.png"/></material>')), 'names the file "no.png", but'),
    (edit("</link>", VISUAL.format(SHAPE_3, '<material name="m"><texture filename="huge.png"/></material>')), "huge.png cannot be read; write a sound JPEG or PNG file"),
]  # fmt: skip
SLOW = [
    (add(CHAIN).replace('"link_6"', '"top"').replace('"link_9999"', '"link_6"'), "the arm in cobot.urdf has 10000 links; join them to at most 80"),
    (change_mesh("fine.stl"), "fine.stl has more than 200000 triangles; simplify the mesh"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("content", "expected"),
    [*BROKEN, *(pytest.param(*case, marks=pytest.mark.slow) for case in SLOW)],
    ids=[expected[-40:] for _, expected in [*BROKEN, *SLOW]],
)
def test_a_broken_urdf_has_one_finding_that_names_the_fault(content: str | bytes, expected: str) -> None:
    write_project(content)
    (finding,) = check()
    assert finding.startswith("cells/arms/cobot.yaml:")
    assert expected in finding


@pytest.mark.parametrize(
    ("urdf", "expected"),
    [
        ("../cobot.urdf", '"../cobot.urdf" must be a relative path without ".."'),
        ("linked.urdf", '"linked.urdf" is a link to a file outside'),
        ("no.urdf", "there is no model no.urdf"),
        ("/etc/passwd", '"/etc/passwd" must be a relative path'),
        ("meshes", "there is no model meshes"),
    ],
)
def test_a_urdf_that_is_no_file_beside_the_arm_file_has_one_finding(urdf: str, expected: str) -> None:
    write_project(URDF)
    Path("cells/cobot.urdf").write_text(URDF)
    Path("cells/arms/linked.urdf").symlink_to(Path("cells/cobot.urdf").absolute())
    Path("cells/arms/cobot.yaml").write_text(ARM.replace("cobot.urdf", urdf))
    (finding,) = check()
    assert finding.startswith("cells/arms/cobot.yaml:2:7: error")
    assert expected in finding


def test_a_urdf_in_an_installed_package_names_files_in_the_package_only(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    write_project(URDF)
    Path("cells/arms/cobot.yaml").write_text(ARM.replace("cobot.urdf", "package:bench_arms/urdf/cobot.urdf"))
    monkeypatch.syspath_prepend(tmp_path / "site")
    for folder in ("urdf", "meshes"):
        Path("site/bench_arms", folder).mkdir(parents=True)
    Path("site/bench_arms/__init__.py").touch()
    for name in ("site/bench_arms/meshes/link_4.stl", "site/link_4.stl"):
        Path(name).write_bytes(make_stl())
    path = Path("site/bench_arms/urdf/cobot.urdf")
    for name in ("../meshes/link_4.stl", "package://bench_arms/meshes/link_4.stl"):
        path.write_text(change_mesh(name))
        assert check() == []
    path.write_text(change_mesh("../../link_4.stl"))
    (finding,) = check()
    assert 'names the file "../../link_4.stl", which is outside of its folder' in finding
    Path("site/bench_arms/__init__.py").unlink()
    path.write_text(change_mesh("../meshes/link_4.stl"))
    (finding,) = check()
    assert 'names the file "../meshes/link_4.stl", which is outside of its folder' in finding


def test_links_can_collide_in_the_same_poses_after_a_whole_turn() -> None:
    write_project(change_3(LIMIT_3, LIMIT_3.replace('-2.93"', '-2.98"').replace('"2.93"', '"-0.08"')))
    pairs = []
    for turn in (0.0, 360.0):
        config = load_cell(Path("cells/bench.yaml"))
        lower, upper = np.array(config.arm.limits.position_ranges_deg).T
        lower[2] += turn
        upper[2] += turn
        changes = {"min_position_deg": tuple(lower), "position_deg": tuple(upper)}
        limits = config.arm.limits.model_copy(update=changes)
        arm = config.arm.model_copy(update={"limits": limits})
        with contextlib.closing(CellWorld(config.model_copy(update={"arm": arm}), visuals=False)) as world:
            pairs.append(find_self_collision_pairs(world))
    assert pairs[0] == pairs[1]


def test_an_arm_file_accepts_the_pairs_of_links_of_the_report() -> None:
    write_project(URDF)
    pairs = json.loads(invoke("arm", "cells/arms/cobot.yaml", "--json").stdout)["self_collision_pairs"]
    assert ["link_0", "link_2"] in pairs
    Path("cells/arms/cobot.yaml").write_text(f"{ARM}self_collision_pairs: {pairs}\n")
    assert (
        json.loads(invoke("arm", "cells/arms/cobot.yaml", "--json").stdout)["self_collision_pairs"] == pairs
    )
    Path("cells/arms/cobot.yaml").write_text(f"{ARM}self_collision_pairs: [[a, link_2], [link_2, b]]\n")
    lines = invoke("arm", "cells/arms/cobot.yaml").stderr.splitlines()
    for line, place in zip(lines, ("pairs[0]: ", "pairs[1]: "), strict=True):
        assert f"arm.self_collision_{place}the model cobot.urdf of the arm cobot has no link" in line


def test_only_files_that_pybullet_opens_belong_to_an_arm() -> None:
    plugin = '<gazebo><plugin filename="/opt/no.so"/></gazebo>'
    write_project(change_mesh("link 4.stl").replace("</robot>", f"{plugin}</robot>"))
    Path("cells/arms/link 4.stl").write_bytes(make_stl())
    urdf = Path("cells/arms/cobot.urdf").resolve()
    assert list_model_files(urdf) == [urdf, urdf.with_name("link 4.stl")]
    gripper = GRIPPER.replace("no.stl", "http://x.org/no.stl")
    urdf.write_text(urdf.read_text().replace("</robot>", f"{gripper}</robot>"))
    assert list_arm_files(load_cell(Path("cells/bench.yaml")).arm) == [urdf, urdf.with_name("link 4.stl")]


def test_a_flange_that_points_back_into_the_arm_is_an_error() -> None:
    joint = '<joint name="fix" type="fixed"><origin xyz="0 0 0.08"/><parent link="link_6"/><child link="tool0"/></joint>'
    write_project(add(f'<link name="tool0"/>{joint}'))
    for rotation, count in ((0, 0), (180, 1)):
        flange = f"flange: {{link: tool0, rotation_deg: [{rotation}, 0, 0]}}"
        Path("cells/arms/cobot.yaml").write_text(ARM.replace("flange: {link: link_6, offset: 0.08}", flange))
        errors = list(find_arm_model_errors(load_cell(Path("cells/bench.yaml")).arm))
        assert len(errors) == count
    assert 'flange of the model cobot.urdf points back to the link "link_5"' in errors[0][1]


def test_the_first_link_of_an_arm_on_a_wall_can_touch_the_table() -> None:
    joint = '<joint name="wall" type="fixed"><origin xyz="0 0 0.02" rpy="0 1.5708 0"/><parent link="wall"/><child link="link_0"/></joint>'
    write_project(add(f'<link name="wall"/>{joint}'))
    with contextlib.closing(ClearanceChecker(load_cell(Path("cells/bench.yaml")))) as checker:
        assert str(checker.find_violation(np.zeros(6))).startswith("link 1 ")
