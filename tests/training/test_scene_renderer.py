"""Rendered scenes: a scene that cannot be labelled ends with an error after a limited number of attempts."""

from __future__ import annotations

import itertools

import pytest

from executive.cells.sim.scene_file import DECLARED_SCENE
from executive.errors import InputError
from executive.mission.parse.cell_file import load_cell
from executive.training.rendering import MAX_ATTEMPTS, SceneRenderer


@pytest.mark.parametrize(
    "draws", [["occluded"], ["no room"], ["occluded", "no room"], ["no room", "occluded"]]
)
def test_scenes_without_an_image_end_with_an_error(missions, monkeypatch, draws):
    attempts = []

    def draw_scene(renderer, scene, rng):
        attempts.append(draw := next(kinds))
        if draw == "no room":
            raise InputError("the objects found no room")

    monkeypatch.setattr(SceneRenderer, "_render_initial", draw_scene)
    renderer = SceneRenderer(load_cell(missions / "cells" / "overhead.yaml"), DECLARED_SCENE)
    kinds = itertools.cycle(draws)
    message = (
        "found no room" if "no room" in draws else r"heavily occluded in 50 scenes of cell overhead; ask"
    )
    with pytest.raises(InputError, match=message):
        renderer.render_image(1, 1)
    renderer.close()
    assert len(attempts) == MAX_ATTEMPTS
