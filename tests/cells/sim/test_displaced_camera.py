"""Runs on a cell whose camera is not where the cell file says."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from executive.cell.workcell import CellOptions
from executive.cells.sim.cell import SimCell
from executive.testing.oracle import TrueFrame, TruthCamera, make_oracle_kind
from executive.testing.run_mission import run_mission


@pytest.fixture
def displaced(tmp_path: Path) -> Callable[..., Callable[..., SimCell]]:
    """Make a kind of cell with rendered images whose camera is displaced."""

    def kind(**camera: Any) -> Callable[..., SimCell]:
        path = tmp_path / "moved.yaml"
        path.write_text(yaml.safe_dump({"scene": "moved", "camera": camera}))

        def build(*args: Any, options: CellOptions, **others: Any) -> SimCell:
            return make_oracle_kind(renders_images=True)(
                *args, options=replace(options, scene=path), **others
            )

        return build

    return kind


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mission", "camera", "shift"),
    [
        ("sort_overhead", {"shift": [0.03, 0.0, 0.0]}, (30, 0, 0)),
        ("sort_stacked", {"shift": [0.0, 0.03, 0.0]}, (0, 30, 0)),
        # Forwards along the flange's x axis is backwards in the world.
        ("sort_wrist", {"shift": [0.03, 0.0, 0.0]}, None),
        # Other edges lie beside the outlines.
        ("sort_wrist", {"shift": [0.02, 0.0, 0.0]}, None),
        ("inspect_then_sort", {"turn_deg": [0.0, 5.0, 0.0]}, None),
        ("pick_on_request", {"fov_factor": 1.1}, None),
        ("sort_by_priority", {"shift": [0.0, 0.0, -0.12]}, (0, 0, -120)),
    ],
)
def test_a_moved_camera_ends_a_run_before_anything_is_touched(
    displaced: Callable[..., Callable[..., SimCell]],
    mission: str,
    camera: dict[str, Any],
    shift: tuple[float, float, float] | None,
) -> None:
    result = run_mission(mission, displaced(**camera), seed=1, requests=["cube"])
    assert (result.status, result.reason) == ("FAILURE", "Detect.camera_moved")
    assert not result.list_activated_nodes("*Approach")
    found = re.search(r"moved by \((\S+), (\S+), (\S+)\) mm", result.message)
    assert found is not None
    if shift is not None:
        assert np.array([float(text) for text in found.groups()]) == pytest.approx(shift, abs=10)


@pytest.mark.slow
def test_a_camera_that_is_moved_during_a_run_ends_it_once_the_tool_is_empty() -> None:
    class Pushed(TruthCamera):
        """A camera that is moved by 20 mm before its seventh frame."""

        def capture(self) -> TrueFrame:
            if self._frame_count == 6:
                keys = ("position", "look_at")
                moved = {
                    key: tuple(np.add(getattr(self._true_config, key), (0.0, 0.02, 0.0))) for key in keys
                }
                self._true_config = self._true_config.model_copy(update=moved)
            return super().capture()

    kind = partial(make_oracle_kind(), build_camera=partial(Pushed, renders_images=True))
    result = run_mission("sort_overhead", kind, seed=1)
    assert (result.status, result.reason, result.held_item) == ("FAILURE", "Detect.camera_moved", "")
    assert result.agrees and result.items["placed"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("mission", ["sort_overhead", "sort_wrist"])
def test_a_camera_in_its_place_ends_no_run(mission: str) -> None:
    assert run_mission(mission, make_oracle_kind(renders_images=True), seed=1).status == "SUCCESS"
