"""Labelled scenes, data sets and frames: functions of their seed alone."""

from __future__ import annotations

import json
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from executive.cell.config import CellConfig, DepthConfig, ObjectConfig
from executive.cells.sim.arrangements import (
    UNKNOWN_LABEL,
    SceneObject,
    draw_arrangement,
    draw_held_object,
    draw_objects,
    scale_model,
    simulate_fall,
)
from executive.cells.sim.models import load_mesh
from executive.cells.sim.scene_file import DECLARED_SCENE
from executive.cells.sim.scenes import IMAGE_SIZE, Sample, SceneRenderer
from executive.cells.sim.silhouette import compute_silhouette_area
from executive.errors import InputError
from executive.geometry import Pose
from executive.processes import WorkerPool
from executive.training.rendering import generate_dataset, render_run_frames, to_labelled_frame


def samples(config: CellConfig, seeds: range, *, is_random: bool = True) -> list[Sample]:
    renderer = SceneRenderer(config, next(iter(config.cameras)), None if is_random else DECLARED_SCENE)
    try:
        return [renderer.render_sample(seed) for seed in seeds]
    finally:
        renderer.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cell", "objects", "boxes"),
    [
        ("overhead", 13, [[30.8, 116.1, 58.0, 143.1], [77.9, 101.5, 104.9, 128.5]]),
        ("wrist", 18, [[103.3, 37.6, 125.5, 61.1], [59.2, 40.3, 82.1, 63.7]]),
    ],
)
def test_a_sample_depends_on_its_seed_alone(
    cell: str, objects: int, boxes: list[list[float]], request: pytest.FixtureRequest
) -> None:
    config: CellConfig = request.getfixturevalue(cell)
    (fresh,), again = samples(config, range(7, 8)), samples(config, range(4, 8))[-1]
    assert (fresh.image == again.image).all()
    assert fresh.labels == again.labels
    assert len(fresh.labels) == objects
    assert fresh.boxes[:2] == pytest.approx(np.array(boxes), abs=0.06)


@pytest.mark.slow
def test_samples_are_labelled_inside_the_image_and_localize_near_the_object(overhead: CellConfig) -> None:
    made, labels = samples(overhead, range(16)), set[str]()
    assert [len(sample.labels) for sample in made] == [19, 0, 11, 2, 3, 1, 5, 13, 6, 6, 1, 1, 2, 8, 4, 6]
    names = ("boxes", "visible_fraction", "positions", "image")
    sums = [sum(float(getattr(one, name).sum()) for one in made) for name in names]
    assert sums == pytest.approx([45820.016, 84.188, 52.06, 420870682.0], rel=1e-4)
    for sample in made:
        assert (sample.image.shape, sample.boxes.clip(0, IMAGE_SIZE).tolist()) == (
            (IMAGE_SIZE, IMAGE_SIZE, 3),
            sample.boxes.tolist(),
        )
        assert min(sample.visible_fraction, default=1.0) >= 0.5
        # A box's middle is not quite where the object's middle is seen: perspective shows its flank.
        assert np.abs(sample.positions - sample.centres).max(initial=0) < 0.015
        labels |= set(sample.labels)
    assert labels == set(overhead.objects)


@pytest.mark.slow
def test_an_arrangement_follows_from_its_generator(overhead: CellConfig) -> None:
    footprint, table, items = np.array([[0.3, -0.4], [0.8, 0.4]]), (0.9, 0.8, 0.7), []
    for seed in range(30):
        items += draw_arrangement(overhead, footprint, seed % 2 == 0, table, np.random.default_rng(seed))
    total = sum(item.X_WO.position for item in items)
    # Piles settle a little differently on another kind of processor.
    assert (len(items), total) == (231, pytest.approx([115.338, 0.73359, 4.55237], abs=1e-3))
    item = draw_held_object(Pose.of([0.5, 0.1, 0.3]), overhead, np.random.default_rng(1))
    assert item.X_WO.position == pytest.approx([0.5, 0.1, 0.3 - load_mesh(item.model).top])


def test_some_scenes_have_objects_of_unknown_kinds_or_other_sizes(overhead: CellConfig) -> None:
    scenes = [draw_objects(overhead, 20, (0.9, 0.8, 0.7), np.random.default_rng(seed)) for seed in range(20)]
    unknown = [sum(item.label == UNKNOWN_LABEL for item in scene) for scene in scenes]
    resized_ones = [
        sum(item.label != UNKNOWN_LABEL and item.model != overhead.objects[item.label] for item in scene)
        for scene in scenes
    ]
    assert (sum(map(bool, unknown)), sum(map(bool, resized_ones))) == (5, 7)
    assert max(map(len, scenes)) == 20


def test_a_resized_model_has_the_size_that_it_states(overhead: CellConfig) -> None:
    model = scale_model(overhead.objects["duck"], 1.2)
    mesh = load_mesh(model)
    assert (mesh.top - mesh.bottom, mesh.radius) == pytest.approx(
        (model.height, model.radius), abs=0.003 * 1.2
    )


def test_a_silhouette_has_the_area_of_its_shape(overhead: CellConfig) -> None:
    meshes = {label: load_mesh(model) for label, model in overhead.objects.items()}
    areas = {
        label: compute_silhouette_area(mesh, mesh.vertices[:, :2] * 1000) for label, mesh in meshes.items()
    }
    assert areas["cube"] == pytest.approx(50**2)
    assert areas["sphere"] == pytest.approx(np.pi * 30**2, rel=0.01)
    assert {label: mesh.is_convex for label, mesh in meshes.items()} == {
        "cube": True, "sphere": True, "duck": False,
    }  # fmt: skip
    extent = np.prod(np.ptp(meshes["duck"].vertices[:, :2] * 1000, axis=0))
    assert 0.5 * extent < areas["duck"] < 0.85 * extent


def test_what_is_dropped_comes_to_lie_on_the_table_or_in_a_bin(overhead: CellConfig) -> None:
    tilted = Pose.of([0.5, 0.0, 0.06], [0.3, 0.1, 0.2, 0.9])
    starts = [("cube", tilted), ("duck", Pose.of([0.6, 0.1, 0.01])), ("cube", Pose.of([0.52, 0.46, 0.1]))]
    items = [SceneObject(label, overhead.objects[label], X_WO, (1.0, 1.0, 1.0)) for label, X_WO in starts]
    cube, duck, above = (item.X_WO for item in simulate_fall(overhead, items))
    assert cube.position[2] == pytest.approx(0.025, abs=1e-3)
    assert duck.rotation[2, 2] == pytest.approx(1.0, abs=1e-2)
    assert above.position[2] == pytest.approx(0.03, abs=1e-3), "the bin's floor is 5 mm thick"


def make(out: Path, workers: int = 1, images: int = 1, **cells: CellConfig) -> list[tuple[int, int]]:
    """Make a small data set and return what was reported on the way."""
    reported: list[tuple[int, int]] = []
    generate_dataset(
        cells, out, image_count=images, seed=3, layout="coco", worker_count=workers, valid_fraction=0.25,
        progress=lambda made, total: reported.append((made, total)),
    )  # fmt: skip
    return reported


class Here(ThreadPoolExecutor):
    """Does at once, in this process, what `WorkerPool` does in others."""

    def submit(self, call, /, *arguments):  # type: ignore[no-untyped-def]
        done: Future[object] = Future()
        done.set_result(call(*arguments))
        return done


@pytest.mark.slow
@pytest.mark.parametrize("pool", [Here, WorkerPool])
def test_data_sets_and_frames_are_the_same_for_any_number_of_workers(
    pool: type, overhead: CellConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.training.rendering.BLOCK_SIZE", 2)
    monkeypatch.setattr("executive.training.rendering.WorkerPool", pool)
    one, two = tmp_path / "one", tmp_path / "two"
    assert make(one, 1, 4, overhead=overhead) == make(two, 2, 4, overhead=overhead) == [(2, 4), (4, 4)]
    files = sorted(path.relative_to(one) for path in one.rglob("*") if path.is_file())
    assert sum(path.suffix == ".jpg" for path in files) == 4
    assert [(one / file).read_bytes() == (two / file).read_bytes() for file in files] == [True] * len(files)
    assert list(json.loads((one / "valid/truth.json").read_text())) == ["overhead_000003.jpg"]
    frames, again = (
        render_run_frames(
            overhead, image_count=3, seed=3, worker_count=workers, progress=lambda taken, total: None
        )
        for workers in (1, 2)
    )
    assert [frame.file for frame in frames] == [f"overhead_00000{number}" for number in range(3)]
    assert [frame.boxes for frame in frames] == [frame.boxes for frame in again]
    assert frames[0].boxes != frames[1].boxes


@pytest.mark.parametrize(
    ("mesh", "complaint"),
    [
        ("gone.obj", r"overhead: objects\.thing\.mesh: there is no model gone\.obj, neither beside"),
        ("cube.obj", r"overhead: objects\.thing\.height: the model of thing has a height of 1\.0000 m"),
    ],
)
def test_a_model_that_is_not_as_its_cell_says_is_refused(
    mesh: str, complaint: str, tmp_path: Path, overhead: CellConfig
) -> None:
    thing = ObjectConfig(mesh=mesh, height=0.02, radius=0.03)
    with pytest.raises(InputError, match=complaint):
        make(tmp_path / "out", overhead=overhead.model_copy(update={"objects": {"thing": thing}}))
    assert not (tmp_path / "out").exists()


def test_cells_with_different_classes_make_no_dataset(overhead: CellConfig, tmp_path: Path) -> None:
    other = overhead.model_copy(update={"objects": {"cube": overhead.objects["cube"]}})
    with pytest.raises(InputError, match=r"same classes .* a has cube, sphere, duck; b has cube"):
        make(tmp_path, a=overhead, b=other)


def test_a_frame_is_the_cameras_whole_image_labelled_where_a_run_searches_it(overhead: CellConfig) -> None:
    camera = overhead.cameras["overhead"].model_copy(update={"depth": DepthConfig()})
    config = overhead.model_copy(update={"cameras": {"overhead": camera}})
    (drawn,) = samples(config, range(3, 4), is_random=False)
    frame = to_labelled_frame(drawn, "overhead", "a")
    left, top, right, bottom = frame.region or ()
    assert frame.image.shape == (480, 640, 3)
    twice = to_labelled_frame(replace(drawn, region=(10, 20, 522, 532)), "overhead", "a")
    assert twice.boxes == pytest.approx(drawn.boxes * 2 + [10, 20, 10, 20])
    assert frame.depth is not None
    assert (left, top, right, bottom) == camera.table_view
    assert (frame.image[top:bottom, left:right] == drawn.image).all()
    assert len(frame.boxes) == len(frame.labels) >= 3
    for box, position in zip(frame.boxes, frame.truth["positions"], strict=True):
        assert left <= box[0] < box[2] <= right
        assert top <= box[1] < box[3] <= bottom
        # The camera hangs 1.2 m over the table, the top of an object is 5 to 6 cm above it.
        row, column = int((box[1] + box[3]) / 2), int((box[0] + box[2]) / 2)
        seen = np.nanmedian(frame.depth[row - 1 : row + 2, column - 1 : column + 2])
        assert seen == pytest.approx(1.15, abs=0.02)
        assert np.linalg.norm(position[:2] - [0.53, 0.0]) < 0.3
