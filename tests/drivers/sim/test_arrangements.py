"""Random scenes for a training: which objects lie in them, and in which colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from at_terminal import invoke

from executive.cell.config import CellConfig, ObjectConfig
from executive.cell.devices import TrueObject
from executive.cell.objects import UNKNOWN_LABEL
from executive.drivers.sim.arrangements import draw_objects, get_model
from executive.mission.cell_file import load_cell
from executive.training.samples import LabelledDataset

TABLE = (0.6, 0.5, 0.4)


@pytest.fixture(scope="module")
def fruit(missions: Path) -> CellConfig:
    objects = missions / "cells" / "objects"
    overhead = load_cell(missions / "cells" / "overhead.yaml")
    apple = ObjectConfig(mesh=str(objects / "fruit" / "apple.obj"), height=0.058, radius=0.0337)
    meshes = tuple(map(str, sorted(objects.glob("others/*.obj"))))
    unknown = overhead.unknown.model_copy(update={"meshes": meshes})
    return overhead.model_copy(update={"objects": {"apple": apple}, "unknown": unknown})


def draw_many(config: CellConfig, count: int) -> list[TrueObject]:
    """Return the objects of many random scenes."""
    generators = map(np.random.default_rng, range(count))
    return [one for rng in generators for one in draw_objects(config, 5, TABLE, rng)]


def test_textured_objects_keep_their_colours_and_others_have_any(fruit: CellConfig, overhead) -> None:
    tints = np.array([one.colour for one in draw_many(fruit, 60) if one.label != UNKNOWN_LABEL])
    assert tints.min() > 0.5
    assert (tints.max(axis=1) / tints.min(axis=1)).max() < 1.2
    colours = np.array([one.colour for one in draw_many(overhead, 60)])
    assert colours.min() < 0.1


def test_objects_of_no_class_are_mostly_those_of_the_cell(fruit: CellConfig, overhead) -> None:
    unknown = [get_model(one) for one in draw_many(fruit, 100) if one.label == UNKNOWN_LABEL]
    own = [model for model in unknown if model.mesh in fruit.unknown.meshes]
    assert len(unknown) > 20 and 0.6 < len(own) / len(unknown) < 1
    assert len({model.mesh for model in own}) > 10
    others = [get_model(one) for one in draw_many(overhead, 100) if one.label == UNKNOWN_LABEL]
    assert others and all(model.urdf.startswith("random_urdfs") for model in others)


def test_a_data_set_of_several_cells_has_the_classes_of_all(tmp_path: Path) -> None:
    made = invoke("dataset", "overhead", "fasteners", "--out", str(tmp_path), "--images", "2")
    assert made.exit_code == 0, made.output
    classes = LabelledDataset(tmp_path, "train").classes
    assert classes == ["cube", "sphere", "duck", "bolt", "nut", "washer"]
