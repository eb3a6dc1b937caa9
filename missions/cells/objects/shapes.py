"""Convex parts of meshes, and textures. Lengths are in metres, z points up."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
Point = tuple[float, float]
Colour = tuple[int, int, int]
"""Red, green and blue, 0 to 255."""

SIZE = 128
"""Side of a texture [pixel]."""
BLACK = (28, 28, 30)
SILVER = (196, 198, 202)
WHITE = (232, 232, 226)
GOLD = (206, 160, 60)
BLUE = (34, 70, 170)
GREEN = (40, 120, 60)
STEEL = (178, 182, 188)
PLAIN = (0.02, 0.02)
"""Texture coordinates of the plain patch in the lower left corner of each texture."""


@dataclass
class Part:
    """A convex part of an object.

    Attributes:
        vertices: Positions `(N, 3)` [m].
        uv: Texture coordinates `(N, 2)`, from the lower left corner, 0 to 1.
        faces: Indices of the vertices of each face, anticlockwise from outside.
    """

    vertices: Array
    uv: Array
    faces: list[list[int]]


def revolve(profile: Sequence[Point], axis: str = "z", flatness: float = 1.0, sides: int = 20) -> Part:
    """Return a body of revolution of points (radius, position along the axis), from low to high.

    The texture is wrapped around: u along the circumference, v along the axis. About the axis x, the height
    is multiplied by `flatness`.
    """
    points = np.array(profile, dtype=float)
    angles = math.tau * np.arange(sides + 1) / sides
    radius, along = points.T
    across = radius * np.cos(angles)[:, None]
    up = radius * np.sin(angles)[:, None]
    steps = np.broadcast_to(along, across.shape)
    columns = (across, up, steps) if axis == "z" else (steps, across, up * flatness)
    u = np.broadcast_to(np.arange(sides + 1)[:, None] / sides, across.shape)
    v = np.broadcast_to(np.linspace(0, 1, len(points)), across.shape)
    count = len(points)
    faces = []
    for side in range(sides):
        for index in range(count - 1):
            low = side * count + index
            corners = [low, low + count, low + count + 1, low + 1]
            # A point on the axis has no extent around it.
            if points[index, 0] == 0:
                corners.remove(low + count)
            if points[index + 1, 0] == 0:
                corners.remove(low + count + 1)
            faces.append(corners)
    vertices = np.stack(columns, axis=-1).reshape(-1, 3)
    return Part(vertices, np.stack([u, v], axis=-1).reshape(-1, 2), faces)


def make_ellipsoid_profile(
    radius: float, height: float, exponent: float = 2.0, count: int = 12
) -> list[Point]:
    """Return the profile of a superellipsoid of an exponent (2: ellipsoid, above: more like a cylinder)."""
    angles = np.linspace(-math.pi / 2, math.pi / 2, count)
    radii = radius * np.cos(angles).clip(0) ** (2 / exponent)
    radii[[0, -1]] = 0.0
    heights = height / 2 * (1 + np.sign(np.sin(angles)) * np.abs(np.sin(angles)) ** (2 / exponent))
    return [(float(r), float(z)) for r, z in zip(radii, heights, strict=True)]


def extrude(outline: Sequence[Point], low: float, high: float, picture: Sequence[float] = ()) -> Part:
    """Return a prism over a convex outline (anticlockwise).

    Its upper side shows the texture between x0, y0, x1, y1 [m], or the colour at a texture coordinate; its
    other sides are plain.
    """
    points = np.array(outline, dtype=float)
    count = len(points)
    top_uv = np.tile(PLAIN, (count, 1))
    if len(picture) == 4:
        corner = np.array(picture[:2])
        top_uv = (points - corner) / (np.array(picture[2:]) - corner)
    side_uv = np.tile(PLAIN if len(picture) != 2 else picture, (count, 1))
    if len(picture) == 2:
        top_uv = side_uv
    lower = np.column_stack([points, np.full(count, low)])
    upper = np.column_stack([points, np.full(count, high)])
    faces = [[*range(count - 1, -1, -1)], [*range(count, 2 * count)]]
    for index in range(count):
        following = (index + 1) % count
        faces.append([2 * count + index, 2 * count + following, 3 * count + following, 3 * count + index])
    return Part(np.vstack([lower, upper] * 2), np.vstack([side_uv, top_uv, side_uv, side_uv]), faces)


def make_rectangle(x: float, y: float, length: float, width: float) -> list[Point]:
    """Return the outline of a rectangle about a centre [m]."""
    a = length / 2
    b = width / 2
    return [(x - a, y - b), (x + a, y - b), (x + a, y + b), (x - a, y + b)]


def make_bar(start: Point, end: Point, start_width: float, end_width: float) -> list[Point]:
    """Return the outline of a bar between two points, which may become narrower [m]."""
    a = np.array(start)
    b = np.array(end)
    along = (b - a) / np.linalg.norm(b - a)
    side = np.array([-along[1], along[0]])
    corners = (
        a - side * start_width / 2,
        b - side * end_width / 2,
        b + side * end_width / 2,
        a + side * start_width / 2,
    )
    return [(float(x), float(y)) for x, y in corners]


def make_ellipse(
    x: float, y: float, a: float, b: float, exponent: float = 2.0, count: int = 20
) -> list[Point]:
    """Return the outline of a superellipse with half axes `a` and `b` about a centre [m]."""
    outline = []
    for angle in math.tau * np.arange(count) / count:
        cosine = math.cos(angle)
        sine = math.sin(angle)
        u = math.copysign(abs(cosine) ** (2 / exponent), cosine)
        v = math.copysign(abs(sine) ** (2 / exponent), sine)
        outline.append((x + a * u, y + b * v))
    return outline


def make_ring(x: float, y: float, radius: float, width: float, count: int = 10) -> list[list[Point]]:
    """Return the convex pieces of a ring about a centre, with the mean radius and the width [m]."""
    pieces = []
    for start, end in pairwise(math.tau * np.arange(count + 1) / count):
        corners = (
            (radius - width / 2, start),
            (radius + width / 2, start),
            (radius + width / 2, end),
            (radius - width / 2, end),
        )
        pieces.append([(x + r * math.cos(angle), y + r * math.sin(angle)) for r, angle in corners])
    return pieces


def bend(
    length: float, curvature_radius: float, radius: float, parts: int = 4, sides: int = 10
) -> list[Part]:
    """Return a bent tube with pointed ends, as convex parts; u runs along it, v around it."""
    count = 12
    angles = np.linspace(-length / 2, length / 2, count + 1) / curvature_radius
    turns = math.tau * np.arange(sides + 1) / sides
    rings = []
    for index, angle in enumerate(angles):
        distance = min(index, count - index) / count
        ring_radius = radius * min(1.0, 0.3 + 2.6 * distance)
        outward = np.array([math.sin(angle), math.cos(angle), 0.0])
        centre = curvature_radius * (outward - [0, 1, 0])
        circle = ring_radius * (np.outer(np.cos(turns), outward) + np.outer(np.sin(turns), [0, 0, 1]))
        rings.append(centre + circle)
    result = []
    cuts = np.linspace(0, count, parts + 1).round().astype(int).tolist()
    for first, last in pairwise(cuts):
        vertices = np.vstack(rings[first : last + 1])
        uv = [(ring / count, side / sides) for ring in range(first, last + 1) for side in range(sides + 1)]
        faces = []
        for ring in range(last - first):
            for side in range(sides):
                low = ring * (sides + 1) + side
                faces.append([low, low + 1, low + sides + 2, low + sides + 1])
        faces.append([*range(sides - 1, -1, -1)])
        offset = (last - first) * (sides + 1)
        faces.append([*range(offset, offset + sides)])
        result.append(Part(vertices, np.array(uv), faces))
    return result


def flatten_underside(parts: Sequence[Part], depth: float) -> list[Part]:
    """Return the parts with a flat facet below, `depth` [m] above their lowest point, on which they rest."""
    low = min(part.vertices[:, 2].min() for part in parts) + depth
    for part in parts:
        part.vertices[:, 2] = part.vertices[:, 2].clip(low)
    return list(parts)


class Texture:
    """A texture with fine noise, on which patterns are drawn; x to the right, y downwards [pixel].

    Attributes:
        image: The image `(SIZE, SIZE, 3)`, with the channels red, green and blue.
        rng: Random number generator of the object.
    """

    def __init__(self, name: str, colour: Colour, contrast: float = 6.0, blur: float = 1.5) -> None:
        self.rng = np.random.default_rng(zlib.crc32(name.encode()))
        noise = np.asarray(cv2.GaussianBlur(self.rng.normal(size=(SIZE, SIZE)), (0, 0), blur))
        # Few levels of grey make the file small.
        noise = (noise * (contrast / noise.std()) / 4).round() * 4
        self.image: Image = (np.array(colour) + noise[..., None]).clip(0, 255).astype(np.uint8)

    def rectangle(self, left: float, top: float, right: float, bottom: float, colour: Colour) -> Texture:
        """Fill a rectangle, with its sides as fractions of the size."""
        corners = [round(value * SIZE) for value in (left, top, right, bottom)]
        cv2.rectangle(self.image, corners[:2], (corners[2] - 1, corners[3] - 1), colour, -1)
        return self

    def text(self, text: str, x: float, y: float, colour: Colour, scale: float = 0.5) -> Texture:
        """Write a text, with its lower left corner as fractions of the size."""
        place = (round(x * SIZE), round(y * SIZE))
        cv2.putText(self.image, text, place, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 2, cv2.LINE_8)
        return self

    def spots(self, count: int, radius: int, colour: Colour) -> Texture:
        """Draw random spots of a radius [pixel]."""
        for x, y in self.rng.integers(0, SIZE, (count, 2)).tolist():
            cv2.circle(self.image, (x, y), radius, colour, -1, cv2.LINE_8)
        return self

    def stripes(self, count: int, colour: Colour, width: int = 2, vertical: bool = True) -> Texture:
        """Draw parallel stripes of a width [pixel] over all of the texture."""
        for position in np.linspace(0, SIZE, count, endpoint=False).astype(int).tolist():
            start = (position, 0) if vertical else (0, position)
            end = (position, SIZE) if vertical else (SIZE, position)
            cv2.line(self.image, start, end, colour, width, cv2.LINE_8)
        return self

    def traces(self, count: int, colour: Colour) -> Texture:
        """Draw the traces of a circuit board."""
        for x, y in self.rng.integers(4, SIZE - 4, (count, 2)).tolist():
            dx, dy = self.rng.integers(-28, 29, 2).tolist()
            cv2.line(self.image, (x, y), (x + dx, y), colour, 1, cv2.LINE_8)
            cv2.line(self.image, (x + dx, y), (x + dx, y + dy), colour, 1, cv2.LINE_8)
            cv2.circle(self.image, (x, y), 2, GOLD, -1, cv2.LINE_8)
        return self

    def gradient(self, change: float) -> Texture:
        """Make the right side brighter and the left side darker, as polished steel reflects a room."""
        ramp = np.linspace(-change, change, SIZE)[None, :, None]
        brightened = np.asarray((self.image + ramp).clip(0, 255), np.uint8)
        self.image[:] = brightened
        return self

    def plain(self, colour: Colour) -> Texture:
        """Paint the plain patch, which the sides of prisms show."""
        return self.rectangle(0, 0.96, 0.04, 1, colour)

    def patch(self, index: int, colour: Colour) -> Point:
        """Paint a patch at the left edge, and return its texture coordinate."""
        top = 0.06 * index
        self.rectangle(0, top, 0.04, top + 0.06, colour)
        return 0.02, 1 - top - 0.03


def write_object(folder: Path, name: str, parts: Sequence[Part], texture: Texture) -> None:
    """Write mesh, material and texture of an object, with the origin in the middle of its underside."""
    vertices = np.vstack([part.vertices for part in parts])
    low = vertices.min(axis=0)
    high = vertices.max(axis=0)
    origin = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]]
    lines = [f"mtllib {name}.mtl", "usemtl skin"]
    first = 1
    for number, part in enumerate(parts):
        lines.append(f"o part_{number}")
        # Adding zero replaces -0 by 0.
        lines += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in (part.vertices - origin).round(5) + 0.0]
        lines += [f"vt {u:.3f} {v:.3f}" for u, v in part.uv.round(3) + 0.0]
        for face in part.faces:
            lines.append("f " + " ".join(f"{first + index}/{first + index}" for index in face))
        first += len(part.vertices)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.obj").write_text("\n".join(lines) + "\n", encoding="ascii")
    (folder / f"{name}.mtl").write_text(f"newmtl skin\nKd 1 1 1\nmap_Kd {name}.png\n", encoding="ascii")
    encoded = cv2.imencode(".png", texture.image[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])[1]
    (folder / f"{name}.png").write_bytes(encoded.tobytes())
