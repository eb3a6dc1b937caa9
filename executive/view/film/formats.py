"""Formats of a film: H.264 in MP4 to watch, an animated GIF for a README."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

import av
import numpy as np
from PIL import Image, ImageColor

from executive.errors import InputError, explained
from executive.record.atomic_file import atomic_replacement
from executive.view.film.ink import FAILURE, RUNNING, SUCCESS

GIF_SIZE = (960, 540)
"""Size of a GIF's frames [pixel]: a README shows no more."""
COLOURS = 255
"""Colours of a GIF; one more says what is as in the frame before."""
SAMPLED = 8
"""First frames of a GIF that its colours are chosen from."""
_COARSE, _ENDS = 3, 60


def write_mp4(path: Path, frames: Iterable[Image.Image], rate: float) -> None:
    """Write frames, `rate` of them a second, as H.264 that every browser and phone plays."""
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=round(rate), options={"crf": "20", "preset": "medium"})
        stream.pix_fmt = "yuv420p"
        for number, image in enumerate(frames):
            if number == 0:
                stream.width, stream.height = image.size
            container.mux(stream.encode(av.VideoFrame.from_image(image)))
        container.mux(stream.encode(None))


def write_gif(path: Path, frames: Iterable[Image.Image], rate: float) -> None:
    """Write frames, `rate` of them a second, as a GIF that begins again; all share one palette."""
    small = (image.resize(GIF_SIZE, Image.Resampling.LANCZOS) for image in frames)
    first = list(islice(small, SAMPLED))
    palette = _palette(first)
    drawn = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in chain(first, small))
    next(drawn).save(
        path, "GIF", save_all=True, append_images=drawn, duration=round(1000 / rate), loop=0, optimize=False
    )


def _palette(frames: list[Image.Image]) -> Image.Image:
    """Return an image with the colours that suit these frames, and those of how a run ends.

    What covers little is seen as well as what covers much: each colour counts by the root of its share.
    """
    seen = np.concatenate([np.asarray(frame).reshape(-1, 3) for frame in frames])
    coarse = seen.astype(np.int32) >> _COARSE << _COARSE
    codes = coarse @ [1 << 16, 1 << 8, 1]
    _, places, counts = np.unique(codes, return_index=True, return_counts=True)
    ends = np.array([ImageColor.getrgb(colour) for colour in (RUNNING, SUCCESS, FAILURE)], np.uint8)
    weighed = np.concatenate(
        [np.repeat(seen[places], np.sqrt(counts).astype(int), axis=0), np.repeat(ends, _ENDS, axis=0)]
    )
    return Image.fromarray(weighed[None]).quantize(COLOURS, Image.Quantize.MEDIANCUT)


@dataclass(frozen=True)
class Format:
    """What a film can be.

    Attributes:
        suffix: How the names of such files end.
        rate: Frames per second.
        speed: Seconds on the robot's clock per second of the film, where nobody says otherwise.
        write: Writes frames to a file.
    """

    suffix: str
    rate: float
    speed: float
    write: Callable[[Path, Iterable[Image.Image], float], None]


MP4 = Format(".mp4", 25.0, 1.0, write_mp4)
"""A film to watch."""
GIF = Format(".gif", 10.0, 2.0, write_gif)
"""A film that begins by itself where a picture can stand; its time is counted in hundredths of a second."""
FORMATS = (MP4, GIF)


def format_of(out: Path | None, gif: bool) -> Format:
    """Return what a film is to be.

    Args:
        out: The file that it is to be in; None where nobody said.
        gif: Whether somebody asked for a GIF.

    Raises:
        InputError: The name of the file says something else.
    """
    wanted = GIF if gif else MP4
    if out is None:
        return wanted
    suffix = out.suffix.lower()
    if gif and suffix != GIF.suffix:
        raise InputError(f'"{out}" is no name for a GIF; end it in .gif, or leave out --gif')
    found = next((format for format in FORMATS if format.suffix == suffix), None)
    if found is None:
        raise InputError(f'"{out}" is no name for a film; end it in {MP4.suffix} or {GIF.suffix}')
    return found


@contextmanager
def file_for(path: Path, *, force: bool) -> Iterator[Path]:
    """Yield a file to write a film into; it gets to `path`, whole, when nothing went wrong.

    Raises:
        InputError: There is something already, or nothing can be written there.
    """
    if path.exists() and not force:
        raise InputError(
            f'"{path}" is there already; name another file with -o, or write over it with --force'
        )
    instead = "name another place with -o"
    with explained(InputError, f'cannot write the film "{path}"', instead), atomic_replacement(path) as part:
        yield part
