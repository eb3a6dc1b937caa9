"""Frames of scenes as a run begins with."""

from __future__ import annotations

import numpy as np
import pytest

from executive.cell_config import CellConfig, DepthConfig
from executive.sim.datasets import as_labelled_frame, run_frames
from executive.sim.scenes import SceneRenderer


@pytest.fixture
def with_depth(overhead: CellConfig) -> CellConfig:
    camera = overhead.cameras["overhead"].model_copy(update={"depth": DepthConfig()})
    return overhead.model_copy(update={"cameras": {"overhead": camera}})


def test_a_frame_is_the_cameras_whole_image_labelled_where_a_run_searches_it(with_depth: CellConfig) -> None:
    renderer = SceneRenderer(with_depth, "overhead", randomized=False)
    drawn = renderer.sample(3)
    renderer.close()
    frame = as_labelled_frame(drawn, "overhead", "a")
    left, top, right, bottom = frame.area or ()
    assert frame.image.shape == (480, 640, 3)
    assert frame.depth is not None
    assert frame.depth.shape == (480, 640)
    assert (left, top, right, bottom) == with_depth.cameras["overhead"].table_view
    assert (frame.image[top:bottom, left:right] == drawn.image).all()
    assert len(frame.boxes) == len(frame.labels) >= 3
    for box, position in zip(frame.boxes, frame.truth["positions"], strict=True):
        assert left <= box[0] < box[2] <= right
        assert top <= box[1] < box[3] <= bottom
        # The camera hangs 1.2 m over the table, the top of an object is 5 to 6 cm above it.
        row, column = int((box[1] + box[3]) / 2), int((box[0] + box[2]) / 2)
        assert np.nanmedian(frame.depth[row - 1 : row + 2, column - 1 : column + 2]) == pytest.approx(
            1.15, abs=0.02
        )
        assert np.linalg.norm(position[:2] - [0.53, 0.0]) < 0.3


def test_frames_are_the_same_for_any_number_of_workers(
    overhead: CellConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.sim.datasets.BLOCK", 1)
    told: list[tuple[int, int]] = []
    one, two = (
        run_frames(
            overhead,
            images=2,
            seed=3,
            workers=workers,
            progress=lambda taken, total: told.append((taken, total)),
        )
        for workers in (1, 2)
    )
    assert told == [(1, 2), (2, 2)] * 2
    assert [frame.file for frame in one] == ["overhead_000000", "overhead_000001"]
    for frame, again in zip(one, two, strict=True):
        assert (frame.image == again.image).all()
        assert frame.boxes == again.boxes
    assert one[0].boxes != one[1].boxes
