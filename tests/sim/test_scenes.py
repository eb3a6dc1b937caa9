from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from executive.cell_config import CellConfig
from executive.errors import InputError
from executive.geometry import Pose
from executive.sim.arrangements import settle
from executive.sim.datasets import generate
from executive.sim.models import load_mesh
from executive.sim.scenes import SIZE, SceneRenderer
from executive.sim.silhouette import outline_area


@pytest.mark.parametrize("cell", ["overhead", "wrist"])
def test_a_sample_depends_on_its_seed_alone(cell: str, request: pytest.FixtureRequest) -> None:
    config: CellConfig = request.getfixturevalue(cell)
    used = SceneRenderer(config, cell)
    try:
        for seed in range(4):
            used.sample(seed)
        again = used.sample(11)
    finally:
        used.close()
    new = SceneRenderer(config, cell)
    fresh = new.sample(11)
    new.close()
    assert (fresh.image == again.image).all()
    assert (fresh.boxes == again.boxes).all()
    assert fresh.labels == again.labels


def test_samples_are_labelled_inside_the_image_and_localize_near_the_object(overhead: CellConfig) -> None:
    renderer, labels = SceneRenderer(overhead, "overhead"), set()
    try:
        samples = [renderer.sample(seed) for seed in range(15)]
    finally:
        renderer.close()
    for sample in samples:
        assert sample.image.shape == (SIZE, SIZE, 3)
        assert (sample.boxes >= 0).all()
        assert (sample.boxes <= SIZE).all()
        assert (sample.boxes[:, 2:] - sample.boxes[:, :2] > 3).all()
        assert (sample.visible_fraction >= 0.5).all()
        assert len(sample.ignored) <= 1
        # A box's middle is not quite where the object's middle is seen: perspective shows its flank.
        assert np.abs(sample.positions - sample.centres).max(initial=0) < 0.015
        labels |= set(sample.labels)
    assert labels == set(overhead.objects)


def test_a_silhouette_has_the_area_of_its_shape(overhead: CellConfig) -> None:
    areas = {}
    for label, model in overhead.objects.items():
        mesh = load_mesh(model)
        areas[label] = outline_area(mesh, mesh.vertices[:, :2] * 1000)
    assert areas["cube"] == pytest.approx(50**2)
    assert areas["sphere"] == pytest.approx(np.pi * 30**2, rel=0.01)
    duck = load_mesh(overhead.objects["duck"])
    assert not duck.convex
    extent = np.prod(np.ptp(duck.vertices[:, :2] * 1000, axis=0))
    assert 0.5 * extent < areas["duck"] < 0.85 * extent


def test_what_is_dropped_comes_to_lie_on_the_table_or_on_another(overhead: CellConfig) -> None:
    tilted = Pose.of([0.5, 0.0, 0.06], [0.3, 0.1, 0.2, 0.9])
    cube, duck, above = settle(
        overhead,
        [("cube", tilted), ("duck", Pose.of([0.6, 0.1, 0.01])), ("cube", Pose.of([0.52, 0.46, 0.1]))],
    )
    assert cube.position[2] == pytest.approx(0.025, abs=1e-3)
    assert duck.rotation[2, 2] == pytest.approx(1.0, abs=1e-2)
    assert above.position[2] == pytest.approx(0.03, abs=1e-3), "the bin's floor is 5 mm thick"


def test_a_dataset_is_the_same_for_any_number_of_workers(
    overhead: CellConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.sim.datasets.BLOCK", 2)
    told: list[tuple[int, int]] = []
    for workers in (1, 2):
        generate(
            {"overhead": overhead},
            tmp_path / str(workers),
            images=4,
            seed=3,
            layout="coco",
            workers=workers,
            valid=0.25,
            progress=lambda made, total: told.append((made, total)),
        )
    assert told[-1] == (4, 4)
    files = sorted(path.relative_to(tmp_path / "1") for path in (tmp_path / "1").rglob("*") if path.is_file())
    assert sum(path.suffix == ".jpg" for path in files) == 4
    for file in files:
        assert (tmp_path / "1" / file).read_bytes() == (tmp_path / "2" / file).read_bytes()
    valid = json.loads((tmp_path / "1/valid/truth.json").read_text())
    assert list(valid) == ["overhead_000003.jpg"]


def test_cells_with_different_classes_make_no_dataset(overhead: CellConfig, tmp_path: Path) -> None:
    other = overhead.model_copy(update={"objects": {"cube": overhead.objects["cube"]}})
    with pytest.raises(InputError, match=r"same classes .* a has cube, sphere, duck; b has cube"):
        generate(
            {"a": overhead, "b": other},
            tmp_path,
            images=1,
            seed=1,
            layout="coco",
            workers=1,
            valid=0,
            progress=lambda made, total: None,
        )
