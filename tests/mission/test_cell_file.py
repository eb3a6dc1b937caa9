# ruff: noqa: E501 - findings are quoted as they are printed
"""Cell files: typed, with findings at the right place."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from executive.errors import InputError
from executive.mission.findings import MissionError
from executive.mission.parse.cell_file import load_cell, read_cell
from executive.mission.parse.cell_layout import find_overlaps


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
        ("cup_radius", "cup_radios", 'error[missing-key]: tool needs the key "cup_radius"\n'),
        ("cup_radius", "cup_radios", '  Did you mean "cup_radius"? Keys of tool: length, cup_radius'),
        ("force: 12.0", "force: strong", 'c.yaml:12:34: error[wrong-type]: tool.force must be a number, not the text "strong"\n'),
        ("force: 12.0", "force: '12'", 'tool.force must be a number, not the text "12"\n'),
        ("force: 12.0", "force: 0", "error[out-of-range]: tool.force must be at least 0.001, not 0\n"),
        ("force: 12.0", "force: .inf", 'error[not-finite]: ".inf" is not a finite number\n'),
        ("x: [0.4, 0.6]", "x: [0.4]", "c.yaml:13:9: error[wrong-length]: table.x needs 2 values, not 1\n"),
        ("x: [0.4, 0.6]", "x: [0.4, b]", 'c.yaml:13:18: error[wrong-type]: table.x[1] must be a number, not the text "b"\n'),
        ("mount: fixed", "mount: fixd", 'cameras.top.mount must be "fixed" or "wrist", not the text "fixd" (did you mean "fixed"?)\n'),
        ("{home: [0, 0", "{hme: [0, 0", 'arm needs a pose named "home"; there are: hme, scan\n'),
        ("scan_poses: [home]", "scan_poses: [hom]", 'c.yaml:25:18: error[unknown-pose]: the arm has no pose "hom"; arm.poses_deg has: home, scan\n'),
        ("cube_small.urdf", "../cube.urdf", 'error[outside]: "../cube.urdf" must be a relative path without ".."\n'),
        ("y: [-0.2, 0.2]", "y: [-0.2, 0.2], objects: [5, 3]", "error[wrong-value]: table.objects must be in ascending order: 5 is greater than 3\n"),
        ("0.06]}", "0.06], slots: [0, 3]}", "error[out-of-range]: bins.red_bin.slots[0] must be at least 1, not 0\n"),
        ("table_view: [192, 100, 448, 356]", "table_view: [192, 100, 748, 656]", "needs a table_view that is a square inside its image of 640 x 480 pixels, not [192, 100, 748, 656]\n"),
        ("table_view: [192, 100, 448, 356]", "table_view: [192, 100, 448, 350]", "needs a table_view that is a square inside its image"),
        ("up: [1, 0, 0]", "up: [0, 0, 1]", "cameras.top needs a look_at other than position, and an up that is not along the axis\n"),
        ("fov_deg: 55", "width: 640", "cameras.top needs fov_deg, or a calibration instead of position, look_at, up, fov_deg\n"),
        ("fov_deg: 55", "calibration: {matrix: [[400, 0, 320], [0, 400, 240], [0, 0, 1]], mount_to_camera: {rotation: [0, 0, 0], translation: [0, 0, 1]}}", "cameras.top must not have position, look_at, up besides calibration, which defines them\n"),
        ("fov_deg: 55", "calibration: {matrix: [[400, 0, 320], [0, 400, 240], [0, 0, 1]]}", "cameras.top.calibration needs exactly one of mount_to_camera and camera_to_mount, its inverse\n"),
        ("fov_deg: 55", "fov_deg: 55\n    depth: {edge_dropout: 2}", "cameras.top.depth.edge_dropout must be at most 1, not 2\n"),
        ("y: [-0.2, 0.2]", "y: [-0.2, 0.2], stacked: 30", "table.stacked must be at most 1, not 30\n"),
        ("kind: embedded", "kind: embedded, floor: 0.7", "needs a floor of at most its threshold, 0.5, not 0.7\n"),
        ("safe_place:", "safeplace:", 'error[missing-key]: the file needs the key "safe_place"\n'),
    ],
)  # fmt: skip
def test_findings_say_what_and_where(old: str, new: str, expected: str, small_cell: str) -> None:
    assert expected in complaint(small_cell.replace(old, new, 1))


def test_a_renamed_key_is_found_with_its_new_name(small_cell: str) -> None:
    text = small_cell.replace("min_force: 3.0", "least_force: 3.0")
    assert 'tool has no key "least_force"' in complaint(text)
    assert 'Write "min_force".' in complaint(text)


def test_a_finding_shows_line_and_caret(small_cell: str) -> None:
    text = small_cell.replace("source: a test\n    position", "sorce: a test\n    position")
    assert complaint(text).endswith(
        'c.yaml:4:5: error[unknown-key]: arm.limits has no key "sorce"\n'
        "   4 |     sorce: a test\n"
        "     |     ^^^^^\n"
        '  Did you mean "source"? Keys of arm.limits: source, min_position_deg, position_deg, velocity_deg, '
        "acceleration, jerk, stop_acceleration, stop_jerk."
    )


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("cell.table.objects", "[5]", "--set:1:20: error[wrong-length]: table.objects needs 2 values, not 1\n"),
        ("cell.tool.force", "yes", 'cell.tool.force=yes\n     |                 ^^^'),
        ("cell.tabel.x", "1", 'the cell has no key "tabel"'),
        ("cell.table.objects", "[5", "not valid YAML"),
        ("cell.kind.x", "5", 'there is no key "x", because'),
        ("cell.motion.descent_speed", "1e-300", "motion.descent_speed must be at least 0.001, not 1e-300"),
        ("cell.arm.limits.jerk", "[1e308, 9, 9, 9, 9, 9, 9]", "arm.limits.jerk[0] must be at most 100000"),
        ("cell.detectors.first.jitter", "1e308", "detectors.first.jitter must be at most 1000"),
        ("cell.detectors.first.latency", "1e308", "detectors.first.latency must be at most 600"),
        ("cell.safe_place", "[0, 0, 1e9]", "safe_place[2] must be at most 10"),
    ],
)  # fmt: skip
def test_findings_about_overrides_show_the_override(
    key: str, value: str, expected: str, small_cell: str
) -> None:
    assert expected in complaint(small_cell + "kind: sim\n", {key: value})


def test_the_name_of_a_class_becomes_part_of_file_names(small_cell: str) -> None:
    text = small_cell + "kind: sim\n"
    assert (
        complaint(text.replace("  cube:", "  a/b:", 1))
        .splitlines()[0]
        .endswith(
            'error[bad-name]: objects.a/b must be a name of at most 64 letters, digits, blanks, "_" and "-"'
        )
    )


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
        ("detectors: {second: {kind: embedded, floor: 0.2}}", [("second", {**SECOND, "floor": 0.2}), ("first", FIRST)]),
        ("detectors: {first: {kind: fake}}", [("first", {"kind": "fake"}), ("second", SECOND)]),
        ("detectors: {third: {kind: fake}, first: {}}", [("third", {"kind": "fake"}), ("first", FIRST), ("second", SECOND)]),
        ("detectors: {third: {kind: fake}, second: }", [("third", {"kind": "fake"}), ("first", FIRST)]),
        ("detector: second\ndetectors: {third: {kind: fake}}", [("second", SECOND), ("third", {"kind": "fake"}), ("first", FIRST)]),
    ],
)  # fmt: skip
def test_the_detectors_of_a_base_are_merged_by_name(
    text: str, expected: list[tuple[str, dict[str, object]]], small_cell: str
) -> None:
    assert detectors(text, TWO, small_cell) == expected


def test_the_choice_of_a_base_holds_until_a_cell_makes_its_own(small_cell: str) -> None:
    base = f"{TWO}\ndetector: second"
    kept = detectors("detectors: {third: {kind: fake}}", base, small_cell)
    assert [name for name, _ in kept] == ["second", "third", "first"]
    changed = detectors("detector: third\ndetectors: {third: {kind: fake}}", base, small_cell)
    assert [name for name, _ in changed] == ["third", "first", "second"]


@pytest.mark.parametrize(
    ("base", "text", "expected"),
    [
        ("{kind: fake}", "{first: {floor: 2}}", "c.yaml:2:28: error[out-of-range]: detectors.first.floor must be less than 1, not 2\n"),
        ("{kind: fake, threshold: 0.6}", "{first: {floor: 0.7}}", "c.yaml:2:13: error[wrong-value]: detectors.first needs a floor of at most its threshold, 0.6, not 0.7\n"),
        ("{kind: fake, latency: -1}", "{first: {floor: 0.2}}", "base.yaml:26:42: error[out-of-range]: detectors.first.latency must be at least 0, not -1\n"),
        ("{kind: fake, latency: -1}", "{first: {kind: rfdetr}, other: {floor: 0.2}}", 'c.yaml:2:36: error[missing-key]: detectors.other needs the key "kind"\n'),
        ("{kind: fake}", "{other: }", "c.yaml:2:19: error[wrong-type]: detectors.other must be a mapping, not nothing\n"),
        ("{kind: fake}", "{first: }", "c.yaml:2:1: error[wrong-length]: detectors has 0 entries, but needs at least 1\n"),
        ("{kind: fake}", "[first]", "c.yaml:2:1: error[wrong-type]: detectors must be a mapping, not a list of length 1\n"),
    ],
)  # fmt: skip
def test_a_finding_about_a_merged_detector_stands_in_the_file_that_writes_the_value(
    base: str, text: str, expected: str, small_cell: str
) -> None:
    Path("base.yaml").write_text(with_detectors(small_cell, f"{{first: {base}}}"))
    found = complaint(f"base: base.yaml\ndetectors: {text}\n") + "\n"
    assert expected in found
    assert found.count("error[") == 1


def test_a_finding_about_a_value_of_the_base_stands_in_the_base(small_cell: str) -> None:
    Path("parts").mkdir()
    Path("parts/base.yaml").write_text(small_cell.replace("force: 12.0", "force: 0", 1))
    text = complaint("base: parts/base.yaml\ntable: {x: [0.4]}\n")
    assert text == (
        "c.yaml:2:9: error[wrong-length]: table.x needs 2 values, not 1\n"
        "   2 | table: {x: [0.4]}\n"
        "     |         ^\n"
        "parts/base.yaml:12:34: error[out-of-range]: tool.force must be at least 0.001, not 0\n"
        "  12 | tool: {cup_radius: 0.006, force: 0, gap: 0.008, tilt_deg: 30, min_force: 3.0, source: a test}\n"
        "     |                                  ^"
    )


def test_a_key_that_no_file_has_is_missing_in_the_file_itself(small_cell: str) -> None:
    Path("base.yaml").write_text(small_cell.replace("cell: small\n", "").replace("safe_place: [", "table: ["))
    text = complaint("base: base.yaml\nkind: sim\n")
    assert 'c.yaml:1:1: error[missing-key]: the file needs the key "cell"\n' in text
    assert (
        'base.yaml:30:1: error[duplicate-key]: the key "table" occurs twice here; the first is in line 12\n'
        in text
    )


@pytest.mark.parametrize(
    ("base", "files", "expected"),
    [
        ("bse.yaml", {"base.yaml": ""}, 'c.yaml:1:7: error[no-base]: there is no file "bse.yaml" in . or '),
        ("../b.yaml", {}, 'c.yaml:1:7: error[no-base]: "../b.yaml" is outside the folder of the file that names it'),
        ("5", {}, "c.yaml:1:7: error[wrong-type]: base must be a text, not 5\n"),
        ("[a.yaml]", {}, "c.yaml:1:1: error[wrong-type]: base must be a text, not a list of length 1\n"),
        ("c.yaml", {}, 'c.yaml:1:7: error[no-base]: "c.yaml" is itself based on this file: c.yaml -> c.yaml\n'),
        ("b.yaml", {"b.yaml": "cell: b\nbase: a.yaml", "a.yaml": "base: b.yaml"}, 'a.yaml:1:7: error[no-base]: "b.yaml" is itself based on this file: c.yaml -> b.yaml -> a.yaml -> b.yaml\n'),
        ("b.yaml", {"b.yaml": "- cell"}, "c.yaml:1:7: error[no-base]: b.yaml must be a mapping, not a list of length 1\n"),
        ("b.yaml", {"b.yaml": "cell: [b\n"}, "b.yaml:1:8: error[yaml]: not valid YAML"),
        ("1.yaml", {f"{n}.yaml": f"base: {n + 1}.yaml" for n in range(1, 7)}, "5.yaml:1:7: error[no-base]: the chain of bases of c.yaml has more than 5 files\n"),
    ],
)  # fmt: skip
def test_a_base_that_cannot_be_one_is_refused_where_it_is_named(
    base: str, files: dict[str, str], expected: str
) -> None:
    for name, text in files.items():
        Path(name).write_text(text)
    assert expected in complaint(f"base: {base}\ncell: c\n") + "\n"


def test_the_base_itself_cannot_be_overridden(small_cell: str) -> None:
    text = complaint(small_cell, {"cell.base": "other.yaml"})
    assert text == (
        "--set:1:1: error[unknown-key]: --set cannot change the base of a cell; edit the cell file\n"
        "   1 | cell.base=other.yaml\n"
        "     | ^^^^^^^^^"
    )


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
    ("kind", "sentence"),
    [("folder", "is a folder"), ("pipe", "is a pipe or a device"), ("link", "is a link to nothing")],
)
def test_a_base_that_is_no_file_is_named_as_what_it_is(kind: str, sentence: str, small_cell: str) -> None:
    path = Path("base.yaml")
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to("nowhere")
    assert f'"base.yaml" in . {sentence}, not a file' in complaint("base: base.yaml\n")
