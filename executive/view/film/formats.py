"""File formats of a film: MP4 with H.264 for video players, and animated GIF for a README."""

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
"""Number of colours in the palette of a GIF; the 256th index marks pixels without change between frames."""
PALETTE_FRAME_COUNT = 8
"""Number of frames at the start of a film from which the palette of a GIF is computed."""
_IGNORED_BITS = 3
"""Number of low bits of a colour channel that are ignored, so that similar colours are counted together."""
_STATUS_COLOUR_WEIGHT = 60
"""Weight of each status colour in the palette; other colours are weighted by their number of pixels."""


def write_mp4(path: Path, frames: Iterable[Image.Image], frame_rate: float) -> None:
    """Write frames as an MP4 file with H.264, `frame_rate` frames per second."""
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", round(frame_rate), {"crf": "20", "preset": "medium"})
        stream.pix_fmt = "yuv420p"
        for number, image in enumerate(frames):
            if number == 0:
                stream.width, stream.height = image.size
            container.mux(stream.encode(av.VideoFrame.from_image(image)))
        container.mux(stream.encode(None))


def write_gif(path: Path, frames: Iterable[Image.Image], frame_rate: float) -> None:
    """Write frames as an endlessly repeated GIF with one palette, `frame_rate` frames per second."""
    resized_frames = (image.resize(GIF_SIZE, Image.Resampling.LANCZOS) for image in frames)
    first_frames = list(islice(resized_frames, PALETTE_FRAME_COUNT))
    palette = _compute_palette(first_frames)
    all_frames = chain(first_frames, resized_frames)
    quantized_frames = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in all_frames)
    next(quantized_frames).save(
        path, "GIF", save_all=True, append_images=quantized_frames, duration=round(1000 / frame_rate), loop=0,
        optimize=False,
    )  # fmt: skip


def _compute_palette(frames: list[Image.Image]) -> Image.Image:
    """Return an image whose palette contains the status colours and the most important colours of the frames.

    The weight of a colour is the square root of its number of pixels, so that small objects keep their
    colours.
    """
    pixels = np.concatenate([np.asarray(frame).reshape(-1, 3) for frame in frames])
    # np.unique is faster for one integer per colour than for rows of three channels.
    colour_numbers = (pixels.astype(np.int32) >> _IGNORED_BITS) @ [1 << 16, 1 << 8, 1]
    _, first_indices, counts = np.unique(colour_numbers, return_index=True, return_counts=True)
    status_colours = np.array([ImageColor.getrgb(colour) for colour in (RUNNING, SUCCESS, FAILURE)], np.uint8)
    frame_samples = np.repeat(pixels[first_indices], np.sqrt(counts).astype(int), axis=0)
    status_samples = np.repeat(status_colours, _STATUS_COLOUR_WEIGHT, axis=0)
    samples = np.concatenate([frame_samples, status_samples])
    return Image.fromarray(samples[None]).quantize(PALETTE_SIZE, Image.Quantize.MEDIANCUT)


@dataclass(frozen=True)
class FilmFormat:
    """File format of a film.

    Attributes:
        suffix: Suffix of the file name, with the dot.
        frame_rate: Frames per second.
        default_speed: Default number of seconds on the robot's clock per second of the film.
        write: Function that writes frames to a file, given the file, the frames and the frame rate.
    """

    suffix: str
    frame_rate: float
    default_speed: float
    write: Callable[[Path, Iterable[Image.Image], float], None]


MP4 = FilmFormat(".mp4", 25.0, 1.0, write_mp4)
"""MP4 video at full resolution."""
GIF = FilmFormat(".gif", 10.0, 2.0, write_gif)
"""Animated GIF at lower resolution; the format rounds the duration of a frame to a multiple of 0.01 s."""


def choose_format(file: Path | None, is_gif: bool) -> FilmFormat:
    """Return the film format for the suffix of a file; without a file, GIF if `is_gif`, otherwise MP4.

    Raises:
        InputError: The suffix of the file is unknown or contradicts `is_gif`.
    """
    if file is None:
        return GIF if is_gif else MP4
    suffix = file.suffix.lower()
    if is_gif and suffix != GIF.suffix:
        raise InputError(f'"{file}" cannot be a GIF; give a file name that ends in .gif, or omit --gif')
    for film_format in (MP4, GIF):
        if film_format.suffix == suffix:
            return film_format
    raise InputError(f'"{file}" cannot be a film; give a file name that ends in {MP4.suffix} or {GIF.suffix}')


@contextmanager
def prepare_file(path: Path, *, force: bool) -> Iterator[Path]:
    """Yield a temporary file for a film, and move the file to `path` at the end unless an exception occurs.

    Raises:
        InputError: `path` exists and `force` is False, or the file cannot be written.
    """
    if path.exists() and not force:
        raise InputError(f'"{path}" exists; name another file with -o, or overwrite it with --force')
    with (
        explain_os_errors(InputError, f'cannot write the film "{path}"', "name another place with -o"),
        replace_atomically(path) as partial_file,
    ):
        yield partial_file
