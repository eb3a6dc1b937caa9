"""A whole film: what it is made from, and that picture and tree are in step."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import av
import numpy as np
import pytest

from executive.cells.sim.command_log import RUN_STEP, read_commands
from executive.cells.sim.pictures import count_steps
from executive.cells.sim.rebuild import WorldRebuilder
from executive.cells.sim.spawn import build_initial_world
from executive.cells.sim.tool import SuctionTool
from executive.errors import InputError
from executive.events import NodeEnded, ToolCommanded
from executive.record.run_directory import RunDirectory
from executive.view.film.film import write_film
from executive.view.film.formats import MP4
from executive.view.film.run_state import FilmRunState, FilmSource

pytestmark = pytest.mark.slow
MP4_HELD = 50
"""Frames for which the end of an MP4 is shown."""


@pytest.fixture
def copy(filmed_run: RunDirectory, tmp_path: Path) -> RunDirectory:
    """A copy of the run's directory, to take something away from."""
    return RunDirectory(Path(shutil.copytree(filmed_run.path, tmp_path / "copy")))


def test_a_run_becomes_a_film(filmed_run: RunDirectory, tmp_path: Path) -> None:
    reported: list[tuple[int, int]] = []
    source = FilmSource(filmed_run)
    frames = write_film(
        source, tmp_path / "film", MP4, speed=12.0, workers=1, progress=lambda *done: reported.append(done)
    )
    with av.open(str(tmp_path / "film")) as container:
        images = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(images) == frames
    assert reported == [(done, frames) for done in range(1, frames + 1)]
    assert images[0].shape == (720, 1280, 3)
    # The end stands still; before it the robot moved and the tree ran.
    assert np.abs(images[-1].astype(int) - images[-2]).mean() < 0.5
    # Over the last picture stands how it ended.
    card = np.s_[560:700, 560:780]
    assert np.abs(images[-1][card].astype(int) - images[-MP4_HELD - 1][card]).mean() > 30
    half = images[(frames - MP4_HELD) // 2]
    for part in (np.s_[:, :800], np.s_[120:500, 820:]):
        assert (np.abs(images[0][part].astype(int) - half[part]).max(axis=2) > 60).sum() > 500


def test_picture_and_tree_are_in_step(filmed_run: RunDirectory) -> None:
    source = FilmSource(filmed_run)
    events = source.events
    (grasped,) = (
        one.tick for one in events if isinstance(one.event, NodeEnded) and one.event.skill == "Grasp"
    )
    (closed,) = (one.tick for one in events if one.event == ToolCommanded("close"))
    world = build_initial_world(source.config, source.start.seed)
    tool = SuctionTool(world, source.config.tool)
    rebuilder, holds = WorldRebuilder(world, tool), [False]
    for command in read_commands(filmed_run.world_log):
        rebuilder.execute(command)
        if command.kind == RUN_STEP:
            holds.append(tool.holding)
    world.close()
    state = FilmRunState(events, source.nodes, [])
    state.advance_to(grasped, 0.0)
    grasp = state.timeline.activation_by_path["tree/Grasp"]
    assert grasp.status == "SUCCESS"
    assert state.timeline.items.by_name[grasp.item].last_change.state == "held"
    assert holds[grasped]
    assert not any(holds[: closed + 1])
    # The last thing that the journal tells of happened after the last step.
    assert events[-1].tick == count_steps(filmed_run.world_log) == len(holds) - 1


def test_the_source_is_the_record_and_may_be_cut_off(copy: RunDirectory) -> None:
    source = FilmSource(copy)
    assert (source.start.mission, source.start.seed) == ("bring_one", 5)
    assert (source.config.cell, source.nodes[0].path) == ("overhead", "tree")
    assert (source.outcome.status, source.item_count) == ("SUCCESS", 6)
    lines = copy.journal.read_text().splitlines(keepends=True)
    copy.journal.write_text("".join(lines[:-1]))
    copy.result.write_text("{")
    assert FilmSource(copy).outcome is None


@pytest.mark.parametrize(
    ("file", "content", "sentence"),
    [
        ("tree.json", None, 'cannot read the tree "'),
        ("cell.yaml", None, "cannot read the cell file in the run directory"),
        ("journal.jsonl", "", "was interrupted before its start; there is nothing to film"),
        ("world.log", "{}",
         "its cell has no simulated world; film a run on a cell of `kind: sim`"),
        ("world.log", None,
         "it has no world.log, from which its world is simulated again; sweeps do not keep this file."),
    ],
)  # fmt: skip
def test_a_record_that_lacks_a_part_is_refused(copy, file: str, content: str | None, sentence: str) -> None:
    (copy.path / file).unlink()
    if content is not None:
        (copy.path / file).write_text(content)
    with pytest.raises(InputError, match=re.escape(sentence)):
        FilmSource(copy)
