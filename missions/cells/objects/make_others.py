"""Write objects of no class beside this file, in `others`: `python make_others.py [FOLDER]`.

A detector that was trained with these objects in its images does not take every round object for a fruit.
Shapes, sizes and colours are random, but do not depend on the time of writing.
"""

from __future__ import annotations

import colorsys
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from shapes import (
    STEEL,
    Colour,
    Part,
    Texture,
    extrude,
    flatten_underside,
    make_bar,
    make_ellipse,
    make_ellipsoid_profile,
    make_rectangle,
    make_ring,
    revolve,
    write_object,
)

COUNT_PER_FORM = 6
"""Number of objects of each form."""
MIN_RIM = 0.006
"""Minimum radius of the end of a bottle [m]."""


def draw_colour(rng: np.random.Generator, saturation: float = 1.0) -> Colour:
    """Return a random colour; each third one is nearly grey."""
    strength = saturation * rng.uniform(0.4, 1.0) if rng.random() < 2 / 3 else 0.1
    red, green, blue = colorsys.hsv_to_rgb(rng.random(), strength, rng.uniform(0.25, 0.95))
    return round(red * 255), round(green * 255), round(blue * 255)


def draw_texture(name: str, rng: np.random.Generator) -> Texture:
    """Return a plain, striped, spotted or labelled texture."""
    texture = Texture(name, draw_colour(rng), rng.uniform(4, 12), rng.uniform(0.8, 3))
    pattern = rng.integers(4)
    colour = draw_colour(rng)
    if pattern == 1:
        texture.stripes(int(rng.integers(2, 9)), colour, int(rng.integers(2, 10)), bool(rng.random() < 0.5))
    elif pattern == 2:
        texture.spots(int(rng.integers(6, 40)), int(rng.integers(1, 7)), colour)
    elif pattern == 3:
        texture.rectangle(0, 0.3, 1, 0.7, colour).text("No. 1", 0.1, 0.6, draw_colour(rng))
    return texture.plain(draw_colour(rng))


def make_round(name: str, rng: np.random.Generator) -> tuple[list[Part], Texture]:
    """A ball, a flattened ball, or a lying elongated one."""
    radius = rng.uniform(0.018, 0.036)
    if rng.random() < 0.5:
        profile = make_ellipsoid_profile(radius, 2 * radius * rng.uniform(0.6, 1.0), rng.uniform(2, 3))
        return flatten_underside([revolve(profile)], 0.001), draw_texture(name, rng)
    length = 2 * radius * rng.uniform(1.2, 2.2)
    profile = [(r, x - length / 2) for r, x in make_ellipsoid_profile(0.7 * radius, length)]
    return flatten_underside([revolve(profile, "x")], 0.002), draw_texture(name, rng)


def make_container(name: str, rng: np.random.Generator) -> tuple[list[Part], Texture]:
    """A standing or lying bottle, jar or can."""
    width = rng.uniform(0.015, 0.032)
    neck = rng.uniform(MIN_RIM, width)
    height = rng.uniform(0.03, 0.06)
    shoulder = rng.uniform(0.4, 0.95) * height
    profile = [(0.0, 0.0), (width, 0.0), (width, shoulder), (neck, height), (0.0, height)]
    if rng.random() < 0.5:
        return [revolve(profile)], draw_texture(name, rng)
    lying = [(0.7 * r, 1.8 * z - 0.9 * height) for r, z in profile]
    return flatten_underside([revolve(lying, "x")], 0.001), draw_texture(name, rng)


def make_box(name: str, rng: np.random.Generator) -> tuple[list[Part], Texture]:
    """A box, or a flat thing with round corners."""
    length, width = rng.uniform(0.03, 0.09), rng.uniform(0.025, 0.06)
    height = rng.uniform(0.004, 0.045)
    outline = make_rectangle(0, 0, length, width)
    if rng.random() < 0.4:
        outline = make_ellipse(0, 0, length / 2, width / 2, rng.uniform(2, 6), 24)
    picture = (-length / 2, -width / 2, length / 2, width / 2)
    return [extrude(outline, 0, height, picture)], draw_texture(name, rng)


def make_long(name: str, rng: np.random.Generator) -> tuple[list[Part], Texture]:
    """A tool, piece of cutlery or pen: a bar with other bars, discs or rings at its ends."""
    length = rng.uniform(0.08, 0.14)
    height = rng.uniform(0.003, 0.01)
    widths = rng.uniform(0.004, 0.014, 2)
    outlines = [make_bar((-length / 2, 0), (length / 2, 0), *widths.tolist())]
    for end in (-1, 1):
        size = rng.uniform(0.006, 0.016)
        form = rng.integers(4)
        x = end * length / 2
        if form == 1:
            outlines.append(make_ellipse(x, 0, size * rng.uniform(1, 1.6), size))
        elif form == 2:
            outlines += make_ring(x + end * size, 0, size, 0.003)
        elif form == 3:
            outlines.append(make_rectangle(x, 0, size, rng.uniform(1, 2) * size))
    texture = Texture(name, STEEL, 5, 1.2).gradient(20) if rng.random() < 0.5 else draw_texture(name, rng)
    handle = texture.patch(1, draw_colour(rng))
    parts = [extrude(outline, 0, height, (-0.08, -0.03, 0.08, 0.03)) for outline in outlines]
    if rng.random() < 0.5:
        grip = make_rectangle(-length / 4, 0, length / 2, 1.2 * float(widths.max()))
        parts.append(extrude(grip, 0, 1.2 * height, handle))
    return parts, texture


def make_plate(name: str, rng: np.random.Generator) -> tuple[list[Part], Texture]:
    """A card or a board of another colour, with or without components."""
    length, width = rng.uniform(0.045, 0.08), rng.uniform(0.025, 0.055)
    texture = draw_texture(name, rng)
    if rng.random() < 0.6:
        texture.traces(26, draw_colour(rng))
    parts = [
        extrude(
            make_rectangle(0, 0, length, width), 0, 0.002, (-length / 2, -width / 2, length / 2, width / 2)
        )
    ]
    for index in range(int(rng.integers(0, 6))):
        x = rng.uniform(-0.35, 0.35) * length
        y = rng.uniform(-0.35, 0.35) * width
        block = make_rectangle(x, y, rng.uniform(0.1, 0.25) * length, rng.uniform(0.15, 0.3) * width)
        parts.append(
            extrude(
                block, 0.002, 0.002 + rng.uniform(0.001, 0.01), texture.patch(index + 2, draw_colour(rng))
            )
        )
    return parts, texture


FORMS: dict[str, Callable[[str, np.random.Generator], tuple[list[Part], Texture]]] = {
    "round": make_round, "container": make_container, "box": make_box, "long": make_long, "plate": make_plate,
}  # fmt: skip
"""Functions that make a random object of a form, by the beginning of its name."""


def main() -> None:
    """Write all objects."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for number, (form, make) in enumerate(FORMS.items()):
        for index in range(COUNT_PER_FORM):
            name = f"{form}_{index}"
            write_object(folder / "others", name, *make(name, np.random.default_rng([number, index])))


if __name__ == "__main__":
    main()
