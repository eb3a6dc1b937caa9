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
from executive.record.atomic_file import replace_atomically
from executive.view.film.style import FAILURE, RUNNING, SUCCESS

GIF_SIZE = (960, 540)
"""Width and height of the frames of a GIF [pixel]; a README scales larger images down."""
PALETTE_SIZE = 255
"""Number of colours in the palette of a GIF; colour 256 marks pixels that equal those of the last frame."""
PALETTE_FRAME_COUNT = 8
"""Number of frames, from the first on, from which the palette of a GIF is computed."""
_DROPPED_BITS, _STATUS_WEIGHT = 3, 60
"""Number of low bits of a channel that are ignored when colours are counted; samples per status colour."""


def write_mp4(path: Path, frames: Iterable[Image.Image], frame_rate: float) -> None:
    """Write frames as an MP4 file with H.264, `frame_rate` frames per second."""
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream(
            "libx264", rate=round(frame_rate), options={"crf": "20", "preset": "medium"}
        )
        stream.pix_fmt = "yuv420p"
        for number, image in enumerate(frames):
            if number == 0:
                stream.width, stream.height = image.size
            container.mux(stream.encode(av.VideoFrame.from_image(image)))
        container.mux(stream.encode(None))


def write_gif(path: Path, frames: Iterable[Image.Image], frame_rate: float) -> None:
    """Write frames as an endlessly repeated GIF with one palette, `frame_rate` frames per second."""
    resized = (image.resize(GIF_SIZE, Image.Resampling.LANCZOS) for image in frames)
    first = list(islice(resized, PALETTE_FRAME_COUNT))
    palette = _compute_palette(first)
    quantized = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in chain(first, resized))
    next(quantized).save(
        path,
        "GIF",
        save_all=True,
        append_images=quantized,
        duration=round(1000 / frame_rate),
        loop=0,
        optimize=False,
    )


def _compute_palette(frames: list[Image.Image]) -> Image.Image:
    """Return an image whose palette contains the most important colours of the frames and the status colours.

    The weight of a colour is the square root of its number of pixels, so that small objects keep their
    colours.
    """
    pixels = np.concatenate([np.asarray(frame).reshape(-1, 3) for frame in frames])
    coarse = pixels.astype(np.int32) >> _DROPPED_BITS << _DROPPED_BITS
    codes = coarse @ [1 << 16, 1 << 8, 1]
    _, first_indices, counts = np.unique(codes, return_index=True, return_counts=True)
    status_colours = np.array([ImageColor.getrgb(colour) for colour in (RUNNING, SUCCESS, FAILURE)], np.uint8)
    samples = np.concatenate(
        [
            np.repeat(pixels[first_indices], np.sqrt(counts).astype(int), axis=0),
            np.repeat(status_colours, _STATUS_WEIGHT, axis=0),
        ]
    )
    return Image.fromarray(samples[None]).quantize(PALETTE_SIZE, Image.Quantize.MEDIANCUT)


@dataclass(frozen=True)
class FilmFormat:
    """File format of a film.

    Attributes:
        suffix: Suffix of the file name, with the dot.
        frame_rate: Frames per second.
        speed: Default number of seconds on the robot's clock per second of the film.
        write: Function that writes frames to a file, given the file, the frames and the frame rate.
    """

    suffix: str
    frame_rate: float
    speed: float
    write: Callable[[Path, Iterable[Image.Image], float], None]


MP4 = FilmFormat(".mp4", 25.0, 1.0, write_mp4)
"""Video at full resolution."""
GIF = FilmFormat(".gif", 10.0, 2.0, write_gif)
"""Animated image at lower resolution; the duration of a frame is a multiple of 0.01 s in this format."""
FORMATS = (MP4, GIF)


def choose_format(out: Path | None, gif: bool) -> FilmFormat:
    """Return the format of a film.

    Args:
        out: File of the film that the user gave, or None.
        gif: True if the user requested a GIF.

    Raises:
        InputError: The suffix of the file is unknown or contradicts `gif`.
    """
    default = GIF if gif else MP4
    if out is None:
        return default
    suffix = out.suffix.lower()
    if gif and suffix != GIF.suffix:
        raise InputError(f'"{out}" cannot be a GIF; give a file name that ends in .gif, or omit --gif')
    found = next((format for format in FORMATS if format.suffix == suffix), None)
    if found is None:
        raise InputError(
            f'"{out}" cannot be a film; give a file name that ends in {MP4.suffix} or {GIF.suffix}'
        )
    return found


@contextmanager
def prepare_file(path: Path, *, force: bool) -> Iterator[Path]:
    """Yield a temporary file for a film, and move it to `path` if no exception occurred.

    Raises:
        InputError: The file exists, or cannot be written.
    """
    if path.exists() and not force:
        raise InputError(f'"{path}" exists; name another file with -o, or overwrite it with --force')
    remedy = "name another place with -o"
    with (
        explain_os_errors(InputError, f'cannot write the film "{path}"', remedy),
        replace_atomically(path) as partial_file,
    ):
        yield partial_file
