# ruff: noqa: E501 - findings are quoted as they are printed
"""Cell files: typed, with findings at the right place."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from executive.errors import InputError
from executive.mission.cell_file import find_overlaps, load_cell, read_cell
from executive.text.findings import MissionError


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def complaint(text: str, overrides: dict[str, str] | None = None) -> str:
    Path("c.yaml").write_text(text)
    with pytest.raises(MissionError) as caught:
        load_cell(Path("c.yaml"), overrides)
    return str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("table: {x: [0.4", "tabel: {x: [0.4", 'c.yaml:13:1: error[unknown-key]: the file has no key "tabel"\n'),
        ("cup_radius", "cup_radios", 'c.yaml:12:8: error[unknown-key]: tool has no key "cup_radios"\n'),
        ("force: 12.0", "force: strong", 'c.yaml:12:34: error[wrong-type]: tool.force must be a number, not the text "strong"\n'),
        ("cup_radius: 0.006", "kind: [nail]", 'error[wrong-value]: tool has no installed kind "[\'nail\']"; installed: fingers, suction\n'),
        ("force: 12.0", "force: 0", "error[out-of-range]: tool.force must be at least 0.001, not 0\n"),
        ("{home: [0, 0", "{hme: [0, 0", 'arm needs a pose named "home"; there are: hme, scan\n'),
        ("scan_poses: [home]", "scan_poses: [hom]", 'c.yaml:25:18: error[unknown-pose]: the arm has no pose "hom"; arm.poses_deg has: home, scan\n'),
        ("cube_small.urdf", "../cube.urdf", 'error[outside]: "../cube.urdf" must be a relative path without ".."\n'),
        ("y: [-0.2, 0.2]", "y: [-0.2, 0.2], objects: [5, 3]", "error[wrong-value]: table.objects must be in ascending order: 5 is greater than 3\n"),
        ("0.06]}", "0.06], slots: [0, 3]}", "error[out-of-range]: bins.red_bin.slots[0] must be at least 1, not 0\n"),
        ("table_view: [192, 100, 448, 356]", "table_view: [192, 100, 748, 656]", "needs a table_view that is a square inside its image of 640 x 480 pixels, not [192, 100, 748, 656]\n"),
        ("up: [1, 0, 0]", "up: [0, 0, 1]", "cameras.top needs a look_at other than position, and an up that is not along the axis\n"),
        ("fov_deg: 55", "calibration: {matrix: [[400, 0, 320], [0, 400, 240], [0, 0, 1]]}", "cameras.top.calibration needs exactly one of mount_to_camera and camera_to_mount, its inverse\n"),
        ("kind: embedded", "kind: embedded, floor: 0.7", "needs a floor of at most its threshold 0.5, not 0.7\n"),
    ],
)  # fmt: skip
def test_findings_say_what_and_where(old: str, new: str, expected: str, small_cell: str) -> None:
    assert expected in complaint(small_cell.replace(old, new, 1))


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("cell.table.objects", "[5]", "--set:1:20: error[wrong-length]: table.objects needs 2 values, not 1\n"),
        ("cell.tool.force", "yes", 'cell.tool.force=yes\n     |                 ^^^'),
        ("cell.tabel.x", "1", 'has no key "tabel"'),
        ("cell.kind.x", "5", 'there is no key "x", because'),
        ("cell.arm.limits.jerk", "[1e308, 9, 9, 9, 9, 9, 9]", "arm.limits.jerk[0] must be at most 100000"),
    ],
)  # fmt: skip
def test_findings_about_overrides_show_the_override(
    key: str, value: str, expected: str, small_cell: str
) -> None:
    assert expected in complaint(small_cell + "kind: sim\n", {key: value})


def test_a_cell_takes_from_its_base_every_key_that_it_has_not_itself(small_cell: str) -> None:
    Path("base.yaml").write_text(small_cell)
    Path("c.yaml").write_text(
        "base: base.yaml\ncell: smaller\nobjects: {duck: {urdf: duck_vhacd.urdf, height: 0.05, radius: 0.03}}\n"
    )
    base, cell = load_cell(Path("base.yaml")), load_cell(Path("c.yaml"))
    assert (base.cell, cell.cell) == ("small", "smaller")
    assert list(cell.objects) == ["duck"], "a key is replaced as a whole"
    replaced = {"cell", "objects"}
    assert cell.model_dump(exclude=replaced) == base.model_dump(exclude=replaced)
    assert cell.base == ""
    assert "base" not in cell.model_dump(), "what is recorded of a cell stands by itself"


def with_detectors(cell: str, written: str) -> str:
    """Return the text of a cell with other detectors."""
    return cell.replace("detectors:\n  first: {kind: embedded}", f"detectors: {written}")


def detectors(text: str, base: str, small_cell: str) -> list[tuple[str, dict[str, object]]]:
    """Return the detectors of a cell on a base, in order, each with the values that its files write."""
    Path("base.yaml").write_text(with_detectors(small_cell, base))
    Path("c.yaml").write_text(f"base: base.yaml\n{text}\n")
    found = load_cell(Path("c.yaml")).detectors
    return [(name, detector.model_dump(exclude_unset=True)) for name, detector in found.items()]


FIRST = {"kind": "rfdetr", "threshold": 0.6, "class_map": {"a": "cube", "b": "duck"}}
SECOND = {"kind": "embedded", "latency": 0.1}
TWO = "{first: {kind: rfdetr, threshold: 0.6, class_map: {a: cube, b: duck}}, second: {kind: embedded, latency: 0.1}}"
CHANGED = {**FIRST, "threshold": 0.7, "class_map": {"c": "cube"}}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("cell: c", [("first", FIRST), ("second", SECOND)]),
        ("detectors: {first: {threshold: 0.7, class_map: {c: cube}}}", [("first", CHANGED), ("second", SECOND)]),
        ("detectors: {first: {kind: fake}}", [("first", {"kind": "fake"}), ("second", SECOND)]),
        ("detectors: {third: {kind: fake}, first: {}}", [("third", {"kind": "fake"}), ("first", FIRST), ("second", SECOND)]),
        ("detectors: {third: {kind: fake}, second: }", [("third", {"kind": "fake"}), ("first", FIRST)]),
    ],
)  # fmt: skip
def test_the_detectors_of_a_base_are_merged_by_name(
    text: str, expected: list[tuple[str, dict[str, object]]], small_cell: str
) -> None:
    assert detectors(text, TWO, small_cell) == expected


@pytest.mark.parametrize(
    ("base", "text", "expected"),
    [
        ("{kind: fake}", "{first: {floor: 2}}", "c.yaml:2:28: error[out-of-range]: detectors.first.floor must be less than 1, not 2\n"),
        ("{kind: fake, latency: -1}", "{first: {floor: 0.2}}", "base.yaml:26:42: error[out-of-range]: detectors.first.latency must be at least 0, not -1\n"),
        ("{kind: fake, latency: -1}", "{first: {kind: rfdetr}, other: {floor: 0.2}}", 'c.yaml:2:36: error[missing-key]: detectors.other needs the key "kind"\n'),
        ("{kind: fake}", "{first: }", "c.yaml:2:1: error[wrong-length]: detectors has 0 entries, but needs at least 1\n"),
    ],
)  # fmt: skip
def test_a_finding_about_a_merged_detector_stands_in_the_file_that_writes_the_value(
    base: str, text: str, expected: str, small_cell: str
) -> None:
    Path("base.yaml").write_text(with_detectors(small_cell, f"{{first: {base}}}"))
    found = complaint(f"base: base.yaml\ndetectors: {text}\n") + "\n"
    assert expected in found
    assert found.count("error[") == 1


@pytest.mark.parametrize(
    ("base", "files", "expected"),
    [
        ("bse.yaml", {"base.yaml": ""}, 'c.yaml:1:7: error[no-base]: there is no file "bse.yaml" in . or '),
        ("5", {}, "c.yaml:1:7: error[wrong-type]: base must be a text, not 5\n"),
        ("b.yaml", {"b.yaml": "cell: b\nbase: a.yaml", "a.yaml": "base: b.yaml"}, 'a.yaml:1:7: error[no-base]: "b.yaml" is itself based on this file: c.yaml -> b.yaml -> a.yaml -> b.yaml\n'),
        ("1.yaml", {f"{n}.yaml": f"base: {n + 1}.yaml" for n in range(1, 7)}, "5.yaml:1:7: error[no-base]: the chain of bases of c.yaml has more than 5 files\n"),
    ],
)  # fmt: skip
def test_a_base_that_cannot_be_one_is_refused_where_it_is_named(
    base: str, files: dict[str, str], expected: str
) -> None:
    for name, text in files.items():
        Path(name).write_text(text)
    assert expected in complaint(f"base: {base}\ncell: c\n") + "\n"


def test_models_are_looked_for_beside_the_file_that_names_them(small_cell: str) -> None:
    for folder in (Path(), Path("parts")):
        (folder / "models").mkdir(parents=True)
        (folder / "models/cup.urdf").write_text("<robot/>")
    cup = "{urdf: models/cup.urdf, height: 0.05, radius: 0.03}"
    Path("parts/base.yaml").write_text(small_cell.replace("objects:", f"objects:\n  cup: {cup}", 1))
    Path("c.yaml").write_text("base: parts/base.yaml\n")
    assert load_cell(Path("c.yaml")).objects["cup"].urdf == str(Path("parts/models/cup.urdf").resolve())
    Path("c.yaml").write_text(f"base: parts/base.yaml\nobjects: {{cup: {cup}}}\n")
    cell = load_cell(Path("c.yaml"))
    assert cell.objects["cup"].urdf == str(Path("models/cup.urdf").resolve())


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, r"there is no file c\.yaml"),
        (b"cell: \xff\n", r"c\.yaml is not UTF-8 text: byte 6 is invalid"),
        (b"#" * 1_000_001, "larger than 1000000 bytes"),
    ],
    ids=["missing", "no text", "huge"],
)
def test_what_is_no_file_of_text_is_refused(content: bytes | None, sentence: str) -> None:
    if content is not None:
        Path("c.yaml").write_bytes(content)
    with pytest.raises(InputError, match=sentence):
        load_cell(Path("c.yaml"))


def test_overrides_replace_values_of_file_and_base(small_cell: str) -> None:
    Path("base.yaml").write_text(small_cell)
    Path("c.yaml").write_text("base: base.yaml\ntable: {objects: [2, 2]}\n")
    cell = load_cell(Path("c.yaml"), {"cell.table.objects": "[5, 5]", "cell.tool.force": "1e1"})
    assert (cell.table.objects, cell.tool.force) == ((5, 5), 10.0)


def test_five_files_may_stand_below_a_cell_file_and_the_nearest_counts(small_cell: str) -> None:
    for number in range(1, 5):
        Path(f"{number}.yaml").write_text(f"base: {number + 1}.yaml\ntable: {{objects: [1, {number}]}}\n")
    Path("5.yaml").write_text(small_cell + "description: five\n")
    Path("c.yaml").write_text("base: 1.yaml\n")
    cell = load_cell(Path("c.yaml"))
    assert (cell.cell, cell.description, cell.table.objects) == ("small", "five", (1, 1))
    Path("c.yaml").write_text("base: cells/overhead.yaml\ncell: mine\n")
    assert list(load_cell(Path("c.yaml")).bins) == ["red_bin", "blue_bin", "yellow_bin"], "a shipped one"


@pytest.mark.parametrize(("x", "findings"), [(0.26, 0), (0.29, 1)])
def test_a_bin_may_stand_diagonally_beside_the_workspace(missions: Path, x: float, findings: int) -> None:
    overrides = {"cell.bins.red_bin.position": f"[{x}, -0.408, 0]", "cell.safe_place": "[0.5, 0.3, 0]"}
    config = read_cell(missions / "cells" / "overhead.yaml", overrides).config
    assert config is not None
    assert [key for key, _ in find_overlaps(config)].count(("bins", "red_bin", "position")) == findings


@pytest.mark.parametrize("model", ["/etc/passwd", "../cup.urdf", "link.urdf"])
def test_models_outside_of_the_folder_are_not_opened(model: str, small_cell: str) -> None:
    Path("link.urdf").symlink_to("/etc/passwd")
    text = small_cell.replace("urdf: sphere_small.urdf", f"urdf: {model}", 1)
    Path("c.yaml").write_text(text)
    file = read_cell(Path("c.yaml"), {})
    assert file.config is None
    assert [finding.code for finding in file.findings] == ["outside"]


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [
        ("radius: 0.0354", (0, 0.0)),
        ("radius: 0.0354, footprint: [0.05, 0.05]", (4, 45.0)),
        ("radius: 0.03, footprint: [0.05, 0.0505]", (0, 0.0)),
        ("radius: 0.03, footprint: [0.05, 0.03]", (2, 0.0)),
        ("radius: 0.03, footprint: [0.03, 0.05]", (2, 90.0)),
        ("radius: 0.03, footprint: [0.05, 0.05], yaw_symmetry: 6", (6, 0.0)),
        ("radius: 0.03, footprint: [0.05, 0.03], yaw_symmetry: 1, yaw_offset_deg: 182", (1, 182.0)),
    ],
)
def test_symmetry_and_offset_of_the_yaw_follow_from_the_footprint(
    sizes: str, expected: tuple[int, float], small_cell: str
) -> None:
    Path("c.yaml").write_text(small_cell.replace("radius: 0.036", sizes))
    cube = load_cell(Path("c.yaml")).build_classes()["cube"]
    assert (cube.yaw_symmetry, math.degrees(cube.yaw_offset)) == pytest.approx(expected)
    wrong = small_cell.replace("radius: 0.036", "radius: 0.0354, yaw_symmetry: 2")
    assert "needs a footprint for its yaw_symmetry" in complaint(wrong)
