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

from executive.errors import InputError, explain_os_errors
from executive.record.atomic_file import atomic_replacement
from executive.view.film.ink import FAILURE, RUNNING, SUCCESS

GIF_SIZE = (960, 540)
"""Width and height of a GIF's frames [pixel]; a README shows no larger ones."""
PALETTE_SIZE = 255
"""Number of colours in the palette; the 256th marks pixels that are unchanged since the previous frame."""
SAMPLE_FRAMES = 8
"""Number of first frames from which the palette is chosen."""
_DROPPED_BITS, _STATUS_WEIGHT = 3, 60


def write_mp4(path: Path, frames: Iterable[Image.Image], rate: float) -> None:
    """Write frames, `rate` per second, as H.264 for browsers and phones."""
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=round(rate), options={"crf": "20", "preset": "medium"})
        stream.pix_fmt = "yuv420p"
        for number, image in enumerate(frames):
            if number == 0:
                stream.width, stream.height = image.size
            container.mux(stream.encode(av.VideoFrame.from_image(image)))
        container.mux(stream.encode(None))


def write_gif(path: Path, frames: Iterable[Image.Image], rate: float) -> None:
    """Write frames, `rate` per second, as an endless GIF with one palette."""
    small = (image.resize(GIF_SIZE, Image.Resampling.LANCZOS) for image in frames)
    first = list(islice(small, SAMPLE_FRAMES))
    palette = _choose_palette(first)
    quantized = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in chain(first, small))
    next(quantized).save(
        path,
        "GIF",
        save_all=True,
        append_images=quantized,
        duration=round(1000 / rate),
        loop=0,
        optimize=False,
    )


def _choose_palette(frames: list[Image.Image]) -> Image.Image:
    """Return an image whose palette has the colours of these frames and of the status of a run.

    Each colour counts by the square root of its number of pixels, so that small objects keep their colours.
    """
    pixels = np.concatenate([np.asarray(frame).reshape(-1, 3) for frame in frames])
    coarse = pixels.astype(np.int32) >> _DROPPED_BITS << _DROPPED_BITS
    codes = coarse @ [1 << 16, 1 << 8, 1]
    _, places, counts = np.unique(codes, return_index=True, return_counts=True)
    status_colours = np.array([ImageColor.getrgb(colour) for colour in (RUNNING, SUCCESS, FAILURE)], np.uint8)
    samples = np.concatenate(
        [
            np.repeat(pixels[places], np.sqrt(counts).astype(int), axis=0),
            np.repeat(status_colours, _STATUS_WEIGHT, axis=0),
        ]
    )
    return Image.fromarray(samples[None]).quantize(PALETTE_SIZE, Image.Quantize.MEDIANCUT)


@dataclass(frozen=True)
class Format:
    """File format of a film.

    Attributes:
        suffix: Suffix of the file name.
        rate: Frames per second.
        speed: Default number of seconds on the robot's clock per second of the film.
        write: Function that writes frames to a file.
    """

    suffix: str
    rate: float
    speed: float
    write: Callable[[Path, Iterable[Image.Image], float], None]


MP4 = Format(".mp4", 25.0, 1.0, write_mp4)
"""Video in full resolution."""
GIF = Format(".gif", 10.0, 2.0, write_gif)
"""Animated image at lower resolution; the format counts time in hundredths of a second."""
FORMATS = (MP4, GIF)


def choose_format(out: Path | None, gif: bool) -> Format:
    """Return the format of a film.

    Args:
        out: File of the film; None if the user gave none.
        gif: True if the user asked for a GIF.

    Raises:
        InputError: The suffix of the file is unknown or contradicts `gif`.
    """
    default = GIF if gif else MP4
    if out is None:
        return default
    suffix = out.suffix.lower()
    if gif and suffix != GIF.suffix:
        raise InputError(f'"{out}" is no name for a GIF; end it in .gif, or leave out --gif')
    found = next((format for format in FORMATS if format.suffix == suffix), None)
    if found is None:
        raise InputError(f'"{out}" is no name for a film; end it in {MP4.suffix} or {GIF.suffix}')
    return found


@contextmanager
def prepare_file(path: Path, *, force: bool) -> Iterator[Path]:
    """Yield a temporary file for a film; move it to `path` if no exception occurred.

    Raises:
        InputError: The file exists, or cannot be written.
    """
    if path.exists() and not force:
        raise InputError(f'"{path}" exists; name another file with -o, or overwrite it with --force')
    remedy = "name another place with -o"
    with (
        explain_os_errors(InputError, f'cannot write the film "{path}"', remedy),
        atomic_replacement(path) as partial_file,
    ):
        yield partial_file
