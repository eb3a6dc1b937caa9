"""What a film can be: one to watch, or one for a README."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from executive.errors import InputError
from executive.view.film.encoder import write_gif, write_mp4


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
