"""Scenes outside of the envelope, the true end of objects, and reports about it."""

from __future__ import annotations

import json
from collections import Counter
from functools import partial
from pathlib import Path

import pytest

from executive.cli.cells import find_cell
from executive.mission.parse.cell_file import load_cell
from executive.processes import WorkerPool
from executive.training.evaluation.metrics import Evaluation
from tests.benchmarks import detector_variants
from tests.benchmarks.detector_variants import describe_evaluation, list_variants
from tests.benchmarks.forks import ForkRunner
from tests.benchmarks.ground_truth import HUNG, AuditedRun, FoundObject, Report, run_audited
from tests.benchmarks.misclassifying_server import Server, build_with_misclassifying
from tests.benchmarks.misclassifying_server import summarize as summarize_classes
from tests.benchmarks.outside_the_envelope import NAMES, Done, summarize, write_scene
from tests.benchmarks.scenes_outside import DECLARED, OVERHEAD, WRIST, Case, list_cases

PLACED = Report("cube", "placed", "")
DOUBTED = Report("cube", "placed", "seen in its bin once")
REJECTED = Report("cube", "rejected", "looks disagree about its class")
SPHERE = FoundObject("sphere", "right", "blue_bin", False, ("sphere-1",), (PLACED,))


def misplaced(*reports: Report, fell: bool = False) -> FoundObject:
    """Return a duck in the cubes' bin."""
    place = "elsewhere" if fell else "wrong_bin"
    return FoundObject("duck", place, "red_bin", fell, ("cube-1",), reports)


def run_of(status: str, *objects: FoundObject, mission: str = OVERHEAD, time: float = 10.0) -> AuditedRun:
    """Return a run with a status and objects."""
    return AuditedRun(mission, 1, status, 0, "", {}, {}, objects, time, 5.0, 5.0, "runs/1")


def test_there_are_75_cases_and_every_scene_fits_its_cell(tmp_path: Path) -> None:
    cases = list_cases()
    outside = [case for case in cases if case.group != DECLARED]
    assert (len(outside), len(cases)) == (75, 77)
    assert Counter(case.mission for case in outside) == {OVERHEAD: 57, WRIST: 18}
    assert len({(case.name, case.mission) for case in cases}) == len(cases)
    assert set(NAMES) == {case.name for case in outside}
    for case in cases:
        assert (write_scene(case, tmp_path) is None) == (case.group == DECLARED)


@pytest.mark.parametrize(
    ("status", "thing", "is_unreported"),
    [
        ("SUCCESS", misplaced(PLACED), True),
        ("INCOMPLETE", misplaced(PLACED), True),
        ("INCOMPLETE", misplaced(REJECTED), False),
        ("FAILURE", misplaced(DOUBTED), False),
        ("FAILURE", misplaced(), True),
        ("SUCCESS", misplaced(REJECTED), True),
        ("FAILURE", misplaced(PLACED, fell=True), True),
        ("SUCCESS", SPHERE, False),
    ],
)
def test_a_report_names_the_object_and_is_no_success(
    status: str, thing: FoundObject, is_unreported: bool
) -> None:
    assert bool(run_of(status, thing, SPHERE).unreported) is is_unreported


def test_groups_are_compared_with_the_cell_as_declared() -> None:
    declared, dark = Case(DECLARED, "as declared", OVERHEAD, {}, 0), Case("dark", "all navy", OVERHEAD, {}, 9)
    done = [
        Done(declared, run_of("SUCCESS", SPHERE, SPHERE)),
        Done(dark, run_of("SUCCESS", SPHERE, misplaced(PLACED), time=30.0)),
        Done(dark, AuditedRun.without_result(OVERHEAD, 2, HUNG, "was killed")),
    ]
    figures = summarize(done)
    usual, group, total = figures["groups"]
    assert (usual["right %"], usual["s per object"], usual["times declared"]) == (100, 5, 1)
    assert (group["runs"], group["objects"], group["HUNG"]) == (2, 2, 1)
    assert (group["wrong bin"], group["unreported"], group["times declared"]) == (1, 1, 3)
    assert {**group, "group": ""} == {**total, "group": ""}
    assert (len(figures["problems"]), len(figures["broken"])) == (2, 1)


def test_objects_of_other_classes_must_be_in_their_bins() -> None:
    left = FoundObject("duck", "left", "", False, ("duck-1",), (REJECTED,))
    assert summarize_classes([run_of("INCOMPLETE", left, SPHERE)], "duck")["problems"] == []
    assert len(summarize_classes([run_of("INCOMPLETE", left, SPHERE)], "cube")["problems"]) == 1
    assert len(summarize_classes([run_of("SUCCESS", misplaced(PLACED))], "duck")["problems"]) == 1


def test_a_variant_that_exceeds_a_limit_is_marked() -> None:
    confusion = {
        "cube": {"cube": 390, "duck": 7, "nothing": 3},
        "nothing": {"cube": 2, "duck": 0, "nothing": 0},
    }
    row = describe_evaluation("dark", Evaluation(0.5, 90, 400, 0.97, 0.975, 0.9, 0.9, confusion=confusion))
    assert (row["wrong class"], row["missed"], row["invented"], row["limits"]) == (7, 3, 2, "wrong classes")
    assert len(list_variants(load_cell(find_cell("overhead")))) == 26
    assert len(list_variants(load_cell(find_cell("wrist")))) == 23


@pytest.mark.slow
def test_the_variants_of_a_cell_are_measured_and_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(detector_variants, "VARIANTS", {"declared": {}})
    monkeypatch.setattr(detector_variants, "FIXED_CAMERA_VARIANTS", {})
    out = tmp_path / "variants.json"
    # In a child, because a process in which a model has run cannot be forked by the next test.
    figures, problem = ForkRunner(120.0).call(
        lambda: detector_variants.measure("overhead", images=1, seed=1, workers=1, out=out)
    )
    assert problem == ""
    assert figures["problems"] == ["declared: too few objects"]
    assert json.loads(out.read_text())["details"]["declared"]["images"] == 1


@pytest.mark.slow
def test_a_cube_as_large_as_a_duck_that_is_called_a_duck_is_found_in_a_wrong_bin(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text("scene: large cubes\nobjects: {cube: {scale: 1.12}}\n")
    detectors = partial(build_with_misclassifying, server=Server("embedded", "cube", "duck"))
    # A process in which a test has run a model cannot run a model after a fork, so a new process forks.
    with WorkerPool(1) as pool:
        run = pool.submit(run_audited, OVERHEAD, 310000, tmp_path, scene, detectors).result()
    assert len(run.in_wrong_bin) == run.audit["wrong_bin"] > 0
    assert run.unreported == run.in_wrong_bin
    assert {one.label for one in run.in_wrong_bin} == {"cube"}
    assert run.right == run.audit["right"]


@pytest.mark.slow
def test_a_run_that_takes_too_long_is_hung(tmp_path: Path) -> None:
    run = run_audited(OVERHEAD, 1, tmp_path, wall_time_limit=0.5)
    assert (run.status, run.exit_code, run.objects) == (HUNG, -1, ())
    assert run.message.startswith("the child sent nothing for 0.5 s and was killed")
