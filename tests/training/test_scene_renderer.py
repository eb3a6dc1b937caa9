"""Rendered scenes: a scene that cannot be labelled ends with an error after a limited number of attempts."""

from __future__ import annotations

import pytest

from executive.cells.sim.scene_file import DECLARED_SCENE
from executive.errors import InputError
from executive.mission.parse.cell_file import load_cell
from executive.training import rendering


@pytest.mark.parametrize("text", ["found no room", r"heavily occluded in 2 scenes of cell overhead; ask"])
def test_scenes_without_an_image_end_with_an_error(missions, monkeypatch, text):
    spawn_objects, attempts = rendering.spawn_objects, []

    def spawn(*arguments):
        attempts.append(arguments)
        if text == "found no room":
            raise InputError("the objects found no room")
        spawn_objects(*arguments)

    monkeypatch.setattr(rendering, "spawn_objects", spawn)
    monkeypatch.setattr(rendering, "MAX_ATTEMPTS", 2)
    monkeypatch.setattr(rendering, "MIN_LABELLED_VISIBLE_FRACTION", 2)
    renderer = rendering.SceneRenderer(load_cell(missions / "cells" / "overhead.yaml"), DECLARED_SCENE)
    with pytest.raises(InputError, match=text):
        renderer.render_image(1, 1)
    renderer.close()
    assert len(attempts) == 2
