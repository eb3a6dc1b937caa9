# ruff: noqa: E501 - findings are quoted as they are printed
"""Objects of a cell file: a URDF or a mesh, looked for beside the file that names it."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.mission.cell_file import load_cell
from executive.text.findings import MissionError

WASHER = "objects: {washer: {mesh: parts/washer.obj, height: 0.006, radius: 0.025, ring: 0.017}}\n"


@pytest.fixture(autouse=True)
def _in_a_folder_with_a_cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, small_cell: str) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cells/parts").mkdir(parents=True)
    Path("cells/parts/washer.obj").write_text("v 0 0 0\n")
    Path("cells/base.yaml").write_text(small_cell)


def load(text: str, folder: str = "cells", base: str = "base.yaml"):
    path = Path(folder, "c.yaml")
    path.write_text(f"base: {base}\n{text}")
    return load_cell(path)


def complaint(text: str) -> str:
    with pytest.raises(MissionError) as caught:
        load(text)
    return str(caught.value)


def test_a_mesh_is_found_beside_the_cell_file_wherever_the_command_is_given() -> None:
    washer = load(WASHER).objects["washer"]
    assert washer.mesh == str(Path("cells/parts/washer.obj").resolve())
    assert (washer.urdf, washer.mass, washer.ring) == ("", None, 0.017)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("mesh: parts/washer.obj, ", "", "objects.washer needs either a urdf or a mesh\n"),
        ("mesh:", "urdf: cube_small.urdf, mesh:", "objects.washer needs either a urdf or a mesh, not both\n"),
        ("ring: 0.017", "ring: 0.03", "objects.washer has a ring of 0.03 m, which must be smaller than the radius, 0.025 m\n"),
        ("ring: 0.017", "grasp: {point: [0, 0.03, 0.004]}", "a grasp point at 0, 0.03, 0.004 m, outside of the object"),
        ("ring: 0.017", "ring: 0.017, grasp: {point: [0, 0, 0.004]}", "has a ring or grasp points, not both"),
        ("ring: 0.017", "grasp: [{point: [0, 0, 0.004]}, {point: [0, 0, 0.006]}]", "has grasp points at several heights"),
        ("ring: 0.017", "grasp: {point: [0, 0.01, 0.004]}, footprint: [0.05, 0.05], yaw_symmetry: 0", "and no yaw_symmetry of 0"),
        ("mesh: parts/washer.obj", "urdf: cube_small.urdf, variants: [parts/washer.obj]", "has variants, so it needs a mesh"),
    ],
)  # fmt: skip
def test_findings_say_what_an_object_needs(old: str, new: str, expected: str) -> None:
    assert expected in complaint(WASHER.replace(old, new, 1))


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        ("parts/*.obj", ""),
        ("parts/*.png", 'there is no mesh (.obj, .stl, .dae) "parts/*.png" beside the cell file'),
        ("../*.obj", "there is no mesh"),
        ("", "there is no mesh"),
        ("**.obj", "there is no mesh"),
    ],
)
def test_meshes_of_no_class_are_found_by_a_pattern(pattern: str, expected: str) -> None:
    text = f"unknown: {{meshes: ['{pattern}']}}\n"
    if expected:
        assert expected in complaint(text)
    else:
        assert load(text).unknown.meshes == (str(Path("cells/parts/washer.obj").resolve()),)


@pytest.mark.parametrize(
    ("path", "found"), [("parts/washer.obj", True), ("parts/none.onnx", False), ("/model.onnx", False)]
)
def test_a_file_of_a_detector_is_found_beside_the_base_that_names_it(path: str, found: bool) -> None:
    Path("cells/own.yaml").write_text(
        f"base: base.yaml\ndetectors: {{own: {{kind: rfdetr, model_path: {path}, labels: a.txt}}}}\n"
    )
    derived = load("", base="own.yaml")
    expected = str(Path("cells", path).resolve()) if found else path
    assert derived.detectors["own"].options["model_path"] == expected
