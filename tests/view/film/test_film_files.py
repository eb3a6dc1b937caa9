"""The file a film is in: what it may be called, when it is there, and what is in it."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image, ImageDraw

from executive.errors import InputError
from executive.view.film.formats import GIF, GIF_SIZE, MP4, choose_format, prepare_file, write_gif, write_mp4
from executive.view.film.style import BACKGROUND, SUCCESS


@pytest.fixture
def frames() -> list[Image.Image]:
    """Twelve frames on which something moves, and that end in another colour."""
    made = []
    for number in range(12):
        frame = Image.new("RGB", (1280, 720), BACKGROUND)
        ImageDraw.Draw(frame).rectangle((40 * number, 300, 40 * number + 60, 360), "#c02020")
        made.append(frame)
    ImageDraw.Draw(made[-1]).rectangle((900, 100, 1200, 500), SUCCESS)
    return made


def test_an_mp4_is_h264_that_everything_plays(frames: list[Image.Image], tmp_path: Path) -> None:
    write_mp4(tmp_path / "x", iter(frames), 25.0)
    with av.open(str(tmp_path / "x")) as container:
        (stream,) = container.streams
        assert stream.codec_context.name == "h264"
        assert stream.codec_context.pix_fmt == "yuv420p"
        assert stream.average_rate == 25
        decoded = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(decoded) == len(frames)
    for frame, original in zip(decoded, frames, strict=True):
        assert np.abs(frame.astype(int) - np.asarray(original)).mean() < 3


def test_a_gif_goes_round_and_keeps_its_colours_to_the_end(frames: list[Image.Image], tmp_path: Path) -> None:
    write_gif(tmp_path / "x", iter(frames), 10.0)
    with Image.open(tmp_path / "x") as gif:
        assert (gif.n_frames, gif.size, gif.info["loop"], gif.info["duration"]) == (12, GIF_SIZE, 0, 100)
        gif.seek(11)
        last = np.asarray(gif.convert("RGB")).astype(int)
    assert np.abs(last[225, 790] - np.asarray(Image.new("RGB", (1, 1), SUCCESS))[0, 0]).max() < 10
    assert np.abs(last[248, 352] - (0xC0, 0x20, 0x20)).max() < 10


@pytest.mark.parametrize(
    ("out", "gif", "found"),
    [(None, False, MP4), (None, True, GIF), ("a.mp4", False, MP4), ("a.GIF", False, GIF),
     ("a.mp4", True, '"a.mp4" cannot be a GIF; give a file name that ends in .gif, or omit --gif'),
     ("a.avi", False, '"a.avi" cannot be a film; give a file name that ends in .mp4 or .gif')],
)  # fmt: skip
def test_the_name_says_what_a_film_is_and_another_is_refused(out: str | None, gif: bool, found) -> None:
    try:
        assert choose_format(None if out is None else Path(out), gif) is found
    except InputError as refused:
        assert str(refused) == found


def test_a_file_is_there_whole_or_as_it_was(tmp_path: Path) -> None:
    out = tmp_path / "film.mp4"
    with prepare_file(out, force=False) as part:
        part.write_text("one")
        assert not out.exists()
    assert out.read_text() == "one"
    with pytest.raises(InputError) as refused, prepare_file(out, force=False):
        pytest.fail("it began")
    there = f'"{out}" exists; name another file with -o, or overwrite it with --force'
    assert str(refused.value) == there
    with pytest.raises(KeyboardInterrupt), prepare_file(out, force=True) as part:
        part.write_text("half")
        raise KeyboardInterrupt
    assert [file.name for file in tmp_path.iterdir()] == ["film.mp4"]
    assert out.read_text() == "one"
