"""Write the meshes of bolt, nut and washer beside this file: `python make_meshes.py`.

Lengths in metres, axes along z, one `o` group for every convex part: the simulator takes each group as a
convex hull of its own, so a hole stays a hole.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

Point = tuple[float, float]

TURN = 2 * math.pi


def polygon(corners: int, inscribed: float) -> list[Point]:
    """Return a regular polygon around a circle of radius `inscribed` [m], one of its sides facing x."""
    radius = inscribed / math.cos(math.pi / corners)
    return [on_circle(radius, (k - 0.5) / corners) for k in range(corners)]


def on_circle(radius: float, turn: float) -> Point:
    """Return the point of a circle at `turn` of a whole turn from x."""
    return radius * math.cos(TURN * turn), radius * math.sin(TURN * turn)


def sectors(inner: Sequence[Point], outer: Sequence[Point]) -> Iterator[list[Point]]:
    """Yield the convex quadrilaterals between two closed outlines of equally many points."""
    around = [*zip(inner, outer, strict=True), (inner[0], outer[0])]
    for (inner_a, outer_a), (inner_b, outer_b) in pairwise(around):
        yield [inner_a, outer_a, outer_b, inner_b]


def prism(outline: Sequence[Point], low: float, high: float, first: int) -> str:
    """Return an `o` group: a convex outline (anticlockwise) from height `low` to `high`.

    Its vertices are numbered from `first` on, twice as many as the outline has points.
    """
    count = len(outline)
    below, above = range(first, first + count), range(first + count, first + 2 * count)
    corners = [(*point, height) for height in (low, high) for point in outline]
    faces = [list(reversed(below)), list(above)]
    for k in range(count):
        following = (k + 1) % count
        faces.append([below[k], below[following], above[following], above[k]])
    lines = [f"o part_{first}"]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in corners]
    lines += ["f " + " ".join(map(str, face)) for face in faces]
    return "\n".join(lines) + "\n"


def mesh(parts: Sequence[tuple[Sequence[Point], float, float]]) -> str:
    """Return a Wavefront file of prisms (outline, low, high)."""
    groups, first = [], 1
    for outline, low, high in parts:
        groups.append(prism(outline, low, high, first))
        first += 2 * len(outline)
    return "".join(groups)


def bolt() -> str:
    """Return a bolt 64 mm long: a head 24 mm across flats and 12 mm high, a shaft of 16 mm."""
    return mesh([(polygon(6, 0.012), 0.0, 0.012), (polygon(24, 0.008), 0.012, 0.064)])


def nut() -> str:
    """Return a nut 38 mm across flats and 18 mm high, with a hole of 12 mm."""
    flats, corners = 0.019, 0.019 / math.cos(math.pi / 6)
    outer = [on_circle(corners if k % 2 else flats, k / 12) for k in range(12)]
    inner = [on_circle(0.006, k / 12) for k in range(12)]
    return mesh([(sector, 0.0, 0.018) for sector in sectors(inner, outer)])


def washer() -> str:
    """Return a washer 50 mm wide and 6 mm thick, with a hole of 18 mm."""
    outer, inner = ([on_circle(radius, k / 16) for k in range(16)] for radius in (0.025, 0.009))
    return mesh([(sector, 0.0, 0.006) for sector in sectors(inner, outer)])


def main() -> None:
    """Write the three files."""
    folder = Path(__file__).parent
    for make in (bolt, nut, washer):
        (folder / f"{make.__name__}.obj").write_text(make())


if __name__ == "__main__":
    main()
