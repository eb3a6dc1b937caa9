"""Pictures of a recorded world: of the right moments, whoever takes them."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from executive.cell.config import CellConfig
from executive.cells.sim import command_log as log
from executive.cells.sim import pictures as module
from executive.cells.sim.command_log import CommandLog
from executive.cells.sim.pictures import (
    BOTTOM_COLOUR,
    TOP_COLOUR,
    PictureSource,
    compute_viewpoint,
    count_steps,
    render_pictures,
    render_pictures_in_process,
)
from executive.cells.sim.renderer import Image
from executive.errors import InputError

SIZE = (96, 84)
STEPS = 36


def swing(config: CellConfig, path: Path, idle: int) -> PictureSource:
    """A log in which the arm swings for some steps; in the middle some steps of nobody's run."""
    home = np.radians(config.arm.poses_deg["home"])
    commands = CommandLog(path)
    for step in range(STEPS):
        commands.append(log.JOINT_TARGETS, step / 240, *(home - 0.02 * step * np.eye(7)[0]))
        commands.append(log.RUN_STEP)
        if step == 20:
            for _ in range(idle):
                commands.append(log.IDLE_STEP)
    commands.close()
    return PictureSource(config, 5, path, compute_viewpoint(config, SIZE, (2, 2, 94, 82)))


@pytest.fixture
def shoot(overhead: CellConfig, tmp_path: Path) -> PictureSource:
    return swing(overhead, tmp_path / "log", idle=8)


def changed(one: Image, other: Image) -> int:
    """How many pixels differ."""
    return np.count_nonzero((one != other).any(axis=2))


def test_each_picture_is_of_its_moment(shoot: PictureSource, tmp_path: Path) -> None:
    assert count_steps(shoot.log) == STEPS
    with pytest.raises(InputError, match="can neither be resumed nor filmed"):
        count_steps(tmp_path / "none")
    first, same, middle, last = render_pictures_in_process(shoot, [0, 0, 18, STEPS])
    assert first.shape == (SIZE[1], SIZE[0], 3)
    assert (first == same).all()
    assert 0 < changed(first, middle) < changed(first, last)
    (alone,) = render_pictures_in_process(shoot, [18])
    assert (alone == middle).all()
    image = first.astype(int)  # without the floor
    assert np.abs(image[0] - TOP_COLOUR).max() <= 1
    assert np.abs(image[-1, -1] - BOTTOM_COLOUR).max() <= 1


@pytest.mark.slow
def test_several_processes_take_the_same_pictures_in_the_same_order(
    shoot: PictureSource, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MAX_PICTURES_PER_BLOCK", 4)
    steps = [0, 3, 6, 9, 12, 15, 24, 30, STEPS]
    with closing(render_pictures(shoot, steps, worker_count=2)) as taken:
        together = list(taken)
    for here, there in zip(render_pictures_in_process(shoot, steps), together, strict=True):
        assert (here == there).all()


def test_a_viewpoint_has_arm_workspace_and_bins_in_the_given_part_of_the_image(overhead: CellConfig) -> None:
    view = compute_viewpoint(overhead, (800, 720), (20, 60, 780, 640))
    assert view.matrix == pytest.approx(np.array([[1215.34, 0, 400], [0, 1215.34, 360], [0, 0, 1]]), rel=1e-5)
    pose = [1.8486, -1.1888, 1.3928, -0.7711, -0.3845, 0.2265, 0.4542]
    assert (view.X_WC.to_rounded_list(4), view.size) == (pytest.approx(pose, abs=2e-4), (800, 720))


def test_a_picture_is_of_the_world_of_the_scene(shoot: PictureSource, tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text("scene: green\ntable: {colour: [0.2, 0.9, 0.2]}\nlight: {brightness: 0.1}\n")
    (usual,), (other,) = (
        render_pictures_in_process(each, [0]) for each in (shoot, replace(shoot, scene=scene))
    )
    greener = (other[..., 1] > 1.5 * other[..., 0]) & (usual[..., 1] <= usual[..., 0])
    assert greener.mean() > 0.1
