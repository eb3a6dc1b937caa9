"""Videos of runs: who gets one, and what it shows."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import av
import numpy as np
import PIL.Image
import pytest
from click.testing import CliRunner, Result
from numpy.typing import NDArray

from executive.cli.main import main
from executive.record.journal import read_journal

FEW_OBJECTS = ("--seed", "5", "--set", "cell.table.objects=[1, 1]", "--quiet")


def invoke(*words: object) -> Result:
    return CliRunner().invoke(main, [str(word) for word in words])


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run directory of a simulated run; its folder contains its video `run.gif`."""
    folder = tmp_path_factory.mktemp("video")
    done = invoke(
        "run", "sort_overhead", *FEW_OBJECTS, "--runs", folder, "--video", folder / "run.gif", "--json"
    )
    assert done.exit_code == 0, done.output
    return Path(json.loads(done.stdout)["run"])


def read_gif(file: Path) -> list[NDArray[np.uint8]]:
    image = PIL.Image.open(file)
    frames = []
    for number in range(image.n_frames):
        image.seek(number)
        frames.append(np.asarray(image.convert("RGB")))
    return frames


def test_a_gif_shows_world_camera_picture_and_text(run: Path) -> None:
    frames = read_gif(run.parents[1] / "run.gif")
    assert frames[0].shape == (270, 640, 3)
    # Two seconds of the run take one second; equal frames are one frame in the file.
    duration = read_journal(run / "journal.jsonl")[-1].clock
    assert 0.8 * 5 * duration < len(frames) <= 5 * duration + 2
    world, camera, text = np.s_[:252, :320], np.s_[:252, 320:], np.s_[252:]
    assert (frames[0][camera] == 0).mean() > 0.99
    middle = frames[len(frames) // 2]
    for part in (world, camera, text):
        assert (np.abs(frames[0][part].astype(int) - middle[part]).max(axis=2) > 60).sum() > 100
    # The simulated world is larger than the cell: nothing of it touches the edge.
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
    gif = read_gif(run.parents[1] / "run.gif")
    for number in (0, 4):
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
def test_a_video_that_cannot_be_written_is_refused_before_the_run(tmp_path, cell_kind, file, problem) -> None:
    (tmp_path / "exists.gif").write_text("mine")
    words = (*FEW_OBJECTS, "--runs", tmp_path / "runs", "--set", f"cell.kind={cell_kind}")
    refused = invoke("run", "sort_overhead", *words, "--video", tmp_path / file)
    assert (refused.exit_code, problem in refused.stderr) == (2, True), refused.output
    assert not (tmp_path / "runs").exists()
    assert (tmp_path / "exists.gif").read_text() == "mine"
