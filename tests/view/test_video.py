"""Videos of runs: who gets one, and what it shows."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import av
import numpy as np
import PIL.Image
import pytest
from at_terminal import invoke
from numpy.typing import NDArray

from executive.cli.shared import check_video
from executive.errors import InputError
from executive.record.journal import read_journal

MISSION = """
mission: look
cell: cells/overhead.yaml
routes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}
tree: [Detect, Localize, SelectTarget, {MoveToScan: {pose: aside}}]
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run directory of a simulated run of 1.3 s; its folder contains its video `run.gif`."""
    folder = tmp_path_factory.mktemp("video")
    (folder / "look.yaml").write_text(MISSION)
    files = ("--runs", folder / "runs", "--video", folder / "run.gif")
    done = invoke("run", folder / "look.yaml", "--quiet", "--json", *files)
    assert done.exit_code == 0, done.output
    return Path(json.loads(done.stdout)["run"])


def read_gif(file: Path) -> list[NDArray[np.uint8]]:
    image = PIL.Image.open(file)
    frames = []
    for number in range(image.n_frames):
        image.seek(number)
        frames.append(np.asarray(image.convert("RGB")))
    return frames


@pytest.mark.slow
def test_a_gif_shows_world_camera_picture_and_text(run: Path) -> None:
    frames = read_gif(run.parents[2] / "run.gif")
    assert frames[0].shape == (270, 640, 3)
    # Two seconds of the run take one second; equal frames are one frame in the file.
    duration = list(read_journal(run / "journal.jsonl"))[-1].clock
    assert len(frames) == math.ceil(5 * duration) + 1
    world = np.s_[:252, :320]
    camera = np.s_[:252, 320:]
    text = np.s_[252:]
    assert (frames[0][camera] == 0).mean() > 0.99
    for part in (world, camera, text):
        assert (np.abs(frames[0][part].astype(int) - frames[-1][part]).max(axis=2) > 60).sum() > 100
    # The whole arm and all bins are in the picture: its upper edge shows only the background.
    assert (frames[0][world][:10] > 200).mean() > 0.9


@pytest.mark.slow
def test_an_interrupted_run_has_an_mp4_with_the_same_pictures(run: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(run, tmp_path / "runs" / "copy"))
    lines = (copy / "journal.jsonl").read_text().splitlines(keepends=True)
    (copy / "journal.jsonl").write_text("".join(lines[:-1]))
    (copy / "result.json").unlink()
    done = invoke("replay", copy, "--video", tmp_path / "a.mp4")
    assert done.exit_code == 0, done.output
    with av.open(str(tmp_path / "a.mp4")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert frames[0].shape == (540, 1280, 3)
    gif = read_gif(run.parents[2] / "run.gif")
    for number in (0, 3):
        world = np.asarray(PIL.Image.fromarray(frames[2 * number]).reduce(2))[:252, :320]
        assert np.abs(world.astype(int) - gif[number][:252, :320]).mean() < 8
    # The end is not known, so that the last skill is shown until the end.
    assert (frames[-1][504:] > 128).any()


@pytest.mark.parametrize(
    ("cell_kind", "file", "problem"),
    [
        ("fake", "a.mp4", "needs a simulated world"),
        ("sim", "a.webm", "cannot be a video"),
        ("sim", "exists.gif", "exists; name another file"),
        ("sim", "nowhere/a.gif", "its folder does not exist"),
    ],
)
def test_a_video_that_cannot_be_written_is_refused(tmp_path: Path, cell_kind, file, problem) -> None:
    (tmp_path / "exists.gif").touch()
    with pytest.raises(InputError, match=problem):
        check_video(tmp_path / file, cell_kind, force=False)
    check_video(tmp_path / "exists.gif", "sim", force=True)
