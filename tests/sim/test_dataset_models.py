"""A dataset is refused before anything is rendered where a model is not as its cell says."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.cell_config import CellConfig, ObjectConfig
from executive.errors import InputError
from executive.sim.datasets import generate


@pytest.mark.parametrize(
    ("mesh", "height", "complaint"),
    [
        ("gone.obj", 0.02, r"overhead: objects\.thing\.mesh: there is no model gone\.obj, neither beside"),
        ("cube.obj", 0.02, r"overhead: objects\.thing\.height: the model of thing has a height of 1\.0000 m"),
    ],
)
def test_it_is_refused(
    mesh: str, height: float, complaint: str, tmp_path: Path, overhead: CellConfig
) -> None:
    thing = ObjectConfig(mesh=mesh, height=height, radius=0.03)
    config = overhead.model_copy(update={"objects": {"thing": thing}})
    out = tmp_path / "out"
    with pytest.raises(InputError, match=complaint):
        generate(
            {"overhead": config},
            out,
            images=1,
            seed=0,
            layout="coco",
            workers=1,
            valid=0.0,
            progress=lambda done, of: None,
        )
    assert not out.exists()
