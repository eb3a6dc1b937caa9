"""What stands for a status: shapes that need no font, drawn once with smooth edges."""

from __future__ import annotations

from functools import lru_cache

from PIL import Image, ImageDraw

from executive.view.film.ink import FAINT, STATUS

_FINE = 8
_WIDTH = 0.17


def put_mark(image: Image.Image, status: str, centre: tuple[float, float], size: int) -> None:
    """Draw the mark of a status: a triangle runs, a tick succeeded, a cross failed, a dot rests.

    Args:
        image: What it is drawn on.
        status: The status of a node.
        centre: Where [pixel].
        size: Side of the square around it [pixel].
    """
    colour = STATUS.get(status, FAINT)
    corner = (round(centre[0] - size / 2), round(centre[1] - size / 2))
    image.paste(colour, (*corner, corner[0] + size, corner[1] + size), _shape(status, size))


@lru_cache(maxsize=16)
def _shape(status: str, size: int) -> Image.Image:
    """Return how much of each pixel a mark covers, `(size, size)`."""
    side = size * _FINE
    shape = Image.new("L", (side, side))
    draw = ImageDraw.Draw(shape)
    width = round(side * _WIDTH)

    def line(*points: tuple[float, float]) -> None:
        scaled = [(x * side, y * side) for x, y in points]
        draw.line(scaled, 255, width, joint="curve")
        for x, y in (scaled[0], scaled[-1]):
            draw.ellipse((x - width / 2, y - width / 2, x + width / 2, y + width / 2), 255)

    if status == "RUNNING":
        draw.polygon([(0.16 * side, 0.08 * side), (0.92 * side, 0.5 * side), (0.16 * side, 0.92 * side)], 255)
    elif status == "SUCCESS":
        line((0.12, 0.54), (0.4, 0.82), (0.9, 0.22))
    elif status == "FAILURE":
        line((0.17, 0.17), (0.83, 0.83))
        line((0.83, 0.17), (0.17, 0.83))
    else:
        draw.ellipse([0.34 * side] * 2 + [0.66 * side] * 2, 255)
    return shape.resize((size, size), Image.Resampling.BOX)
